"""The devices that Vulkan can draw on, asked of the system's own loader.

Structures and numbers are those of the Vulkan 1.0 specification.
"""

import ctypes

LOADER = "libvulkan.so.1"
_INSTANCE_CREATE_INFO = 1
_NAME_OFFSET = 20
"""Of a device's name in VkPhysicalDeviceProperties: it follows five numbers of four bytes."""
_PROPERTIES_SIZE = 4096
"""More than VkPhysicalDeviceProperties takes, which is below a thousand bytes."""


class _InstanceCreateInfo(ctypes.Structure):
    _fields_ = (
        ("kind", ctypes.c_int),
        ("next", ctypes.c_void_p),
        ("flags", ctypes.c_uint32),
        ("application", ctypes.c_void_p),
        ("layer_count", ctypes.c_uint32),
        ("layers", ctypes.c_void_p),
        ("extension_count", ctypes.c_uint32),
        ("extensions", ctypes.c_void_p),
    )


def devices() -> list[str]:
    """Return the names of the devices, the first being what a program gets that does not choose.

    Raises:
        OSError: If there is no loader.
        RuntimeError: If it fails.
    """
    vulkan = ctypes.CDLL(LOADER)
    instance = ctypes.c_void_p()
    wanted = _InstanceCreateInfo(kind=_INSTANCE_CREATE_INFO)
    status = vulkan.vkCreateInstance(ctypes.byref(wanted), None, ctypes.byref(instance))
    if status:
        raise RuntimeError(f"Vulkan has no driver that starts (status {status})")
    try:
        return _names(vulkan, instance)
    finally:
        vulkan.vkDestroyInstance(instance, None)


def _names(vulkan: ctypes.CDLL, instance: ctypes.c_void_p) -> list[str]:
    count = ctypes.c_uint32()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    found = (ctypes.c_void_p * count.value)()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), found)
    names = []
    for device in found:
        properties = ctypes.create_string_buffer(_PROPERTIES_SIZE)
        vulkan.vkGetPhysicalDeviceProperties(ctypes.c_void_p(device), properties)
        names.append(properties.raw[_NAME_OFFSET:].split(b"\0", 1)[0].decode(errors="replace"))
    return names

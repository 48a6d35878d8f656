"""The system's libraries that packages of dnet need, which pip does not bring."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Library:
    """A shared library of the system."""

    file: str
    debian: str
    """The package that holds it on Debian and Ubuntu."""
    use: str
    """What needs it."""


_VIEWER = "the Rerun viewer: dnet play, screenshots"
_OPEN3D = "Open3D: the tests"
LIBRARIES = (
    Library("libvulkan.so.1", "mesa-vulkan-drivers", _VIEWER),
    Library("libEGL.so.1", "libegl1", _VIEWER),
    Library("libxkbcommon.so.0", "libxkbcommon0", _VIEWER),
    Library("libxkbcommon-x11.so.0", "libxkbcommon-x11-0", _VIEWER),
    Library("libwayland-client.so.0", "libwayland-client0", _VIEWER),
    Library("libXcursor.so.1", "libxcursor1", _VIEWER),
    Library("libXi.so.6", "libxi6", _VIEWER),
    Library("libXrandr.so.2", "libxrandr2", _VIEWER),
    Library("libGL.so.1", "libgl1", _OPEN3D),
    Library("libusb-1.0.so.0", "libusb-1.0-0", _OPEN3D),
    Library("libgomp.so.1", "libgomp1", _OPEN3D),
)

Load = Callable[[str], object]


def missing_libraries(
    libraries: Sequence[Library] = LIBRARIES, *, load: Load = ctypes.CDLL
) -> list[Library]:
    """Return those that the system's loader does not find, or cannot load."""
    missing = []
    for library in libraries:
        try:
            load(library.file)
        except OSError:
            missing.append(library)
    return missing


def remedy(missing: Sequence[Library], *, root: bool) -> str:
    """Return the command that brings them on Debian and Ubuntu; empty if none is missing."""
    if not missing:
        return ""
    names = " ".join(dict.fromkeys(library.debian for library in missing))
    return f"{'' if root else 'sudo '}apt-get install -y --no-install-recommends {names}"

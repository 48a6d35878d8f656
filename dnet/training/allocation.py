"""Memory that stays: glibc told to keep large blocks instead of returning them at every step."""

import ctypes
import platform
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h
_THRESHOLD = 2**30


def keep_pages() -> bool:
    """Ask this process's malloc to reuse large blocks; return whether it agreed.

    By default glibc maps a fresh block of zeroed pages for every tensor above 32 MB and unmaps it
    when the tensor dies, and a training step spends more time in page faults than in arithmetic.
    The larger network trains more than twice as fast with this. Other C libraries are left alone.
    """
    if sys.platform != "linux" or platform.libc_ver()[0] != "glibc":
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    mallopt.argtypes = (ctypes.c_int, ctypes.c_int)
    mallopt.restype = ctypes.c_int
    return all(
        mallopt(option, _THRESHOLD) == 1 for option in (_M_MMAP_THRESHOLD, _M_TRIM_THRESHOLD)
    )

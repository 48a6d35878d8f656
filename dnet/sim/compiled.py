"""Compiling a numerical kernel with numba, once for all processes where the disk allows."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

from numba import njit

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

FAST = {"reassoc", "contract", "arcp", "nsz"}
"""What the compiler may do to sums and products. NaN and infinity keep their meaning, and the
same input gives the same bytes on one kind of processor."""


def compiled(kernel: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Compile a kernel at its first call and keep the machine code beside its module.

    Where neither the module's `__pycache__` nor the user's cache can be written, every process
    compiles anew. The cache knows only the kernel's own module: after an edit of a kernel that
    another module calls, delete the `.nbi` files in `__pycache__`.

    Give the kernel `typing.no_type_check`: the checks of the tests would wrap it in Python.
    """
    try:
        return njit(cache=True, fastmath=FAST, error_model="numpy")(kernel)
    except RuntimeError:  # numba finds no directory that it can write
        return njit(fastmath=FAST, error_model="numpy")(kernel)

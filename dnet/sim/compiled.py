"""Compiling a numerical kernel with numba, once for all processes where the disk allows."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ParamSpec, TypeVar

from numba import njit

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

FAST = {"reassoc", "contract", "arcp", "nsz"}
"""What the compiler may do to sums and products. NaN and infinity keep their meaning, and the
same input gives the same bytes on one kind of processor."""

_sources: set[Path] = set()
"""The modules of all kernels so far: a kernel's own comes after those that it imports."""


def compiled(kernel: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Compile a kernel at its first call and keep the machine code beside its module.

    Where neither the module's `__pycache__` nor the user's cache can be written, every process
    compiles anew. Give the kernel `typing.no_type_check`: the checks of the tests would wrap it
    in Python.
    """
    _forget_outdated(Path(kernel.__code__.co_filename))
    try:
        return njit(cache=True, fastmath=FAST, error_model="numpy")(kernel)
    except RuntimeError:  # numba finds no directory that it can write
        return njit(fastmath=FAST, error_model="numpy")(kernel)


def _forget_outdated(source: Path) -> None:
    """Remove machine code older than any module that it may hold parts of.

    Numba itself notices changes of the kernel's own module, but not of kernels that it calls.
    """
    if not source.exists():
        return
    _sources.add(source)
    newest = max(path.stat().st_mtime for path in _sources)
    for index in source.parent.glob(f"__pycache__/{source.stem}.*.nbi"):
        with suppress(OSError):
            if index.stat().st_mtime < newest:
                index.unlink()

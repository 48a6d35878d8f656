"""Compiling a numerical kernel with numba, once for all processes where the disk allows."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, overload

from numba import njit

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

FAST = {"reassoc", "contract", "arcp", "nsz"}
"""What the compiler may do to sums and products. NaN and infinity keep their meaning, and the
same input gives the same bytes on one kind of processor."""

_OPTIONS: dict[str, Any] = {"fastmath": FAST, "error_model": "numpy"}
_UNCALLED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

_sources: set[Path] = set()
"""The modules of all kernels so far: a kernel's own comes after those that it imports."""


@overload
def compiled(kernel: Callable[Arguments, Result]) -> Callable[Arguments, Result]: ...


@overload
def compiled(
    *, without_gil: bool
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]: ...


def compiled(
    kernel: Callable[Arguments, Result] | None = None, *, without_gil: bool = False
) -> (
    Callable[Arguments, Result]
    | Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]
):
    """Compile a kernel at its first call and keep the machine code beside its module.

    Where neither the module's `__pycache__` nor the user's cache can be written, every process
    compiles anew. Give the kernel `typing.no_type_check`: the checks of the tests would wrap it
    in Python.

    Args:
        kernel: What to compile. Left out, a decorator with the options comes back.
        without_gil: Whether other threads of Python may run at the same time as the kernel.
    """

    def compile_it(kernel: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        _forget_outdated(Path(kernel.__code__.co_filename))
        try:
            return njit(cache=True, nogil=without_gil, **_OPTIONS)(kernel)
        except RuntimeError:  # numba finds no directory that it can write
            return njit(nogil=without_gil, **_OPTIONS)(kernel)

    return compile_it if kernel is None else compile_it(kernel)


def compiled_part(part: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Compile what kernels call and Python cannot, in half the time.

    It is kept with the kernels, which hold what they call. Give it `typing.no_type_check` too.
    """
    _forget_outdated(Path(part.__code__.co_filename))
    return njit(**_OPTIONS, **_UNCALLED)(part)


def holds_parts(module_file: str) -> None:
    """Say that kernels hold parts of a module though it compiles nothing itself: intrinsics."""
    _sources.add(Path(module_file))


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

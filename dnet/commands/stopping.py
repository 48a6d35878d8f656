"""Ctrl-C that asks for an end instead of breaking off; twice, it breaks off after all."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def stopping(ask: Callable[[], None]) -> Iterator[None]:
    """Call `ask` at the first SIGINT or SIGTERM; the second has the effect that it always had.

    For use on the main thread.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def asked(number: int, frame: FrameType | None) -> None:
        del number, frame
        restore()
        ask()

    for number in before:
        signal.signal(number, asked)
    try:
        yield
    finally:
        restore()

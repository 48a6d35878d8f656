"""The root of all that is refused."""

from typing import Any


class DnetError(Exception):
    """The root: the command prints these in one line and exits with 1."""

    def __reduce__(self) -> tuple[Any, ...]:
        # From process to process an error goes by its message: `__init__` takes something else.
        return _again, (type(self), self.args)


def _again(kind: type[DnetError], args: tuple[Any, ...]) -> DnetError:
    error = kind.__new__(kind)
    error.args = args
    return error

"""What this machine lacks."""

from dnet.errors.root import DnetError


class MissingPackage(DnetError, ImportError):
    """A package that every whole installation has, and this one has not."""

    def __init__(self, package: str, what: str, remedy: str) -> None:
        super().__init__(f"{what} needs {package}, which is not installed; {remedy}")


class MissingExtra(DnetError, ImportError):
    """A package that only some need, and that is not installed."""

    def __init__(self, package: str, extra: str, what: str) -> None:
        super().__init__(
            f'{what} needs {package}, which is not installed; pip install "deformernet[{extra}]"'
        )


class Unfit(DnetError, RuntimeError):
    """A machine on which dnet does not work as it should."""

    def __init__(self, abilities: list[str]) -> None:
        super().__init__(
            f"{', '.join(abilities)} will not work here; the table above says what mends that"
        )


class NoDevice(DnetError, RuntimeError):
    """A device to compute on that this machine lacks."""

    def __init__(self, name: str) -> None:
        super().__init__(f"device {name} is not there: torch finds no GPU; use --device cpu")

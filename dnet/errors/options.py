"""Options and values that make no sense."""

from dnet.errors.root import DnetError


class TooFew(DnetError, ValueError):
    """A count below what makes sense."""

    def __init__(self, what: str, got: int | float, least: int | float) -> None:
        super().__init__(f"{what} is {got}, must be at least {least}")


class NotAFraction(DnetError, ValueError):
    """A share outside 0 to 1."""

    def __init__(self, what: str, got: float) -> None:
        super().__init__(f"{what} is {got}, must be from 0 to 1")


class TooShort(DnetError, ValueError):
    """A time that allows for nothing."""

    def __init__(self, what: str, got: float) -> None:
        super().__init__(f"{what} is {got}, must be above 0; leave it out for no limit")


class UnusedOption(DnetError, ValueError):
    """An option that does nothing beside the others."""

    def __init__(self, option: str, needs: str) -> None:
        super().__init__(f"{option} does nothing without {needs}; leave one out or add the other")


class OneOf(DnetError, ValueError):
    """Two options of which one is needed, and one alone."""

    def __init__(self, one: str, other: str) -> None:
        super().__init__(f"give either {one} or {other}, and not both")


class UnknownAblation(DnetError, LookupError):
    """A name that no ablation has."""

    def __init__(self, name: str, names: list[str]) -> None:
        super().__init__(f"there is no ablation {name!r}; there are {', '.join(names)}")

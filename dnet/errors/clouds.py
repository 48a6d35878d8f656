"""Clouds, and files of them."""

from pathlib import Path

from dnet.errors.root import DnetError


class ShortCloud(DnetError, ValueError):
    """A cloud with fewer points than were asked of it."""

    def __init__(self, got: int, want: int) -> None:
        super().__init__(f"cloud has {got} points, need at least {want}; is the object in view?")


class LongCloud(DnetError, ValueError):
    """A cloud with more points than a network takes."""

    def __init__(self, what: str, got: int, want: int) -> None:
        super().__init__(
            f"{what} has {got} points, the network takes {want}; "
            f"sample it with `farthest_points(cloud, {want})`"
        )


class HugeCloud(DnetError, ValueError):
    """A file with more points, or more bytes, than are read at a time."""

    def __init__(self, path: Path, what: str, got: int, most: int) -> None:
        super().__init__(
            f"{path} says that it holds {got} {what}, at most {most} are read; if it is a cloud, "
            "leave out points first: a network takes some thousands"
        )


class BadCloud(DnetError, ValueError):
    """A cloud with coordinates that are not numbers."""

    def __init__(self, what: str, bad: int, total: int) -> None:
        super().__init__(
            f"{what} has {bad} of {total} points with NaN or infinite coordinates; remove them"
        )


class BadCloudFile(DnetError, ValueError):
    """A file that holds no cloud to reach."""

    def __init__(self, path: Path, why: str) -> None:
        super().__init__(
            f"{path} {why}; give the visible surface of the object as (n, 3) in metres"
        )

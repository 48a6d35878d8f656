"""Episodes, their frames and their index."""

from pathlib import Path

from dnet.errors.root import DnetError


class NoEpisodes(DnetError, FileNotFoundError):
    """A directory without a single finished episode."""

    def __init__(self, path: Path | str, why: str = "holds no .mcap episode") -> None:
        super().__init__(f"{path} {why}; record some with `dnet record {path}`")


class BadEpisode(DnetError, ValueError):
    """A file that is not an episode, or not a whole one."""

    def __init__(self, path: Path | str, why: str, hint: str) -> None:
        super().__init__(f"{path} {why}; {hint}")


class BadIndex(DnetError, ValueError):
    """An index that says of a log what no log says."""

    def __init__(self, index: Path | str, name: str, what: str, value: object) -> None:
        super().__init__(
            f"{index} says of {name} that its {what} is {str(value)[:60]!r}, which no recording "
            "writes; delete the index: it is made anew from the logs"
        )


class NoSuchFrame(DnetError, IndexError):
    """A frame number beyond the end of an episode."""

    def __init__(self, path: Path | str, frame: int, count: int) -> None:
        super().__init__(
            f"{path} has no frame {frame}: it has {count} frames, 0 to {count - 1}; "
            f"`dnet inspect info {path}` lists them"
        )


class BackInTime(DnetError, ValueError):
    """A frame that is older than the one before it."""

    def __init__(self, path: Path, time: float, last: float) -> None:
        super().__init__(
            f"{path}: a frame at {time:.6f} s came after one at {last:.6f} s; "
            "add frames in the order in which they were seen"
        )


class BadNumber(DnetError, ValueError):
    """A value with NaN or infinity where a log must hold numbers."""

    def __init__(self, path: Path, what: str, time: float) -> None:
        super().__init__(
            f"{path}: {what} at {time:.6f} s holds NaN or infinity; "
            "the simulation has diverged, record this pair with another seed"
        )


class DamagedEpisode(DnetError, ValueError):
    """An episode that is not as long as it was when it was finished."""

    def __init__(self, path: Path | str, got: int, want: int) -> None:
        super().__init__(
            f"{path} has {got} bytes, had {want} when it was finished; remove it, and the same "
            "call records it again"
        )


class BrokenRecord(DnetError, ValueError):
    """A file that cannot be read any further from its front."""

    def __init__(self, path: Path, byte: int, why: str) -> None:
        super().__init__(
            f"{path} is broken at byte {byte}: {why}; `dnet inspect repair {path}` saves the whole "
            "frames before it"
        )
        self.byte = byte
        self.why = why

"""Files, directories and disks: what is missing, in the way, too large or does not fit."""

from pathlib import Path

from dnet.errors.root import DnetError


class MissingPath(DnetError, FileNotFoundError):
    """A file or directory that is not there."""

    def __init__(self, path: Path | str, what: str, hint: str) -> None:
        super().__init__(f"{what} {path} does not exist; {hint}")


class OccupiedOutput(DnetError, FileExistsError):
    """An output directory that already holds a run."""

    def __init__(self, path: Path | str, holds: str) -> None:
        super().__init__(
            f"output {path} already holds {holds}; choose another directory or remove it first"
        )


class OutputInUse(DnetError, RuntimeError):
    """A directory that another process writes into."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            f"another process writes into {folder}; wait for it, or choose another directory"
        )


class OtherRequest(DnetError, ValueError):
    """A directory in which another recording began."""

    def __init__(self, folder: Path | str, differences: list[str]) -> None:
        shown = ", ".join(differences[:4]) + (", ..." if len(differences) > 4 else "")
        super().__init__(
            f"{folder} holds a recording with other settings ({shown}); repeat the call that "
            "began it to go on with it, or choose another directory"
        )


class OtherRun(DnetError, ValueError):
    """Work that is to go on with other settings, or other data, than it began with."""

    def __init__(self, run: Path, name: str, before: object, now: object) -> None:
        super().__init__(
            f"the run in {run} has {name} {_short(before)}, not {_short(now)}; "
            "go on with the settings and the data that it began with, or choose another --out"
        )


class BadManifest(DnetError, ValueError):
    """A manifest that does not say what was recorded."""

    def __init__(self, path: Path | str, why: str) -> None:
        super().__init__(
            f"{path} is no manifest of a recording: {why}; the episodes beside it are readable "
            "by themselves, record into another directory"
        )


class BadName(DnetError, ValueError):
    """A name in a file that is no name of one."""

    def __init__(self, what: str, name: object, why: str) -> None:
        super().__init__(
            f"{what} is {_short(name)}, {why}; it must be one name of at most 255 bytes, without / "
            "and \\: rename it where it comes from, or leave that file out"
        )


class TooLarge(DnetError, ValueError):
    """A file, or a part of one, that is larger than anything of its kind."""

    def __init__(self, what: str, path: Path | str, got: int, most: int) -> None:
        super().__init__(
            f"{what} {path} has {got} bytes, at most {most} are read; it is not what its name says"
            ", or was not made by dnet: see where it comes from"
        )


class NoSpace(DnetError, OSError):
    """A disk without room for what is to be written."""

    def __init__(self, folder: Path | str, need: int, free: int) -> None:
        super().__init__(
            f"{folder} has {_bytes(free)} free, the recording takes about "
            f"{_bytes(need)}; make room, choose another disk, or ask for fewer --pairs, "
            "--shapes or frames on the way"
        )


def _bytes(count: int) -> str:
    return f"{count / 1e9:.2f} GB" if count >= 1e9 else f"{count / 1e6:.2f} MB"


class DiskAlmostFull(NoSpace):
    """A disk on which a run could not be finished."""

    def __init__(self, folder: Path, free: int, need: int) -> None:
        Exception.__init__(
            self,
            f"{folder} has {free / 1e6:.0f} MB free, and a run needs {need / 1e6:.0f} MB to end "
            "whole; make room, or choose another disk",
        )


class DiskFailed(DnetError, OSError):
    """A disk that does not take or give what is asked of it, where nothing else says so."""

    def __init__(self, error: OSError) -> None:
        super().__init__(
            f"{error.filename or 'a file'}: {error.strerror}; see that there is room and that you "
            "may read and write there; what was finished is kept"
        )


class Unwritten(DnetError, OSError):
    """A folder that takes no file."""

    def __init__(self, folder: Path, why: str) -> None:
        super().__init__(
            f"nothing can be written into {folder}: {why}; make room, or choose another directory; "
            "the originals are as they were"
        )


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

"""What looking after logs finds, and cannot do."""

from pathlib import Path

from dnet.errors.root import DnetError


class BrokenLimit(DnetError, RuntimeError):
    """A validation that found figures outside their limits."""

    def __init__(self, broken: list[str]) -> None:
        super().__init__(
            f"{len(broken)} of the material's limits broken: {'; '.join(broken)}; "
            "don't record with this simulation before you know why"
        )


class NothingSaved(DnetError, ValueError):
    """Broken files that hold no whole frame."""

    def __init__(self, names: list[str], files: int) -> None:
        shown = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
        super().__init__(
            f"nothing could be saved of {len(names)} of {files} files ({shown}); "
            "they are kept, record them again"
        )


class FaultyEpisodes(DnetError, ValueError):
    """Episodes of which a validation found something wrong."""

    def __init__(self, errors: int, warnings: int, episodes: int) -> None:
        super().__init__(
            f"{errors} errors and {warnings} warnings in {episodes} episodes; move the files with "
            "errors elsewhere and record them again, or save their whole frames with "
            "`dnet inspect repair`"
        )


class NoSuchEpisode(DnetError, LookupError):
    """An episode that a dataset lacks."""

    def __init__(self, root: Path | str, wanted: str, episodes: list[str]) -> None:
        shown = ", ".join(episodes[:4]) + (", ..." if len(episodes) > 4 else "")
        super().__init__(
            f"{root} has no readable episode {wanted}, neither as an id nor as a number: it has "
            f"{len(episodes)} ({shown}); `dnet inspect ls {root}` lists them"
        )


class BadCondition(DnetError, ValueError):
    """A condition on frames that is none."""

    def __init__(self, condition: str, why: str, columns: list[str]) -> None:
        super().__init__(
            f"{condition!r} is no condition on frames: {why}; write SQL that is true or false of "
            f"each, with the columns {', '.join(columns)}"
        )


class NothingMatches(DnetError, LookupError):
    """A condition that holds nowhere."""

    def __init__(self, root: Path | str, condition: str, frames: int) -> None:
        super().__init__(
            f"{condition!r} holds for none of {frames} frames of {root}; ask for less, "
            f"`dnet inspect stats {root}` tells what they are like"
        )


class Unmerged(DnetError, RuntimeError):
    """Recordings that Rerun did not write into one file."""

    def __init__(self, path: Path, count: int, why: str) -> None:
        super().__init__(
            f"Rerun could not write {count} recordings into {path}: {why}; make room, or save "
            "one episode at a time"
        )


class ClashingEpisodes(DnetError, ValueError):
    """Different episodes that one dataset cannot tell apart."""

    def __init__(self, what: str, name: str, paths: list[str]) -> None:
        apart = "rename one" if what == "name" else "record one of them with another --seed"
        super().__init__(
            f"{' and '.join(paths)} are different, but have one {what}: {name}; keep them in "
            f"folders of their own, or {apart}"
        )


class UnlikePaths(DnetError, ValueError):
    """A file and a directory that were to be compared."""

    def __init__(self, folder: Path, file: Path) -> None:
        super().__init__(
            f"{folder} is a directory and {file} is a file; compare two episodes or two directories"
        )


class SharedFolder(DnetError, ValueError):
    """Copies that would lie among the originals."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            f"{folder} holds the files to be repaired, which stay as they are; "
            "choose another directory for what is saved of them"
        )


class BadArrays(DnetError, ValueError):
    """A file of arrays that no episode can be made of."""

    def __init__(self, path: Path, why: str) -> None:
        super().__init__(
            f"{path} {why}; `dnet inspect import --help` says what it must hold, in metres"
        )

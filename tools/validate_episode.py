"""One episode file: everything that can be wrong with it."""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from dnet.datasets.mcap_file import McapFile
from dnet.datasets.reader import FRAME, GOAL, STEP, EpisodeReader
from dnet.datasets.sources import MappedFile
from dnet.errors import DnetError
from dnet.tools.validate_container import walk
from dnet.tools.validate_descriptions import Description, check_attachments, check_metadata
from dnet.tools.validate_findings import Finding, Findings
from dnet.tools.validate_messages import MessageChecks
from dnet.tools.validate_schemas import check_channels


@dataclass(frozen=True, slots=True)
class CheckedEpisode:
    """What became of one file."""

    path: Path
    findings: tuple[Finding, ...]
    episode: str | None = None
    """Id of a recording, which is the only one with it in its directory; None for servo runs,
    for files without frames, and where it cannot be read."""
    frames: int = 0


def check_episode(path: Path) -> CheckedEpisode:
    """Read all of a file and return what is wrong with it.

    A file that cannot be opened has that one finding.
    """
    findings = Findings(str(path))
    try:
        McapFile(path).close()
        with closing(MappedFile(path)) as source:
            return _check(path, source.view(0, len(source)), findings)
    except (DnetError, OSError) as error:
        if path.suffix == ".part":
            findings.warn("unfinished", "the recording runs, or was killed")
        else:
            findings.error("unreadable", _why(path, error))
        return CheckedEpisode(path, tuple(findings.all()))


def _check(path: Path, content: memoryview, findings: Findings) -> CheckedEpisode:
    checks = MessageChecks(findings)
    contents = walk(content, findings, checks.take)
    check_channels(contents, findings)
    description = check_metadata(contents.metadata, findings)
    check_attachments(contents.attachments, findings)
    checks.finish(finished=description.finished, points=description.points)
    frames, servo = checks.count(FRAME), checks.count(GOAL) + checks.count(STEP) > 0
    _check_end(path, description, frames=frames, findings=findings)
    episode = None if description.meta is None or servo else description.meta.episode_id
    if episode is not None and path.name.removesuffix(".part") != f"{episode}.mcap":
        findings.warn("episode-id", f"it is {episode}, the file's name should be the same")
    if not findings.errors:
        _check_reader(path, frames, findings)
    return CheckedEpisode(path, tuple(findings.all()), episode, frames)


def _check_end(path: Path, description: Description, *, frames: int, findings: Findings) -> None:
    if path.suffix == ".part":
        state = "is whole" if description.finished else "was interrupted"
        findings.warn("unfinished", f"the recording {state}, its whole frames are readable")
    elif not description.finished:
        findings.error("unfinished", "there is no dnet.result: the recording did not end by itself")
    said = frames if description.result is None else description.result.get("frames", frames)
    if said != frames:
        findings.error("result-frames", f"dnet.result says {said}, there are {frames}")


def _check_reader(path: Path, frames: int, findings: Findings) -> None:
    """Ask of what has no fault that dnet itself can read it."""
    try:
        with EpisodeReader(path) as episode:
            if len(episode) != frames:
                findings.add(
                    "error" if episode.finished else "warning",
                    "reader",
                    f"{len(episode)} of {frames} frames can be read",
                )
            episode.camera()
    except DnetError as error:
        findings.error("reader", _why(path, error))


def _why(path: Path, error: Exception) -> str:
    """Return what an error says of its file, without the file's name and the way out."""
    return str(error).removeprefix(f"{path} ").split(";")[0]

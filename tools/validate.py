"""Everything that is wrong with episodes and directories of them, as a table of findings."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import polars as pl

from dnet.errors import FaultyEpisodes, MissingPath, NoEpisodes, TooFew
from dnet.tools.validate_episode import CheckedEpisode, check_episode
from dnet.tools.validate_findings import Finding, Findings
from dnet.tools.validate_manifest import check_manifest

COLUMNS = {"file": pl.String, "severity": pl.String, "check": pl.String, "note": pl.String}


@dataclass(frozen=True, slots=True)
class Validation:
    """What was found in the files that were asked for."""

    episodes: int
    """Files that were read, unfinished and broken ones too."""
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> int:
        """How many findings make a file wrong."""
        return sum(finding.severity == "error" for finding in self.findings)

    @property
    def warnings(self) -> int:
        """How many findings are only odd."""
        return len(self.findings) - self.errors


def validate(
    paths: Sequence[Path], *, on_file: Callable[[int, int], None] = lambda _done, _total: None
) -> Validation:
    """Read all of the files and directories, and return what is wrong with them.

    Args:
        paths: Episodes, and directories with some.
        on_file: Called with the number of files read and of all files.

    Raises:
        TooFew: If there are no paths.
        MissingPath: If one of them does not exist.
        NoEpisodes: If a directory holds no episode, not even an unfinished one.
    """
    if not paths:
        raise TooFew("number of files and directories to validate", 0, 1)
    # The same file by two ways is one file.
    files = {file.resolve(): file for path in paths for file in _files(path)}
    checked = []
    for file in files.values():
        checked.append(check_episode(file))
        on_file(len(checked), len(files))
    findings = [finding for one in checked for finding in one.findings]
    findings += _repeated(checked)
    for directory in dict.fromkeys(path for path in paths if path.is_dir()):
        beside = [one for one in checked if one.path.parent == directory and _is_whole(one)]
        findings += check_manifest(directory, beside)
    return Validation(len(checked), tuple(findings))


def finding_table(validation: Validation) -> pl.DataFrame:
    """Return one row a finding: file, severity, check and a note that says what."""
    rows = [tuple(asdict(finding).values()) for finding in validation.findings]
    return pl.DataFrame(rows, schema=COLUMNS, orient="row")


def refuse_faulty(validation: Validation, *, strict: bool = False) -> None:
    """Do nothing if the files may be used.

    Raises:
        FaultyEpisodes: If there is an error or, where it is strict, a warning.
    """
    if validation.errors or (strict and validation.warnings):
        raise FaultyEpisodes(validation.errors, validation.warnings, validation.episodes)


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        if not path.exists():
            raise MissingPath(path, "episode", "`dnet inspect ls DIRECTORY` lists what is there")
        return [path]
    found = [*path.glob("*.mcap"), *path.glob("*.mcap.part")]
    files = sorted(file for file in found if file.is_file())
    if not files:
        raise NoEpisodes(path)
    return files


def _is_whole(one: CheckedEpisode) -> bool:
    return one.path.suffix == ".mcap"


def _repeated(checked: Sequence[CheckedEpisode]) -> list[Finding]:
    """Return the recordings of a directory that have an id that another has."""
    names: dict[tuple[Path, str], list[Path]] = defaultdict(list)
    for one in checked:
        if one.episode is not None and _is_whole(one):
            names[one.path.parent, one.episode].append(one.path)
    found = []
    for (_, episode), paths in names.items():
        for path in paths[1:]:
            findings = Findings(str(path))
            findings.error(
                "episode-id", f"{paths[0].name} is {episode} too; a split would mix their frames"
            )
            found += findings.all()
    return found

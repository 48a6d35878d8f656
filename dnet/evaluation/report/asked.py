"""What an experiment was asked to do: written before it begins, read when it is reported."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from dnet.errors import BadName, BadReport, TooLarge
from dnet.files.plain_names import plain_path
from dnet.files.sizes import read_json
from dnet.files.whole_file import write_whole

ASKED = "asked.json"


@dataclass(frozen=True)
class Asked:
    """What was asked of one experiment, and with what."""

    count: int
    """Cases, goals or the like."""
    full: int
    """As many as the paper has."""
    seed: int
    scale: float
    versions: Mapping[str, str]
    weights: Mapping[str, str]
    """SHA-256 of each network, its beginning."""
    data: Mapping[str, str]
    """Fingerprint of the settled frames of each set of episodes."""
    options: Mapping[str, Any] = field(default_factory=dict)
    runs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Of each method, the directories of its runs, in that of the experiment."""

    @property
    def reduced(self) -> str:
        """How a figure is to be read that rests on less than the paper's; empty if on as much."""
        if self.count >= self.full:
            return ""
        return f"on {self.count} of {self.full}, at scale {self.scale:g}"


def write_asked(folder: Path, asked: Asked) -> None:
    """Write down what is asked of the experiment in a directory."""
    write_whole(folder / ASKED, (json.dumps(asdict(asked), indent=2) + "\n").encode())


def read_asked(folder: Path) -> Asked | None:
    """Return what was asked of the experiment in a directory; None if nothing was.

    Raises:
        BadReport: If that cannot be read.
        BadName: If it names a run that is not in that directory.
        TooLarge: If it is larger than any of its kind.
    """
    path = folder / ASKED
    try:
        content = read_json(path, what="order of an experiment")
        runs = {
            method: tuple(str(plain_path(name, what=f"a run in {path}")) for name in names)
            for method, names in content.pop("runs").items()
        }
        return Asked(**content, runs=runs)
    except FileNotFoundError:
        return None
    except (BadName, TooLarge):
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        way_out = f"remove {folder}, and run it again"
        raise BadReport(path, f"is unreadable ({error!r})", way_out) from error

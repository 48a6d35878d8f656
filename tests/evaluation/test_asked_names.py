"""The runs that an experiment names: directories within its own, or refused."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from dnet.errors import BadName
from dnet.evaluation.report.asked import ASKED, Asked, read_asked, write_asked

ORDER = Asked(1, 1, 0, 1.0, {}, {}, {}, {}, {"method": ("true/a", "b")})


def test_runs_are_directories_of_the_experiment(tmp_path: Path) -> None:
    write_asked(tmp_path, ORDER)
    assert read_asked(tmp_path) == ORDER


@pytest.mark.parametrize(
    "name", ["../../x", "/etc", "a/../../b", "a\0b", "a\nb", "..\\x", "x" * 300, "", None]
)
def test_a_run_elsewhere_is_refused(tmp_path: Path, name: str | None) -> None:
    content = asdict(ORDER) | {"runs": {"method": [name]}}
    (tmp_path / ASKED).write_text(json.dumps(content))
    with pytest.raises(BadName, match="a run in"):
        read_asked(tmp_path)

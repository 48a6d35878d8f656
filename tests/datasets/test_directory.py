from pathlib import Path

import pytest

from dnet.datasets.directory import find_episodes, find_unfinished
from dnet.errors import MissingPath, NoEpisodes


def test_finished_episodes_come_sorted_and_others_do_not_count(tmp_path: Path) -> None:
    for name in ("b.mcap", "a.mcap", "c.mcap.part", "notes.txt", "run.rrd"):
        (tmp_path / name).touch()
    (tmp_path / "directory.mcap").mkdir()
    assert [path.name for path in find_episodes(tmp_path)] == ["a.mcap", "b.mcap"]
    assert [path.name for path in find_unfinished(tmp_path)] == ["c.mcap.part"]


def test_a_directory_without_episodes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes, match=r"holds no \.mcap episode; record some with `dnet record"):
        find_episodes(tmp_path)


def test_unfinished_recordings_are_mentioned_when_there_are_only_those(tmp_path: Path) -> None:
    (tmp_path / "a.mcap.part").touch()
    with pytest.raises(NoEpisodes, match=r"1 unfinished recording.*a\.mcap\.part"):
        find_episodes(tmp_path)


@pytest.mark.parametrize("name", ["nowhere", "file.mcap"])
def test_what_is_no_directory_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "file.mcap").touch()
    with pytest.raises(MissingPath, match=name):
        find_episodes(tmp_path / name)

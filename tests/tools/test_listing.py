from pathlib import Path

import numpy as np
import polars as pl
import pytest

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadEpisode, MissingPath, NoEpisodes
from dnet.geometry.chamfer import chamfer
from dnet.recorders.episode import EpisodeWriter
from dnet.tools.listing import describe_episode, list_episodes
from tests.recorders.rollout import ARMS, frames, meta, write, write_servo


def interrupted(path: Path, *, count: int) -> Path:
    """Leave a `.part` file with the first frames, as Ctrl-C does."""
    with EpisodeWriter(path, meta(path.stem), arms=ARMS, attachments={}) as writer:
        for one in frames(3)[:count]:
            writer.add(one)
    return writer.part


def test_each_episode_has_a_row_with_its_figures(tmp_path: Path) -> None:
    write(tmp_path / "b.mcap", frames(4, points=50))
    write(tmp_path / "a.mcap", frames(2))
    table = list_episodes(tmp_path)
    assert table["episode"].to_list() == ["a", "b"]
    assert table["frames"].to_list() == [3, 7]
    assert table["shapes"].to_list() == [1, 3]
    assert table["points"].to_list() == [64, 50]
    assert table["seconds"].to_list() == [1.0, 3.0]
    sizes = [(tmp_path / f"{name}.mcap").stat().st_size / 1e6 for name in "ab"]
    assert table["MB"].to_list() == sizes
    assert table["finished"].all()
    assert table["note"].to_list() == ["", ""]


def test_unfinished_and_broken_files_are_listed_with_a_note(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap", frames(2)).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "other.mcap").write_bytes(b"something else")
    interrupted(tmp_path / "stopped.mcap", count=2)
    (tmp_path / "killed.mcap.part").write_bytes(whole[: len(whole) // 2])
    rows = {row["episode"]: row for row in list_episodes(tmp_path).iter_rows(named=True)}
    assert rows.keys() == {"whole", "cut", "other", "stopped", "killed"}
    assert [name for name, row in rows.items() if row["finished"]] == ["whole"]
    assert "cut off in the middle" in rows["cut"]["note"]
    assert "not an MCAP file" in rows["other"]["note"]
    assert rows["stopped"]["frames"] == 2
    assert "interrupted" in rows["stopped"]["note"]
    assert rows["killed"]["note"].startswith("unfinished")
    assert rows["killed"]["frames"] is None


def test_a_directory_with_unfinished_recordings_alone_is_listed(tmp_path: Path) -> None:
    interrupted(tmp_path / "a.mcap", count=0)
    table = list_episodes(tmp_path)
    assert table["frames"].to_list() == [0]
    assert table["seconds"].to_list() == [0.0]


def test_an_empty_directory_and_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes):
        list_episodes(tmp_path)
    with pytest.raises(MissingPath):
        list_episodes(tmp_path / "nowhere")


def test_frames_are_measured_from_the_rest_frame(tmp_path: Path) -> None:
    seen = frames(3)
    table = describe_episode(write(tmp_path / "a.mcap", seen)).frames
    assert table["frame"].to_list() == list(range(len(seen)))
    assert table["kind"].to_list() == [one.kind for one in seen]
    assert table["points"].to_list() == [64] * len(seen)
    np.testing.assert_array_equal(table.select("x", "y", "z"), [one.grasp for one in seen])
    motions = [1e3 * np.linalg.norm(one.grasp - seen[0].grasp) for one in seen]
    np.testing.assert_allclose(table["motion_mm"], motions)
    assert table["chamfer_mm"][0] == 0
    np.testing.assert_allclose(
        table["chamfer_mm"], [1e3 * chamfer(one.cloud, seen[0].cloud) for one in seen]
    )


def test_the_summary_tells_how_the_episode_was_made(tmp_path: Path) -> None:
    summary = describe_episode(write(tmp_path / "a.mcap", frames(2))).summary
    assert summary["episode"] == "a"
    assert summary["seed"] == 3
    assert summary["scene.yaw"] == 0.1
    assert summary["settings.box.size"] == [0.1, 0.1, 0.04]
    assert summary["attachments"] == "psm.urdf, config.json"
    assert summary["result.rejected.folded"] == 2
    assert "goal" not in summary


def test_the_summary_of_a_servo_run_counts_its_steps(tmp_path: Path) -> None:
    summary = describe_episode(write_servo(tmp_path / "run.mcap")).summary
    assert summary["goal"] == "64 points"
    assert summary["steps"] == 3
    assert summary["result.outcome"] == "converged"


def test_an_interrupted_episode_is_described_as_far_as_it_goes(tmp_path: Path) -> None:
    part = interrupted(tmp_path / "a.mcap", count=2)
    described = describe_episode(part)
    assert described.frames.height == 2
    assert described.summary["finished"] is False
    with EpisodeReader(part) as episode:
        assert len(episode) == 2


def test_a_cut_off_episode_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", frames(2))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(BadEpisode, match="cut off in the middle"):
        describe_episode(path)


def test_columns_keep_their_types_without_rows(tmp_path: Path) -> None:
    described = describe_episode(write(tmp_path / "a.mcap", []))
    assert described.frames.height == 0
    assert described.frames.schema["motion_mm"] == pl.Float64

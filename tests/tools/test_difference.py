import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from dnet.datasets.index import open_index
from dnet.tools.difference import compare_datasets, compare_episodes, first_difference
from tests.datasets.dataset import write_dataset
from tests.datasets.test_reader import rewrite
from tests.recorders.rollout import frames, write


def test_an_episode_does_not_differ_from_its_copy_however_it_is_packed(tmp_path: Path) -> None:
    one = write(tmp_path / "a.mcap", frames(3), name="a")
    shutil.copy(one, tmp_path / "b.mcap")
    found = compare_episodes(one, tmp_path / "b.mcap")
    assert found.same
    assert found.same_bytes
    packed = rewrite(one, tmp_path / "c.mcap", compression=CompressionType.ZSTD)
    found = compare_episodes(one, packed)
    assert found.same
    assert not found.same_bytes
    assert first_difference(found) == "packed in another way, with the same content"


def test_frames_that_differ_are_named_with_how_far(tmp_path: Path) -> None:
    seen = frames(3)
    cloud = seen[2].cloud.copy()
    cloud[5] += np.array([0.003, 0.004, 0.0], np.float32)
    changed = [*seen[:2], replace(seen[2], cloud=cloud), replace(seen[3], kind="shape"), *seen[4:]]
    one = write(tmp_path / "a.mcap", seen, name="a")
    other = write(tmp_path / "b.mcap", changed, name="a")
    found = compare_episodes(one, other)
    assert not found.same
    assert found.frames["frame"].to_list() == [2, 3]
    np.testing.assert_allclose(found.frames["cloud_mm"].to_numpy(), [5.0, 0.0], atol=1e-4)
    assert found.frames["what"].to_list() == ["", "kind way and shape"]
    assert first_difference(found) == "2 frames, the first is 2: cloud by 5 mm"


def test_what_is_known_of_episodes_is_compared(tmp_path: Path) -> None:
    one = write(tmp_path / "a.mcap", frames(2))
    other = write(tmp_path / "b.mcap", frames(3))
    found = compare_episodes(one, other)
    assert found.facts["frames"] == (3, 5)
    assert found.facts["episode_id"] == ("a", "b")
    assert found.facts["result.frames"] == (3, 5)
    assert "scene.yaw" not in found.facts


def test_datasets_are_compared_file_by_file(tmp_path: Path) -> None:
    one = write_dataset(tmp_path / "one", (2, 3, 2))
    other = tmp_path / "other"
    shutil.copytree(one, other)
    assert compare_datasets(open_index(one), open_index(other)).height == 0
    (other / "episode-0.mcap").unlink()
    (other / "episode-1.mcap").unlink()
    write(other / "episode-1.mcap", frames(4, seed=1))
    write(other / "episode-9.mcap", frames(2))
    rows = dict(compare_datasets(open_index(one), open_index(other)).iter_rows())
    assert rows.keys() == {"episode-0.mcap", "episode-1.mcap", "episode-9.mcap"}
    assert rows["episode-0.mcap"] == f"only in {one}"
    assert rows["episode-9.mcap"] == f"only in {other}"
    assert rows["episode-1.mcap"] == "frames: 5 and 7"


@pytest.mark.parametrize("count", [2, 3])
def test_other_numbers_of_points_have_no_distance(tmp_path: Path, count: int) -> None:
    one = write(tmp_path / "a.mcap", frames(count), name="a")
    other = write(tmp_path / "b.mcap", frames(count, points=66), name="a")
    found = compare_episodes(one, other)
    assert found.frames["cloud_mm"].null_count() == found.frames.height == 2 * count - 1
    assert "cloud of 64 and 66 points" in found.frames["what"][0]

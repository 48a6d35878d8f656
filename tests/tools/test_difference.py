import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from dnet.datasets.index import open_index
from dnet.geometry.camera import Camera
from dnet.recorders.episode import EpisodeWriter
from dnet.tools.difference import PACKED, compare_datasets, compare_episodes, first_difference
from tests.datasets.dataset import write_dataset
from tests.datasets.test_reader import rewrite
from tests.recorders.rollout import ARMS, frames, meta, step, with_image, write


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


def servo(path: Path, *, shift: float, chamfer: float) -> Path:
    seen = frames(2)
    with EpisodeWriter(path, meta("run"), arms=ARMS, attachments={}) as writer:
        writer.set_goal(seen[-1].cloud + np.float32(shift))
        writer.add_step(replace(step(seen[0], seen[-1]), chamfer=chamfer), 0)
        writer.finish({"outcome": "converged"})
    return path


@pytest.mark.parametrize(
    ("shift", "chamfer", "topics"),
    [(0.0, 0.01, set()), (0.01, 0.01, {"/cloud/goal"}), (0.0, 0.02, {"/step", "/log"})],
)
def test_goals_and_steps_are_compared(
    tmp_path: Path, shift: float, chamfer: float, topics: set[str]
) -> None:
    one = servo(tmp_path / "a.mcap", shift=0.0, chamfer=0.01)
    found = compare_episodes(one, servo(tmp_path / "b.mcap", shift=shift, chamfer=chamfer))
    assert set(found.messages) == topics
    assert found.same != bool(topics)
    assert not found.facts
    assert not found.frames.height
    assert set(found.messages.values()) <= {0}


def test_images_are_compared(tmp_path: Path) -> None:
    camera, seen = Camera(width=8, height=6), frames(2)
    looks = [[with_image(one, camera) for one in seen] for _ in range(2)]
    looks[1][1] = with_image(seen[1], camera, seed=1)
    one, other = (
        write(tmp_path / f"{name}.mcap", look, name="a", camera=camera)
        for name, look in zip("ab", looks, strict=True)
    )
    found = compare_episodes(one, other)
    assert found.messages == {"/camera/depth": 1, "/camera/mask": 1}
    assert first_difference(found) == "/camera/depth: from message 1 on"


def test_a_message_that_only_one_has_is_a_difference(tmp_path: Path) -> None:
    one = write(tmp_path / "a.mcap", frames(2), name="a")
    other = rewrite(
        one,
        tmp_path / "b.mcap",
        lambda topic, number, old: None if (topic, number) == ("/log", 1) else old,
    )
    for pair in ((one, other), (other, one)):
        assert compare_episodes(*pair).messages == {"/log": 1}


def test_packing_and_files_that_are_broken_alike_are_told_apart(tmp_path: Path) -> None:
    one = write_dataset(tmp_path / "one", (2,))
    other = tmp_path / "other"
    shutil.copytree(one, other)
    (other / "episode-0.mcap").unlink()
    rewrite(one / "episode-0.mcap", other / "episode-0.mcap", compression=CompressionType.ZSTD)
    for folder in (one, other):
        (folder / "alike.mcap").write_bytes(b"noise")
        (folder / "unlike.mcap").write_bytes(folder.name.encode())
    rows = dict(compare_datasets(open_index(one), open_index(other)).iter_rows())
    assert rows["episode-0.mcap"] == PACKED
    assert rows.keys() == {"episode-0.mcap", "unlike.mcap"}

from pathlib import Path

import numpy as np
import pytest

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadEpisode
from dnet.geometry.chamfer import chamfer
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.replay import replay
from tests.recorders.rollout import ARMS, frame, frames, meta, write, write_servo
from tests.recorders.rrd import entities, rows


def replayed(episode: Path) -> tuple[Path, float]:
    target = episode.with_suffix(".rrd")
    with EpisodeReader(episode) as reader:
        return target, replay(reader, target)


def test_every_frame_is_replayed_at_its_time(tmp_path: Path) -> None:
    seen = frames(3)
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    clouds = rows(path, "/cloud/current", "Points3D:positions", timeline="sim_time")
    assert [time for time, _ in clouds] == [one.time for one in seen]
    for one, (_, points) in zip(seen, clouds, strict=True):
        np.testing.assert_array_equal(points, one.cloud)
    points = rows(path, "/manipulation_point", "Points3D:positions", timeline="frame")
    np.testing.assert_allclose(
        [point for _, (point,) in points], [one.grasp for one in seen], atol=1e-7
    )


def test_the_last_shape_stands_for_the_goal_of_a_recording(tmp_path: Path) -> None:
    seen = [*frames(3), frame(9.0, np.zeros(3), "way")]
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    ((_, goal),) = rows(path, "/cloud/goal", "Points3D:positions", timeline=None)
    np.testing.assert_array_equal(goal, seen[-2].cloud)
    ((_, label),) = rows(path, "/cloud/goal/label", "Points3D:labels", timeline=None)
    assert label == ["last shape"]


def test_curves_of_a_recording_are_distances_from_goal_and_rest(tmp_path: Path) -> None:
    seen = frames(3)
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    settled = [one for one in seen if one.kind != "way"]
    chamfers = rows(path, "/chamfer", "Scalars:scalars", timeline="sim_time")
    assert [time for time, _ in chamfers] == [one.time for one in settled]
    np.testing.assert_allclose(
        [value for _, (value,) in chamfers],
        [1e3 * chamfer(one.cloud, seen[-1].cloud) for one in settled],
    )
    motions = rows(path, "/motion_length", "Scalars:scalars", timeline="sim_time")
    np.testing.assert_allclose(
        [value for _, (value,) in motions],
        [1e3 * np.linalg.norm(one.grasp - seen[0].grasp) for one in seen],
    )


def test_a_servo_run_shows_its_goal_and_its_steps(tmp_path: Path) -> None:
    seen = frames(3)
    path, best = replayed(write_servo(tmp_path / "run.mcap"))
    assert best == 2.0
    ((_, goal),) = rows(path, "/cloud/goal", "Points3D:positions", timeline=None)
    np.testing.assert_array_equal(goal, seen[-1].cloud)
    arrows = rows(path, "/motion", "Arrows3D:vectors", timeline="sim_time")
    assert [time for time, _ in arrows] == [0.0, 1.0, 2.0]
    np.testing.assert_allclose(arrows[0][1][0], seen[-1].grasp - seen[0].grasp, atol=1e-7)
    lines = [text for _, (text,) in rows(path, "/log", "TextLog:text", timeline="sim_time")]
    assert [line[:6] for line in lines] == ["step 0", "step 1", "step 2"]


def test_a_recording_is_best_seen_where_the_motion_is_largest_but_not_at_its_end(
    tmp_path: Path,
) -> None:
    motions = [0.0, 0.01, 0.03, 0.02, 0.04]
    seen = [frame(float(time), np.array([0.0, 0.0, up])) for time, up in enumerate(motions)]
    _, best = replayed(write(tmp_path / "a.mcap", seen))
    assert best == 2.0


@pytest.mark.parametrize("count", [0, 1])
def test_hardly_any_frames_are_replayed_too(tmp_path: Path, count: int) -> None:
    path, best = replayed(write(tmp_path / "a.mcap", frames(2)[:count]))
    assert best == 0.0
    clouds = rows(path, "/cloud/current", "Points3D:positions", timeline="frame")
    assert len(clouds) == count


def test_an_episode_without_a_urdf_is_replayed_without_arms(tmp_path: Path) -> None:
    source = tmp_path / "a.mcap"
    with EpisodeWriter(source, meta(), arms=ARMS, attachments={}) as writer:
        writer.add(frames(2)[0])
        writer.finish({})
    path, _ = replayed(source)
    assert "/cloud/current" in entities(path)
    assert not any("visual_geometries" in entity for entity in entities(path))


@pytest.mark.parametrize("urdf", [b"no xml", b"\xff\xfe", b"<robot name='a'></robot>"])
def test_an_unreadable_urdf_is_named(tmp_path: Path, urdf: bytes) -> None:
    source = tmp_path / "a.mcap"
    with EpisodeWriter(source, meta(), arms=ARMS, attachments={"psm.urdf": urdf}) as writer:
        writer.finish({})
    with pytest.raises(BadEpisode, match=r"a\.mcap has an unreadable attachment psm\.urdf"):
        replayed(source)

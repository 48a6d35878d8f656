from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadEpisode
from dnet.geometry.chamfer import chamfer
from dnet.recorders.blueprint import Company
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.replay import FRAMES_AT_A_TIME, replay, replay_beside
from tests.recorders.rollout import ARMS, frame, frames, meta, step, write, write_servo
from tests.recorders.rrd import entities, link_rows, rows


def replayed(episode: Path) -> tuple[Path, float]:
    target = episode.with_suffix(".rrd")
    with EpisodeReader(episode) as reader:
        return target, replay(reader, target)


def identity(path: Path) -> str:
    (name,) = [entry.recording_id for entry in RrdReader(path).recordings()]
    return str(name)


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


def test_a_long_episode_is_replayed_whole(tmp_path: Path) -> None:
    seen = frames(FRAMES_AT_A_TIME // 2 + 3, points=8)
    assert len(seen) > FRAMES_AT_A_TIME
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    for entity, component in (
        ("/cloud/current", "Points3D:positions"),
        ("/manipulation_point", "Points3D:positions"),
        ("/joints/psm_right", "Scalars:scalars"),
        ("/motion", "Arrows3D:vectors"),
    ):
        counts = [count for count, _ in rows(path, entity, component, timeline="frame")]
        assert counts == list(range(len(seen)))
        times = [time for time, _ in rows(path, entity, component, timeline="sim_time")]
        assert times == [one.time for one in seen]
    tip, component = "psm_right/tip_link", "Transform3D:translation"
    stood = link_rows(path, tip, component, timeline="frame")
    assert [count for count, _ in stood] == list(range(len(seen)))
    stood = link_rows(path, tip, component, timeline="sim_time")
    assert [time for time, _ in stood] == [one.time for one in seen]


def test_the_arms_stand_where_they_stood(tmp_path: Path) -> None:
    seen = frames(2)
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    for link in ("psm_left/yaw_link", "psm_right/tip_link"):
        places = link_rows(path, link, "Transform3D:translation", timeline="frame")
        turns = link_rows(path, link, "Transform3D:quaternion", timeline="frame")
        for one, (_, (place,)), (_, (turn,)) in zip(seen, places, turns, strict=True):
            (told,) = [entry for entry in ARMS.transforms(one.joints) if entry.child == link]
            np.testing.assert_allclose(place, told.translation, atol=1e-6)
            np.testing.assert_allclose(turn, told.rotation, atol=1e-6)


def test_a_recording_shows_its_rest_shape_and_the_point_that_is_held(tmp_path: Path) -> None:
    seen = frames(3)
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    ((_, rest),) = rows(path, "/cloud/rest", "Points3D:positions", timeline=None)
    np.testing.assert_array_equal(rest, seen[0].cloud)
    ((_, label),) = rows(path, "/cloud/rest/label", "Points3D:labels", timeline=None)
    assert label == ["rest shape"]
    ((_, (hold,)),) = rows(path, "/keypoints/hold", "Points3D:positions", timeline=None)
    np.testing.assert_allclose(hold, meta().scene.hold, atol=1e-7)
    assert "/cloud/goal" not in entities(path)


def test_curves_tell_where_the_gripper_and_the_joints_are(tmp_path: Path) -> None:
    seen = frames(3)
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    gripper = rows(path, "/gripper", "Scalars:scalars", timeline="sim_time")
    np.testing.assert_allclose([value for _, value in gripper], [1e3 * one.grasp for one in seen])
    for number, arm in enumerate(("psm_left", "psm_right")):
        joints = rows(path, f"/joints/{arm}", "Scalars:scalars", timeline="sim_time")
        np.testing.assert_allclose(
            [value for _, value in joints], [one.joints[number] for one in seen]
        )
        ((_, names),) = rows(path, f"/joints/{arm}", "SeriesLines:names", timeline=None)
        assert names == [f"{arm} {joint}" for joint in ARMS.joint_names]


def test_curves_of_a_recording_are_distances_from_rest(tmp_path: Path) -> None:
    seen = frames(3)
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    settled = [one for one in seen if one.kind != "way"]
    chamfers = rows(path, "/chamfer", "Scalars:scalars", timeline="sim_time")
    assert [time for time, _ in chamfers] == [one.time for one in settled]
    np.testing.assert_allclose(
        [value for _, (value,) in chamfers],
        [1e3 * chamfer(one.cloud, seen[0].cloud) for one in settled],
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
    chamfers = rows(path, "/chamfer", "Scalars:scalars", timeline="sim_time")
    np.testing.assert_allclose(
        [value for _, (value,) in chamfers],
        [1e3 * chamfer(one.cloud, seen[-1].cloud) for one in seen[::2]],
    )


def test_a_plan_shows_where_the_tip_was_to_go_until_there_is_none(tmp_path: Path) -> None:
    seen = frames(3)
    path, _ = replayed(write_servo(tmp_path / "run.mcap"))
    planned = rows(path, "/plan/tip", "LineStrips3D:strips", timeline="sim_time")
    assert [time for time, _ in planned] == [0.0, 1.0]
    for one, (_, (strip,)) in zip(seen[::2], planned, strict=False):
        np.testing.assert_allclose(strip, [one.grasp, seen[-1].grasp], atol=1e-7)
    cleared = rows(path, "/plan/tip", "Clear:is_recursive", timeline="sim_time")
    assert [time for time, _ in cleared] == [2.0]


@pytest.mark.parametrize("plan", [{}, {"status": "straight", "achieved": [1.0]}, 3])
def test_an_unreadable_plan_is_named(tmp_path: Path, plan: object) -> None:
    class Spoilt(EpisodeReader):
        def steps(self) -> list[dict[str, Any]]:
            return [step | {"plan": plan} for step in super().steps()]

    with (
        Spoilt(write_servo(tmp_path / "run.mcap")) as episode,
        pytest.raises(BadEpisode, match=r"run\.mcap has an unreadable plan at 0 s"),
    ):
        replay(episode, tmp_path / "run.rrd")


def test_an_episode_is_always_the_same_recording_and_no_other_one_is(tmp_path: Path) -> None:
    one = write(tmp_path / "one" / "a.mcap", frames(1))
    (tmp_path / "link").symlink_to(tmp_path / "one")
    first = identity(replayed(one)[0])
    assert identity(replayed(tmp_path / "link" / "a.mcap")[0]) == first
    others = [
        write(tmp_path / "one" / "b.mcap", frames(1)),
        write(tmp_path / "two" / "a.mcap", frames(1)),
        write(tmp_path / "one" / "c.mcap", frames(1), name="a"),
    ]
    assert len({first, *(identity(replayed(other)[0]) for other in others)}) == 4


@pytest.mark.parametrize("company", ["alone", "several", None])
def test_a_recording_brings_one_layout_or_none(tmp_path: Path, company: Company | None) -> None:
    with EpisodeReader(write(tmp_path / "a.mcap", frames(1))) as episode:
        replay(episode, tmp_path / "a.rrd", company=company)
    laid_out = [entry.application_id for entry in RrdReader(tmp_path / "a.rrd").blueprints()]
    assert laid_out == ([] if company is None else ["dnet record"])


def test_a_frame_in_which_nothing_was_seen_is_replayed_too(tmp_path: Path) -> None:
    seen = frames(2)
    seen[1] = replace(seen[1], cloud=np.zeros((0, 3), np.float32))
    path, _ = replayed(write(tmp_path / "a.mcap", seen))
    clouds = rows(path, "/cloud/current", "Points3D:positions", timeline="frame")
    assert [len(cloud) for _, cloud in clouds] == [64, 0, 64]


def test_a_recording_is_best_seen_where_the_motion_is_largest(tmp_path: Path) -> None:
    motions = [0.0, 0.01, 0.03, 0.02, 0.01]
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


def known_run(path: Path) -> Path:
    """Write a servo run of two turns of which all is known."""
    seen = frames(2)
    goal = seen[-1]
    with EpisodeWriter(path, meta(path.stem), arms=ARMS, attachments={}) as writer:
        writer.set_goal(goal.cloud, again=goal.cloud, nodes=goal.nodes, grasp=goal.grasp)
        for index, one in enumerate((seen[0], goal)):
            writer.add_step(step(one, goal, planned=one is not goal), index)
        writer.finish({"outcome": "converged"})
    return path


def test_a_run_is_coloured_by_its_distance_to_the_goal_and_shows_the_true_motion(
    tmp_path: Path,
) -> None:
    path, _ = replayed(known_run(tmp_path / "run.mcap"))
    first, last = rows(path, "/cloud/current", "Points3D:colors", timeline="frame")
    assert len(set(first[1])) > 1
    assert len(set(last[1])) == 1
    arrows = rows(path, "/motion/true", "Arrows3D:vectors", timeline="frame")
    seen = frames(2)
    np.testing.assert_allclose(arrows[0][1][0], seen[-1].grasp - seen[0].grasp, atol=1e-7)
    nodes = rows(path, "/node_distance", "Scalars:scalars", timeline="frame")
    assert nodes[0][1][0] > 1.0
    assert nodes[-1][1][0] == 0.0
    chamfers = rows(path, "/chamfer", "Scalars:scalars", timeline="sim_time")
    assert [floor for _, (_, floor) in chamfers] == [0.0] * len(chamfers)


def test_runs_side_by_side_are_one_recording_with_a_place_for_each(tmp_path: Path) -> None:
    paths = [known_run(tmp_path / name) for name in ("a.mcap", "b.mcap")]
    target = tmp_path / "both.rrd"
    with EpisodeReader(paths[0]) as one, EpisodeReader(paths[1]) as other:
        assert replay_beside([one, other], target) == frames(2)[-1].time
    found = entities(target)
    for place in ("run_1", "run_2"):
        logged = ("cloud/current", "cloud/goal", "motion", "chamfer", "log")
        assert {f"/{place}/{entity}" for entity in logged} <= found
        child, component = f"{place}.psm_right/tip_link", "Transform3D:translation"
        assert link_rows(target, child, component, timeline="frame", place=f"/{place}")
    assert "/cloud/current" not in found
    assert [entry.application_id for entry in RrdReader(target).blueprints()] == [
        "dnet servo side by side"
    ]


def test_a_recording_beside_a_run_is_refused(tmp_path: Path) -> None:
    run, recording = known_run(tmp_path / "a.mcap"), write(tmp_path / "b.mcap", frames(2))
    with (
        EpisodeReader(run) as one,
        EpisodeReader(recording) as other,
        pytest.raises(BadEpisode, match="is no servo run"),
    ):
        replay_beside([one, other], tmp_path / "both.rrd")

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader
from rerun.error_utils import RerunWarning

from dnet.errors import OccupiedOutput
from dnet.recorders.rerun_run import RerunRun
from dnet.recorders.viewer_process import RERUN
from dnet.sim.urdf import psm_urdf
from dnet.types import Goal, KeypointPairs, Latency
from tests.recorders.rollout import ARMS, GRASP, frames, step
from tests.recorders.rrd import entities, link_rows, rows

TIPS = np.linspace(GRASP, GRASP + 0.01, 5)


def start(path: Path) -> RerunRun:
    return RerunRun(path, name="a run", arms=ARMS, urdf=psm_urdf())


def write(path: Path) -> Path:
    """Write a run of two steps with the arms' way between them."""
    seen = frames(2)
    with start(path) as run:
        run.log_goal(seen[-1].cloud)
        run.log_step(0, step(seen[0], seen[-1]), TIPS)
        times = np.linspace(0.1, 0.9, 9)
        run.log_pose(seen[0].joints, time=0.1)
        run.log_way(times, np.linspace(seen[0].joints[1], seen[2].joints[1], 9))
        run.log_frame(seen[1])
        run.log_step(1, step(seen[-1], seen[-1], planned=False), None)
        run.log_text("converged")
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("run") / "run.rrd")


def test_rerun_verifies_it(recording: Path) -> None:
    command = [*RERUN, "rrd", "verify", str(recording)]
    verified = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert verified.returncode == 0, verified.stdout + verified.stderr


def test_it_brings_its_layout_along(recording: Path) -> None:
    assert [entry.application_id for entry in RrdReader(recording).blueprints()] == ["dnet servo"]


def test_each_step_has_its_cloud_on_both_timelines(recording: Path) -> None:
    seen = frames(2)
    for timeline, times in (("step", [0, 1]), ("sim_time", [0.0, 0.5, 1.0])):
        found = rows(recording, "/cloud/current", "Points3D:positions", timeline=timeline)
        assert [time for time, _ in found] == times
        np.testing.assert_array_equal(found[0][1], seen[0].cloud)
        np.testing.assert_array_equal(found[-1][1], seen[-1].cloud)


def test_the_goal_is_there_at_all_times(recording: Path) -> None:
    ((_, points),) = rows(recording, "/cloud/goal", "Points3D:positions", timeline=None)
    np.testing.assert_array_equal(points, frames(2)[-1].cloud)


def test_where_a_run_grasps_is_shown_with_what_it_was_chosen_by(tmp_path: Path) -> None:
    rest, *_, goal = frames(3, points=300)
    pairs = KeypointPairs(rest.cloud[:20], goal.cloud[:20], np.eye(20)[3])
    with start(tmp_path / "run.rrd") as run:
        run.log_choice(rest.cloud, GRASP, heat=None, keypoints=pairs, time=0.0)
        heat = np.linspace(0.0, 1.0, len(rest.cloud))
        run.log_choice(rest.cloud, GRASP + 0.01, heat=heat, keypoints=None, time=1.0)

    def shown(entity: str, component: str) -> list[tuple[Any, Any]]:
        return rows(tmp_path / "run.rrd", f"/choice/{entity}", component, timeline="sim_time")

    points = shown("point", "Points3D:positions")
    np.testing.assert_allclose([point for _, (point,) in points], [GRASP, GRASP + 0.01], atol=1e-6)
    (lines,) = shown("keypoints/lines", "LineStrips3D:strips")
    np.testing.assert_allclose(lines[1][5], [rest.cloud[5], goal.cloud[5]])
    (chosen,) = shown("keypoints/chosen", "Points3D:positions")
    np.testing.assert_allclose(chosen[1], [rest.cloud[3]])
    plain, hot = (colors for _, colors in shown("cloud", "Points3D:colors"))
    assert len(np.unique(plain)) == 1
    assert len(np.unique(hot)) > 100
    # The second choice has no keypoints: those of the first are taken away.
    assert [time for time, _ in shown("keypoints", "Clear:is_recursive")] == [0.0, 1.0]


def test_curves_are_in_millimetres(recording: Path) -> None:
    seen = frames(2)
    first = step(seen[0], seen[-1])
    chamfers = rows(recording, "/chamfer", "Scalars:scalars", timeline="step")
    motions = rows(recording, "/motion_length", "Scalars:scalars", timeline="step")
    np.testing.assert_allclose([value[0] for _, value in chamfers], [1e3 * first.chamfer, 0])
    np.testing.assert_allclose(
        [value[0] for _, value in motions], [1e3 * float(np.linalg.norm(first.motion)), 0.0]
    )


def test_a_run_of_which_all_is_known_shows_how_far_it_is_and_how_long_it_took(
    tmp_path: Path,
) -> None:
    seen = frames(2)
    end = seen[-1]
    goal = Goal(end.cloud, "test", grasp=end.grasp, nodes=end.nodes, again=end.cloud)
    with start(tmp_path / "run.rrd") as run:
        run.log_target(goal)
        for index, one in enumerate((seen[0], end)):
            turn = replace(step(one, end), latency=Latency(1.0, 2.0, 3.0, 4.0, 5.0))
            run.log_step(index, turn, TIPS)
            run.log_latency(index, turn)
        run.log_text("approach", time=0.2)
    path = tmp_path / "run.rrd"
    first, last = rows(path, "/cloud/current", "Points3D:colors", timeline="step")
    assert len(set(first[1])) > len(set(last[1])) == 1
    (arrow, _) = rows(path, "/motion/true", "Arrows3D:vectors", timeline="step")
    np.testing.assert_allclose(arrow[1][0], end.grasp - seen[0].grasp, atol=1e-7)
    latencies = rows(path, "/latency", "Scalars:scalars", timeline="step")
    assert latencies == [(0.0, [1, 2, 3, 4, 5]), (1.0, [1, 2, 3, 4, 5])]
    assert [time for time, _ in rows(path, "/log", "TextLog:text", timeline="sim_time")][1] == 0.2
    curves = [values for _, values in rows(path, "/chamfer", "Scalars:scalars", timeline="step")]
    np.testing.assert_allclose(curves, [[1e3 * step(seen[0], end).chamfer, 0.0], [0.0, 0.0]])


def test_the_motion_is_an_arrow_from_the_grasp(recording: Path) -> None:
    seen = frames(2)
    (_, origins), _ = rows(recording, "/motion", "Arrows3D:origins", timeline="step")
    (_, vectors), _ = rows(recording, "/motion", "Arrows3D:vectors", timeline="step")
    np.testing.assert_allclose(origins[0], seen[0].grasp, atol=1e-7)
    np.testing.assert_allclose(vectors[0], seen[-1].grasp - seen[0].grasp, atol=1e-7)


def test_the_planned_path_is_cleared_when_there_is_none(recording: Path) -> None:
    ((_, strips),) = rows(recording, "/plan/tip", "LineStrips3D:strips", timeline="step")
    np.testing.assert_allclose(strips[0], TIPS, atol=1e-7)
    cleared = rows(recording, "/plan/tip", "Clear:is_recursive", timeline="step")
    assert [time for time, _ in cleared] == [1]


def test_both_arms_are_drawn_and_their_frames_hang_together(recording: Path) -> None:
    drawn = [entity for entity in entities(recording) if "visual_geometries" in entity]
    assert {entity.split("/")[1] for entity in drawn} == {"psm_left", "psm_right"}
    assert not any("collision" in entity for entity in entities(recording))
    named = set()
    for entity in drawn:
        named |= {
            name for _, (name,) in rows(recording, entity, "CoordinateFrame:frame", timeline=None)
        }
    children = rows(recording, "/tf", "Transform3D:child_frame", timeline="step")
    assert named
    assert named <= {child for _, (child,) in children}


def test_transforms_follow_the_moving_arm_between_the_steps(recording: Path) -> None:
    seen = frames(2)
    component = "Transform3D:translation"
    moved, held = (
        link_rows(recording, f"{arm}/insertion_link", component, timeline="sim_time")
        for arm in ("psm_right", "psm_left")
    )
    # The way begins where the arms were shown before it.
    times = [0.0, 0.1, *np.linspace(0.1, 0.9, 9), 0.5, 1.0]
    np.testing.assert_allclose([time for time, _ in moved], sorted(times))
    assert [time for time, _ in held] == [0.0, 0.1, 0.5, 1.0]
    path = np.linspace(seen[0].joints[1], seen[2].joints[1], 9)
    for time, joints in zip(np.linspace(0.1, 0.9, 9), path, strict=True):
        links = ARMS.transforms((seen[0].joints[0], joints))
        (told,) = [link for link in links if link.child == "psm_right/insertion_link"]
        drawn = [place for when, (place,) in moved if abs(when - time) < 1e-6]
        assert any(np.allclose(place, told.translation, atol=1e-6) for place in drawn)
    on_steps = link_rows(recording, "psm_right/yaw_link", component, timeline="step")
    assert [index for index, _ in on_steps] == [0, 1]


def test_joints_are_curves_with_names(recording: Path) -> None:
    ((_, names),) = rows(recording, "/joints/psm_right", "SeriesLines:names", timeline=None)
    assert names[0] == "psm_right yaw"
    found = rows(recording, "/joints/psm_right", "Scalars:scalars", timeline="step")
    np.testing.assert_array_equal(found[0][1], frames(2)[0].joints[1])


def test_the_log_says_what_happened(recording: Path) -> None:
    lines = [text for _, (text,) in rows(recording, "/log", "TextLog:text", timeline="sim_time")]
    assert [line.split(":")[0] for line in lines] == ["step 0", "step 1", "converged"]


def test_an_existing_recording_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    path.write_bytes(b"an older run")
    with pytest.raises(OccupiedOutput, match=r"run\.rrd already holds a Rerun recording"):
        start(path)
    assert path.read_bytes() == b"an older run"


def test_a_run_has_its_name_only_when_it_is_closed(tmp_path: Path) -> None:
    run = start(tmp_path / "run.rrd")
    run.log_goal(frames(2)[0].cloud)
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd.part"]
    run.close()
    run.close()
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]


def test_a_step_is_on_the_disk_when_it_is_logged(tmp_path: Path) -> None:
    seen = frames(2)
    run = start(tmp_path / "run.rrd")
    run.log_step(0, step(seen[0], seen[-1]), TIPS)
    # What is there after a kill at this moment.
    left = tmp_path / "left.rrd"
    left.write_bytes(run.part.read_bytes())
    run.close()
    with pytest.warns(RerunWarning, match="no footer"):
        clouds = rows(left, "/cloud/current", "Points3D:positions", timeline="step")
    assert len(clouds) == 1


def test_an_interrupted_run_keeps_its_steps_under_its_part_name(tmp_path: Path) -> None:
    seen = frames(2)

    def interrupted() -> None:
        with start(tmp_path / "run.rrd") as run:
            run.log_step(0, step(seen[0], seen[-1]), TIPS)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd.part"]
    kept = (tmp_path / "run.rrd.part").rename(tmp_path / "kept.rrd")
    assert len(rows(kept, "/cloud/current", "Points3D:positions", timeline="step")) == 1

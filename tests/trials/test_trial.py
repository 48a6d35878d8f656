"""However a run ends, its outcome has a name, its logs are whole, and the arms' pose is stated."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun_cli
import torch
from rerun.chunk import RrdReader

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadCheckpoint, DiskAlmostFull, OtherRun, ShortCloud, UnknownTruth
from dnet.geometry.chamfer import chamfer
from dnet.laboratory import Laboratory, LaboratorySettings, laboratory
from dnet.nets.hu import HuNet, HuNetConfig
from dnet.recorders.live_view import LiveView
from dnet.recorders.run_sinks import LOST
from dnet.servo.verdict import ServoSettings
from dnet.sim.foresight import LEAST_VOLUME_RATIO
from dnet.sim.tissue import tissue_mesh
from dnet.training.checkpoints import save
from dnet.trials.goals import read_task
from dnet.trials.log import RESERVE
from dnet.trials.request import ControllerName, Trial
from dnet.trials.trial import clear, is_finished, run_trial
from dnet.types import ARMS, Cloud, Outcome, Point, Trace
from tests.recorders.rrd import rows
from tests.recorders.viewers import ends, stand_in

LAB = LaboratorySettings(points=512, world="quasistatic")
ROOM = 10 * RESERVE


@pytest.fixture(scope="module")
def lab() -> Iterator[Laboratory]:
    with laboratory(LAB) as built:
        yield built


def trial(out: Path, **options: Any) -> Trial:
    plain = Trial("random:3", out, controller="oracle", laboratory=LAB, recording=False)
    return replace(plain, **options)


def silent(line: str) -> None:
    assert line


class Towards:
    """A controller that always asks for one motion, until something happens."""

    def __init__(
        self, motion: Point, *, after: int = 99, event: Callable[[], None] | None = None
    ) -> None:
        self.motion, self.after, self.event = motion, after, event
        self.calls = 0

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        self.calls += 1
        if self.event is not None and self.calls > self.after:
            self.event()
        return self.motion


UP = np.array([0.0, 0.0, 0.004])


def check_whole(out: Path, trace: Trace, lab: Laboratory, outcome: Outcome) -> None:
    assert trace.outcome == outcome
    assert not list(out.glob("*.part"))
    with EpisodeReader(out / "run.mcap") as run:
        result = run.result or {}
        assert result["outcome"] == outcome
        assert result["reason"] == trace.reason
        assert len(run.steps()) == len(trace.steps) == len(result["chamfer"])
        assert run.lines()[-1][1].startswith(f"outcome: {outcome}")
        for arm, joints in zip(ARMS, lab.world.joints, strict=True):
            np.testing.assert_allclose(result["arms"][arm], joints)
        assert result["holding"] == bool(np.isfinite(lab.world.slip()))
    if (out / "run.rrd").exists():
        assert RrdReader(out / "run.rrd").recordings()


def test_the_oracle_reaches_what_was_drawn(lab: Laboratory, tmp_path: Path) -> None:
    trace = run_trial(trial(tmp_path, recording=True), lab, say=silent)
    check_whole(tmp_path, trace, lab, "converged")
    ((_, (chosen,)),) = rows(
        tmp_path / "run.rrd", "/choice/point", "Points3D:positions", timeline="sim_time"
    )
    assert np.linalg.norm(chosen - trace.steps[0].frame.grasp) < 0.01
    assert trace.steps[0].chamfer > 3e-3
    assert trace.steps[-1].chamfer < 1e-3
    with EpisodeReader(tmp_path / "run.mcap") as run:
        goal = run.target()
        assert goal is not None
        assert goal.again is not None
        assert goal.nodes is not None
        assert goal.grasp is not None
        assert 0 < chamfer(goal.again, goal.cloud) < 3e-3
        np.testing.assert_allclose(run.nodes(len(run) - 1), goal.nodes, atol=1e-3)
        np.testing.assert_allclose(run.grasps[-1], goal.grasp, atol=1e-3)
        assert run.kinds[0] == "rest"
        assert set(run.kinds[1:]) == {"shape"}


def test_the_network_of_hu_servoes_and_may_go_on_learning(lab: Laboratory, tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = HuNet(HuNetConfig(points=LAB.points, components=8))
    torch.nn.init.normal_(network.basis, std=10.0)
    save(tmp_path / "hu.safetensors", network)
    last = {}
    names: tuple[ControllerName, ...] = ("hu", "hu-online")
    for name in names:
        settings = ServoSettings(steps=2, threshold=1e-6, patience=0)
        asked = trial(
            tmp_path / name,
            controller=name,
            checkpoint=tmp_path / "hu.safetensors",
            settings=settings,
        )
        trace = run_trial(asked, lab, say=silent)
        check_whole(tmp_path / name, trace, lab, "out_of_steps")
        with EpisodeReader(tmp_path / name / "run.mcap") as run:
            assert run.meta.settings["checkpoint"] == "hu.safetensors"
        last[name] = [step.motion for step in trace.steps]
    np.testing.assert_array_equal(last["hu"][0], last["hu-online"][0])
    assert np.abs(last["hu"][-1] - last["hu-online"][-1]).max() > 1e-5
    # The one that ships is for clouds of 2048 points.
    with pytest.raises(BadCheckpoint, match=r"hu\.safetensors takes clouds of 2048 points"):
        run_trial(trial(tmp_path / "none", controller="hu"), lab, say=silent)


def test_the_same_seed_writes_the_same_bytes(lab: Laboratory, tmp_path: Path) -> None:
    for name in ("one", "two"):
        asked = trial(
            tmp_path / name, controller="rrt", settings=ServoSettings(steps=3), dropped=0.2
        )
        run_trial(asked, lab, say=silent)
    one, two = ((tmp_path / name / "run.mcap").read_bytes() for name in ("one", "two"))
    assert one == two


def test_a_run_with_other_settings_is_not_taken_for_this_one(
    lab: Laboratory, tmp_path: Path
) -> None:
    asked = trial(tmp_path)
    run_trial(asked, lab, say=silent)
    assert is_finished(asked)
    for other in (replace(asked, controller="none"), replace(asked, seed=9)):
        with pytest.raises(OtherRun, match="choose another --out"):
            is_finished(other)


def test_a_motion_that_is_no_number(lab: Laboratory, tmp_path: Path) -> None:
    spoilt = Towards(np.full(3, np.nan))
    trace = run_trial(trial(tmp_path), lab, say=silent, controller=spoilt)
    check_whole(tmp_path, trace, lab, "bad_motion")
    with EpisodeReader(tmp_path / "run.mcap") as run:
        assert len(run) == 1, "what the network was given is kept"


def test_a_goal_out_of_reach(lab: Laboratory, tmp_path: Path) -> None:
    down = Towards(np.array([0.0, 0.0, -0.5]))
    trace = run_trial(trial(tmp_path), lab, say=silent, controller=down)
    check_whole(tmp_path, trace, lab, "planning_failed")
    assert "the table" in trace.reason
    assert trace.steps[-1].plan is None


def test_a_grasp_that_is_lost(lab: Laboratory, tmp_path: Path) -> None:
    clumsy = Towards(UP, after=1, event=lab.world.release)
    trace = run_trial(trial(tmp_path), lab, say=silent, controller=clumsy)
    check_whole(tmp_path, trace, lab, "grasp_lost")
    assert trace.reason == "the jaws are open"


def test_an_object_is_moved_as_far_as_it_bears_and_not_crushed(
    lab: Laboratory, tmp_path: Path
) -> None:
    """Drawn to the table on the far side of the arm that holds it."""
    harsh = Towards(np.array([-0.15, 0.0, -0.02]))
    trace = run_trial(trial(tmp_path), lab, say=silent, controller=harsh)
    check_whole(tmp_path, trace, lab, "planning_failed")
    assert "the object is crushed" in trace.reason
    plans = [step.plan for step in trace.steps if step.plan is not None]
    assert [plan.status for plan in plans] == ["partial", "failed", "failed", "failed"]
    assert float(np.linalg.norm(plans[0].achieved)) > 0.03
    scene = read_task(trial(tmp_path), lab).scene
    ratios = tissue_mesh(scene.tissue).volume_ratios(trace.steps[-1].frame.nodes.astype(float))
    assert ratios.min() > LEAST_VOLUME_RATIO - 1e-3


def test_a_goal_of_another_object_is_told(lab: Laboratory, tmp_path: Path) -> None:
    """Of the same box, cut to half its length: the end that is held is missing."""
    box = read_task(trial(tmp_path), lab).goal.cloud
    half = box[np.argsort(box[:, 0])[-len(box) // 2 :]]
    other = np.concatenate([half, half + np.float32(1e-4)])
    for name, cloud, warnings in (("own", box, 0), ("other", other, 1)):
        np.save(tmp_path / f"{name}.npy", cloud)
        lines: list[str] = []
        asked = trial(
            tmp_path / name,
            goal=str(tmp_path / f"{name}.npy"),
            controller="none",
            grasp="displaced",
        )
        run_trial(replace(asked, seed=3), lab, say=lines.append)
        told = [line for line in lines if "where the other arm holds it (limit 6 mm)" in line]
        assert len(told) == warnings
        with EpisodeReader(tmp_path / name / "run.mcap") as run:
            assert ((run.result or {})["held_end_apart"] > 0.006) == bool(warnings)


def test_an_object_that_is_out_of_view(lab: Laboratory, tmp_path: Path) -> None:
    # Of the camera's images this seed loses three in a row after the second turn.
    asked = trial(tmp_path, dropped=0.5, settings=ServoSettings(patience=0, steps=50), seed=8)
    trace = run_trial(asked, lab, say=silent, controller=Towards(UP))
    check_whole(tmp_path, trace, lab, "object_lost")
    assert "3 images in a row" in trace.reason
    assert len(trace.steps) == 2


def test_an_object_that_was_never_in_view_is_refused(lab: Laboratory, tmp_path: Path) -> None:
    with pytest.raises(ShortCloud):
        run_trial(trial(tmp_path, dropped=1.0), lab, say=silent)
    assert not list(tmp_path.iterdir())


def test_a_disk_that_fills_up(lab: Laboratory, tmp_path: Path) -> None:
    rooms = iter([ROOM, ROOM, ROOM, *[RESERVE - 1] * 9])
    trace = run_trial(
        trial(tmp_path),
        lab,
        say=silent,
        controller=Towards(UP),
        free=lambda folder: next(rooms),
    )
    assert trace.outcome == "disk_full"
    assert "make room" in trace.reason
    with EpisodeReader(tmp_path / "run.mcap") as run:
        assert (run.result or {})["outcome"] == "disk_full"
        assert len(run.steps()) == 2
    assert not list(tmp_path.glob("*.part"))


def test_a_disk_that_is_full_already_is_refused(lab: Laboratory, tmp_path: Path) -> None:
    with pytest.raises(DiskAlmostFull, match="make room"):
        run_trial(trial(tmp_path), lab, say=silent, free=lambda folder: 10)
    assert not list(tmp_path.iterdir())


def test_a_run_that_is_stopped(lab: Laboratory, tmp_path: Path) -> None:
    controller = Towards(UP)
    trace = run_trial(
        trial(tmp_path, recording=True),
        lab,
        say=silent,
        controller=controller,
        stop=lambda: controller.calls >= 2,
    )
    check_whole(tmp_path, trace, lab, "interrupted")
    assert not is_finished(trial(tmp_path))
    clear(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_run_that_stalls_grasps_elsewhere(lab: Laboratory, tmp_path: Path) -> None:
    asked = trial(tmp_path, settings=ServoSettings(patience=2, regrasps=1, steps=20))
    trace = run_trial(asked, lab, say=silent, controller=Towards(UP * 0.6))
    assert trace.outcome == "stalled"
    with EpisodeReader(tmp_path / "run.mcap") as run:
        first, second = (run.result or {})["grasped"]
        assert np.linalg.norm(np.subtract(first, second)) > 0.015
        said = [line for _, line in run.lines()]
        assert any(line.startswith("grasped again, at") for line in said)
        assert sum(line.startswith("close in: plan") for line in said) == 2


def test_the_arms_need_not_hide_the_object(lab: Laboratory, tmp_path: Path) -> None:
    counts = {}
    for occlusion in (True, False):
        out = tmp_path / str(occlusion)
        run_trial(trial(out, occlusion=occlusion), lab, say=silent)
        with EpisodeReader(out / "run.mcap") as run:
            counts[occlusion] = run.cloud(0)
    assert chamfer(counts[True], counts[False]) > 1e-4


def test_a_cloud_of_ones_own_is_a_goal(lab: Laboratory, tmp_path: Path) -> None:
    run_trial(trial(tmp_path / "a"), lab, say=silent)
    with EpisodeReader(tmp_path / "a" / "run.mcap") as run:
        np.save(tmp_path / "goal.npy", run.cloud(len(run) - 1))
    asked = trial(
        tmp_path / "b",
        goal=str(tmp_path / "goal.npy"),
        scene=tmp_path / "a" / "run.mcap",
        controller="rrt",
        settings=ServoSettings(steps=2),
    )
    trace = run_trial(asked, lab, say=silent)
    assert trace.steps
    with EpisodeReader(tmp_path / "b" / "run.mcap") as run:
        assert run.meta.settings["goal"] == "goal.npy"
    with pytest.raises(UnknownTruth, match="--controller oracle needs to know"):
        run_trial(replace(asked, controller="oracle"), lab, say=silent)


def test_the_window_that_shows_a_run_decides_nothing_about_it(
    lab: Laboratory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rerun takes the run in the viewer's place, and is killed in the middle of it."""
    number = tmp_path / "number"
    rerun = Path(rerun_cli.__file__).with_name("rerun")
    script = f'echo $$ > {number}; exec {rerun} --save {tmp_path / "seen.rrd"} "$@"'
    monkeypatch.setenv("RERUN_CLI_PATH", str(stand_in(tmp_path / "viewer", script)))
    monkeypatch.setenv("DISPLAY", ":99")
    settings = ServoSettings(steps=2)
    opened: list[LiveView] = []
    said: list[str] = []

    def view() -> LiveView:
        opened.append(LiveView())
        return opened[-1]

    def close() -> None:
        opened[0].end()
        assert ends(int(number.read_text()))

    for name, controller in (("plain", Towards(UP)), ("shown", Towards(UP, after=1, event=close))):
        trace = run_trial(
            trial(tmp_path / name, settings=settings, recording=name == "shown"),
            lab,
            say=said.append,
            controller=controller,
            view=view if name == "shown" else None,
        )
        check_whole(tmp_path / name, trace, lab, "out_of_steps")
    plain, shown = ((tmp_path / name / "run.mcap").read_bytes() for name in ("plain", "shown"))
    assert plain == shown
    assert said.count(LOST) == 1
    steps = rows(
        tmp_path / "shown/run.rrd", "/cloud/current", "Points3D:positions", timeline="step"
    )
    assert [index for index, _ in steps] == [0, 1, 2]

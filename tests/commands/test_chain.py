"""The whole chain on a tiny scale: each part takes what the part before it left."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from dnet.cli import main
from dnet.datasets.reader import EpisodeReader
from dnet.geometry.chamfer import chamfer
from dnet.recorders.episode import EpisodeWriter
from dnet.sim.arms import ArmModel, Placement

RERUN = Path(sys.executable).parent / "rerun"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("chain") / "demo"
    main(["demo", "--out", str(out), "--pairs", "2", "--shapes", "3", "--epochs", "30"])
    return out


def servo(demo: Path, out: Path, goal: str, *more: str) -> None:
    main(["servo", "--checkpoint", str(demo / "train"), "--goal", goal, "--out", str(out), *more])


def test_the_demo_leaves_everything_it_names(demo: Path) -> None:
    for name in (
        "data/episode-0-00000.mcap",
        "data/episode-0-00001.mcap",
        "train/best.safetensors",
        "train/config.json",
        "train/metrics.jsonl",
        "servo/run.mcap",
        "servo/run.rrd",
        "servo.png",
        "episode.png",
    ):
        assert (demo / name).stat().st_size > 100
    assert not list(demo.rglob("*.part"))


def test_a_second_call_of_the_demo_does_nothing_twice(
    demo: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in demo.rglob("*")}
    main(["demo", "--out", str(demo), "--pairs", "2", "--shapes", "3", "--epochs", "30"])
    assert {path: path.stat().st_mtime_ns for path in demo.rglob("*")} == before
    printed = capsys.readouterr().out
    assert printed.count("done before") == printed.count("$ dnet") == 7
    assert "together" in printed


def test_a_servo_run_is_an_episode_whose_figures_follow_from_its_clouds(demo: Path) -> None:
    with EpisodeReader(demo / "servo" / "run.mcap") as run:
        assert run.finished
        assert run.kinds[0] == "rest"
        goal = run.goal()
        assert goal is not None
        steps = run.steps()
        result = run.result or {}
        assert len(steps) == len(run) == len(result["chamfer"])
        for number, step in enumerate(steps):
            assert chamfer(run.cloud(number), goal) == pytest.approx(step["chamfer"], rel=1e-6)
        source, frame = str(run.meta.settings["goal"]).rsplit(":", 1)
        with EpisodeReader(demo / "data" / source) as episode:
            np.testing.assert_array_equal(goal, episode.cloud(int(frame)))
            assert run.meta.scene == episode.meta.scene
            # It starts from what the episode started from: the same rest shape, grasped and seen
            # again.
            assert chamfer(run.cloud(0), episode.cloud(0)) < 1e-4


def test_the_arm_goes_where_the_plans_say(demo: Path) -> None:
    with EpisodeReader(demo / "servo" / "run.mcap") as run:
        moved = np.diff(run.grasps, axis=0)
        for step, motion in zip(run.steps(), moved, strict=False):
            np.testing.assert_allclose(motion, step["plan"]["achieved"], atol=1e-9)


def test_rerun_accepts_the_recording_and_the_episode(demo: Path) -> None:
    for arguments in (
        ["rrd", "verify", demo / "servo" / "run.rrd"],
        ["mcap", "check", "--full", demo / "servo" / "run.mcap"],
    ):
        ran = subprocess.run(
            [RERUN, *map(str, arguments)], capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, ran.stdout + ran.stderr


def test_the_same_seed_servoes_the_same_bytes(demo: Path, tmp_path: Path) -> None:
    goal = f"{demo / 'data' / 'episode-0-00000.mcap'}:2"
    for name in ("one", "two"):
        servo(demo, tmp_path / name, goal, "--steps", "2")
    one, two = ((tmp_path / name / "run.mcap").read_bytes() for name in ("one", "two"))
    assert one == two


def refusal(*arguments: object) -> str:
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    assert isinstance(caught.value.code, str)
    return caught.value.code


def test_a_goal_frame_that_does_not_exist_is_refused(demo: Path, tmp_path: Path) -> None:
    episode = demo / "data" / "episode-0-00000.mcap"
    message = refusal(
        "servo", "--checkpoint", demo / "train", "--goal", f"{episode}:99", "--out", tmp_path / "x"
    )
    assert f"{episode} has no frame 99: it has 4 frames, 0 to 3" in message
    assert not (tmp_path / "x").exists()


def test_an_episode_cut_off_in_the_middle_is_refused(demo: Path, tmp_path: Path) -> None:
    whole = (demo / "data" / "episode-0-00000.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 2])
    for arguments in (
        ("inspect", "info", cut),
        ("servo", "--checkpoint", demo / "train", "--goal", cut, "--out", tmp_path / "x"),
        ("train", "--from-mcap", tmp_path, "--out", tmp_path / "y"),
        ("play", cut, "--save", tmp_path / "z.rrd"),
    ):
        message = refusal(*arguments)
        assert message.startswith(f"dnet: {cut} ")
        assert "cut off" in message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.mcap"]
    assert len(cut.read_bytes()) == len(whole) // 2


def test_a_checkpoint_of_another_network_is_refused(demo: Path, tmp_path: Path) -> None:
    other = tmp_path / "best.safetensors"
    save_file({"weight": np.zeros(3, np.float32)}, other)
    message = refusal(
        "servo", "--checkpoint", other, "--goal", demo / "data" / "episode-0-00000.mcap",
        "--out", tmp_path / "x",
    )  # fmt: skip
    assert str(other) in message
    assert not (tmp_path / "x").exists()


def test_a_goal_of_another_size_is_refused(demo: Path, tmp_path: Path) -> None:
    main(["record", str(tmp_path / "few"), "--pairs", "1", "--shapes", "1", "--points", "512"])
    message = refusal(
        "servo", "--checkpoint", demo / "train", "--goal",
        tmp_path / "few" / "episode-0-00000.mcap", "--out", tmp_path / "x",
    )  # fmt: skip
    assert "takes clouds of 2048 points, the goal has 512" in message


def test_a_grasp_out_of_reach_is_refused(demo: Path, tmp_path: Path) -> None:
    far = tmp_path / "far.mcap"
    with EpisodeReader(demo / "data" / "episode-0-00000.mcap") as near:
        scene = replace(near.meta.scene, manipulation_point=(0.5, 0.0, 0.04))
        meta = replace(near.meta, episode_id="far", scene=scene)
        arms = ArmModel(Placement())
        with EpisodeWriter(far, meta, arms=arms, attachments={}) as writer:
            for number in range(len(near)):
                writer.add(near.frame(number))
            writer.finish({})
    message = refusal(
        "servo", "--checkpoint", demo / "train", "--goal", far, "--out", tmp_path / "x"
    )
    assert "(0.5000, 0.0000, 0.0400) m is out of reach: " in message
    assert "limits" in message
    assert not (tmp_path / "x").exists()


def test_training_over_a_run_is_refused(demo: Path) -> None:
    before = (demo / "train" / "best.safetensors").read_bytes()
    message = refusal("train", "--from-mcap", demo / "data", "--out", demo / "train")
    assert "already holds a run" in message
    assert (demo / "train" / "best.safetensors").read_bytes() == before

"""Recording writes whole, repeatable, standard episodes, and loses nothing when it is stopped."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from dnet.cli import main
from dnet.datasets.reader import EpisodeReader
from dnet.sim.arms import Placement
from dnet.types import ARMS

DNET = Path(sys.executable).parent / "dnet"
RERUN = Path(sys.executable).parent / "rerun"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recorded") / "data"
    main(["record", str(out), "--pairs", "2", "--shapes", "2", "--seed", "4"])
    return out


def test_each_pair_is_an_episode_with_its_rest_shape_first(recorded: Path) -> None:
    names = sorted(path.name for path in recorded.iterdir())
    assert names == ["episode-4-00000.mcap", "episode-4-00001.mcap"]
    for name in names:
        with EpisodeReader(recorded / name) as episode:
            assert episode.finished
            assert list(episode.kinds) == ["rest", "shape", "shape"]
            assert episode.meta.seed == 4
            scene = episode.meta.scene
            np.testing.assert_allclose(episode.grasps[0], scene.manipulation_point, atol=1e-9)
            assert set(episode.result or {}) >= {"frames", "rejected"}
            assert b"<robot" in episode.attachment("psm.urdf")
            assert episode.attachment("object.vtk").startswith(b"# vtk")


def test_frames_hold_what_the_arms_and_the_camera_say(recorded: Path) -> None:
    place = Placement()
    with EpisodeReader(recorded / "episode-4-00000.mcap") as episode:
        for number in range(len(episode)):
            frame = episode.frame(number)
            assert frame.cloud.shape == (2048, 3)
            assert len(frame.joints) == len(ARMS)
            np.testing.assert_allclose(
                place.arms[1].forward(frame.joints[1])[:3, 3], frame.grasp, atol=1e-9
            )
            # The cloud lies on the body: never farther from a node than a cell is wide.
            gap = np.linalg.norm(frame.cloud[::16, None] - frame.nodes[None], axis=2).min(axis=1)
            assert gap.max() < 0.02
        motions = np.linalg.norm(episode.grasps[1:] - episode.grasps[0], axis=1)
        assert motions.min() > 0.005


def test_pairs_differ(recorded: Path) -> None:
    with (
        EpisodeReader(recorded / "episode-4-00000.mcap") as one,
        EpisodeReader(recorded / "episode-4-00001.mcap") as other,
    ):
        assert one.meta.scene != other.meta.scene


def test_the_same_seed_writes_the_same_bytes_in_another_process(
    recorded: Path, tmp_path: Path
) -> None:
    arguments = ["record", str(tmp_path / "again"), "--pairs", "2", "--shapes", "2", "--seed", "4"]
    subprocess.run([DNET, *arguments], check=True, capture_output=True)
    for path in sorted(recorded.iterdir()):
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes()


def test_rerun_accepts_an_episode(recorded: Path) -> None:
    path = recorded / "episode-4-00001.mcap"
    ran = subprocess.run(
        [RERUN, "mcap", "check", "--full", path], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_ctrl_c_keeps_finished_episodes_and_the_frames_of_the_current_one(tmp_path: Path) -> None:
    out = tmp_path / "data"
    # A background job inherits SIGINT as ignored: Python's own handler is put back.
    script = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from dnet.cli import main; main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script, "record", out, "--pairs", "9", "--shapes", "2"],
        stderr=subprocess.PIPE,
        text=True,
    )
    second = out / "episode-0-00001.mcap.part"
    deadline = time.monotonic() + 120
    while not (second.exists() and second.stat().st_size > 100_000):
        assert process.poll() is None, "ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; what was finished is kept" in errors
    assert "Traceback" not in errors
    names = sorted(path.name for path in out.iterdir())
    assert names == ["episode-0-00000.mcap", second.name]
    with EpisodeReader(out / "episode-0-00000.mcap") as whole:
        assert whole.finished
        assert len(whole) == 3
    with EpisodeReader(second) as cut:
        assert not cut.finished
        assert len(cut) >= 1
        assert np.isfinite(cut.frame(0).cloud).all()

"""Recording writes whole, repeatable, standard episodes, and loses nothing when it is stopped."""

import json
import random
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
TIMES = "timings.jsonl"
"""The one file that tells how long it took, and so differs from run to run."""


def contents(out: Path) -> dict[str, bytes]:
    """What a recording leaves, by name, but for the time that it took."""
    return {path.name: path.read_bytes() for path in out.iterdir() if path.name != TIMES}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recorded") / "data"
    main(["record", str(out), "--pairs", "2", "--shapes", "2", "--seed", "4"])
    return out


def test_each_pair_is_an_episode_with_its_rest_shape_first(recorded: Path) -> None:
    names = sorted(path.name for path in recorded.glob("*.mcap*"))
    assert names == ["episode-4-00000.mcap", "episode-4-00001.mcap"]
    for name in names:
        with EpisodeReader(recorded / name) as episode:
            assert episode.finished
            assert list(episode.kinds) == ["rest", "shape", "shape"]
            assert episode.meta.seed == 4
            scene = episode.meta.scene
            np.testing.assert_allclose(episode.grasps[0], scene.manipulation_point, atol=1e-9)
            assert set(episode.result or {}) >= {"frames", "rejected", "deviation_mm"}
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


def test_the_manifest_says_what_was_asked_for_and_what_is_there(recorded: Path) -> None:
    manifest = json.loads((recorded / "manifest.json").read_text())
    assert manifest["pairs"] == 2
    assert manifest["finished"] is True
    assert manifest["settings"]["seed"] == 4
    assert manifest["settings"]["laboratory"]["versions"]["pybullet"]
    assert manifest["frames"] == 6
    assert sorted(manifest["episodes"]) == ["episode-4-00000", "episode-4-00001"]
    lines = [json.loads(line) for line in (recorded / TIMES).read_text().splitlines()]
    assert [line["episode"] for line in lines] == ["episode-4-00000", "episode-4-00001"]
    assert all(line["seconds"] > 0 for line in lines)


def test_the_same_call_on_two_processes_writes_the_same_bytes(
    recorded: Path, tmp_path: Path
) -> None:
    out = tmp_path / "again"
    arguments = ["--pairs", "2", "--shapes", "2", "--seed", "4", "--workers", "2"]
    subprocess.run([DNET, "record", out, *arguments], check=True, capture_output=True)
    assert contents(out) == contents(recorded)


def test_asking_again_finds_nothing_left_to_record(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in recorded.glob("*.mcap")}
    main(["record", str(recorded), "--pairs", "2", "--shapes", "2", "--seed", "4"])
    assert "nothing left to record" in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in recorded.glob("*.mcap")} == before


def test_other_settings_are_refused_by_name(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = contents(recorded)
    with pytest.raises(SystemExit) as ended:
        main(["record", str(recorded), "--pairs", "2", "--shapes", "3", "--seed", "4"])
    assert "shapes 2 there, 3 now" in str(ended.value)
    assert contents(recorded) == before


def test_rerun_accepts_an_episode(recorded: Path) -> None:
    path = recorded / "episode-4-00001.mcap"
    ran = subprocess.run(
        [RERUN, "mcap", "check", "--full", path], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def test_frames_on_the_way_images_and_noise_are_there_when_asked_for(tmp_path: Path) -> None:
    out = tmp_path / "data"
    extras = ["--rate", "4", "--images", "--depth-noise", "1"]
    main(["record", str(out), "--pairs", "1", "--shapes", "1", *extras])
    with EpisodeReader(out / "episode-0-00000.mcap") as episode:
        assert episode.kinds[0] == "rest"
        assert set(episode.kinds[1:-1]) == {"way"}
        assert episode.kinds[-1] == "shape"
        camera = episode.camera()
        assert camera is not None
        for index in range(len(episode)):
            image = episode.image(index)
            assert image is not None
            assert image.depth.shape == (camera.height, camera.width)
            assert (image.mask == 1).sum() > 2048


def start(out: Path, *arguments: str) -> "subprocess.Popen[str]":
    # A background job inherits SIGINT as ignored: Python's own handler is put back.
    script = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from dnet.cli import main; main()"
    )
    return subprocess.Popen(
        [sys.executable, "-c", script, "record", out, *arguments],
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("workers", ["1", "2"])
def test_ctrl_c_keeps_finished_episodes_and_the_frames_of_the_current_one(
    tmp_path: Path, workers: str
) -> None:
    out = tmp_path / "data"
    process = start(out, "--pairs", "9", "--shapes", "2", "--workers", workers)
    later = out / "episode-0-00002.mcap.part"
    deadline = time.monotonic() + 240
    while not (later.exists() and later.stat().st_size > 100_000):
        assert process.poll() is None, "ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; what was finished is kept" in errors
    assert "Traceback" not in errors
    with EpisodeReader(out / "episode-0-00000.mcap") as whole:
        assert whole.finished
        assert len(whole) == 3
    for path in [*out.glob("*.mcap"), *out.glob("*.mcap.part")]:
        with EpisodeReader(path) as episode:
            assert episode.finished == (path.suffix == ".mcap")
            assert len(episode) >= 1
            assert np.isfinite(episode.frame(0).cloud).all()


@pytest.mark.slow
def test_ten_kills_and_as_many_new_starts_write_the_bytes_of_an_undisturbed_run(
    tmp_path: Path,
) -> None:
    """SIGKILL at random moments: while starting, simulating, writing or entering an episode."""
    arguments = ["--pairs", "8", "--shapes", "1", "--workers", "2"]
    undisturbed, disturbed = tmp_path / "undisturbed", tmp_path / "disturbed"
    main(["record", str(undisturbed), *arguments])
    moments = random.Random(0)
    for _ in range(10):
        process = start(disturbed, *arguments)
        time.sleep(moments.uniform(0.5, 5.0))
        process.kill()
        process.communicate()
    main(["record", str(disturbed), *arguments])
    assert contents(disturbed) == contents(undisturbed)

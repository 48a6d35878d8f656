import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dnet.recorders.grasp_recording import GraspCase, write_grasps
from dnet.recorders.viewer import draw
from dnet.recorders.viewer_process import RERUN
from dnet.types import KeypointPairs
from tests.recorders.rollout import frames
from tests.recorders.rrd import entities, rows


def case(seed: int, *, keypoints: bool = True) -> GraspCase:
    rest, *_, goal = frames(3, seed=seed, points=800)
    moved = np.linalg.norm(rest.cloud - goal.cloud, axis=1)
    pairs = KeypointPairs(rest.cloud[:50], goal.cloud[:50], np.eye(50)[7])
    return GraspCase(
        f"box:{seed}",
        rest.cloud,
        goal.cloud,
        {"dense": rest.grasp + 0.004, "regressor": np.full(3, np.nan)},
        rest.grasp,
        moved / moved.sum(),
        pairs if keypoints else None,
    )


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("grasp") / "deep" / "grasp.rrd"
    write_grasps(path, [case(0), case(1)])
    return path


def test_rerun_finds_nothing_wrong_and_nothing_else_is_left(recording: Path) -> None:
    command = [*RERUN, "rrd", "verify", str(recording)]
    verified = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert verified.returncode == 0, verified.stderr
    assert [path.name for path in recording.parent.iterdir()] == ["grasp.rrd"]


def test_every_case_has_its_clouds_choices_and_keypoints(recording: Path) -> None:
    assert {
        "/initial/cloud",
        "/goal/cloud",
        "/initial/choices/dense",
        "/initial/choices/truth",
        "/keypoints/initial",
        "/keypoints/goal",
        "/keypoints/lines",
        "/keypoints/chosen",
        "/about",
    } <= set(entities(recording))
    points = rows(recording, "/initial/choices/truth", "Points3D:positions", timeline="case")
    assert [step for step, _ in points] == [0, 1]
    truth = case(1).truth
    assert truth is not None
    np.testing.assert_allclose(points[1][1][0], truth, atol=1e-6)
    chosen = rows(recording, "/keypoints/chosen", "Points3D:positions", timeline="case")
    np.testing.assert_allclose(chosen[0][1], case(0).initial[7:8], atol=1e-6)
    missing = rows(recording, "/initial/choices/regressor", "Points3D:positions", timeline="case")
    assert [len(found) for _, found in missing] == [0, 0]
    (text,) = rows(recording, "/about", "TextDocument:text", timeline="case")[0][1]
    assert "| dense | 6.9 mm |" in text
    assert "| regressor | no answer |" in text


def test_a_case_without_keypoints_can_be_drawn(tmp_path: Path) -> None:
    write_grasps(tmp_path / "grasp.rrd", [case(2, keypoints=False)])
    draw(tmp_path / "grasp.rrd", tmp_path / "grasp.png", seconds=None)
    picture = np.asarray(Image.open(tmp_path / "grasp.png").convert("RGB"), dtype=float)
    assert picture.std() > 5

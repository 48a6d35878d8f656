from pathlib import Path

import numpy as np
import pytest

from dnet.errors import TooFew
from dnet.evaluation.keypoints import (
    Case,
    KeypointScores,
    judge,
    read_cases,
    resampled,
    table_of,
    with_noise,
)
from dnet.evaluation.registration import rigid, unmoved
from dnet.geometry.chamfer import chamfer
from dnet.geometry.sampling import farthest_points
from dnet.nets.keypoints import Keypoints
from dnet.servo.displacement_heuristic import FindKeypoints
from dnet.sim.tissue import tissue_mesh
from dnet.types import Cloud, Frame, FrameKind, Tissue
from tests.training.deforming_box import BoxEpisode, write_boxes

GRASP = np.array([0.04, 0.0, 0.04])
MESH = tissue_mesh(Tissue())


def bent(points: np.ndarray) -> Cloud:
    """Pulled up at the grasp."""
    near = np.exp(-((np.linalg.norm(points - GRASP, axis=1) / 0.04) ** 2))
    return (points + 0.03 * near[:, None] * np.array([0.0, 0.0, 1.0])).astype(np.float32)


def frame(kind: FrameKind, cloud: Cloud, nodes: Cloud) -> Frame:
    return Frame(0.0, kind, cloud, GRASP, (np.zeros(6), np.zeros(6)), nodes)


@pytest.fixture(scope="module")
def case() -> Case:
    rng = np.random.default_rng(0)
    triangles = MESH.surface()
    upper = triangles[MESH.nodes[triangles][:, :, 2].min(axis=1) > 0.039]
    corners = MESH.nodes[upper[rng.integers(len(upper), size=1500)]]
    top = np.einsum("nc,ncx->nx", rng.dirichlet((1, 1, 1), 1500), corners).astype(np.float32)
    rest = MESH.nodes.astype(np.float32)
    # What a mesh shows are its triangles, bent as the nodes are.
    return Case("one", frame("rest", top, rest), frame("shape", bent(top), bent(rest)), Tissue())


def perfect(case: Case) -> FindKeypoints:
    def find(initial: Cloud, goal: Cloud) -> Keypoints:
        points = farthest_points(initial, 200)
        return Keypoints(points, case.true_places(points), 0.0)

    return find


def test_a_perfect_method_is_aligned_and_repeatable_and_finds_the_grasp(case: Case) -> None:
    scores = judge(perfect(case), [case], most=5, random=np.random.default_rng(0))
    assert scores.alignment == 0.0
    assert scores.resampled < 0.0015
    assert scores.noisy < 0.002
    assert scores.manipulation < 0.012
    assert 0.002 < scores.coverage < 0.005


def test_unmoved_keypoints_are_off_by_the_displacement(case: Case) -> None:
    scores = judge(unmoved, [case], most=5, random=np.random.default_rng(0))
    points = unmoved(case.rest.cloud, case.goal.cloud).initial
    moved = np.linalg.norm(case.true_places(points) - points, axis=1).mean()
    assert scores.alignment == pytest.approx(float(moved), rel=1e-6)
    assert scores.resampled == scores.noisy == 0.0
    assert scores.manipulation > 0.01


def test_the_same_seed_judges_alike(case: Case) -> None:
    one, other = (judge(rigid, [case], most=5, random=np.random.default_rng(1)) for _ in range(2))
    assert (one.alignment, one.resampled, one.noisy) == (
        other.alignment,
        other.resampled,
        other.noisy,
    )


def test_cases_are_spread_over_episodes_and_start_at_rest(tmp_path: Path) -> None:
    folder = write_boxes(tmp_path / "data", [BoxEpisode(seed) for seed in range(3)])
    places = sorted(folder.glob("*.mcap"))
    cases = list(read_cases(places, 7, random=np.random.default_rng(0)))
    assert len(cases) == 7
    assert len({one.name for one in cases}) == 7
    assert {one.rest.kind for one in cases} == {"rest"}
    assert {one.goal.kind for one in cases} == {"shape"}
    again = read_cases(places, 7, random=np.random.default_rng(0))
    assert [one.name for one in again] == [one.name for one in cases]
    with pytest.raises(TooFew):
        list(read_cases([], 7, random=np.random.default_rng(0)))


def test_a_new_sample_lies_on_the_same_surface(case: Case) -> None:
    cloud = case.rest.cloud
    other = resampled(cloud, np.random.default_rng(0))
    assert other.shape == cloud.shape
    np.testing.assert_allclose(other[:, 2], 0.04, atol=1e-6)
    assert chamfer(cloud, other) < 0.002
    assert (
        0.0012
        < np.linalg.norm(with_noise(cloud, np.random.default_rng(0)) - cloud, axis=1).mean()
        < 0.002
    )


def test_a_table_has_a_row_a_method_in_millimetres() -> None:
    scores = KeypointScores(0.0034, 0.004, 0.001, 0.002, 0.0156, 81.0)
    rows = table_of({"learned": scores}).splitlines()
    assert rows[2] == "| learned | 3.4 mm | 4.0 mm | 1.0 mm | 2.0 mm | 15.6 mm | 81 ms |"
    assert len(rows) == 3

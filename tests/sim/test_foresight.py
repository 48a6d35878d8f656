"""What a grasp will make of an object is known before it is moved."""

import numpy as np
import pytest

from dnet.sim.arms import Placement
from dnet.sim.foresight import LEAST_VOLUME_RATIO, PRECISION, Foresight
from dnet.sim.grasp import Grasp, grasp
from dnet.sim.tetrahedra import Vertices
from dnet.types import Point, Scene, Tissue

SIDE = Scene((-0.0016, 0.009), 0.1877, (-0.0507, -0.0003, 0.04), (0.0514, -0.002, 0.0234))
CRUSHING = (
    np.array([0.0125, -0.0496, 0.0483]),
    np.array([-0.06, 0.0, -0.02]),
    np.array([-0.03, 0.05, -0.015]),
)


@pytest.fixture(scope="module")
def start() -> Grasp:
    return grasp(SIDE, Placement())


@pytest.fixture(scope="module")
def foresight(start: Grasp) -> Foresight:
    return Foresight(start, Tissue())


def moved(start: Grasp, foresight: Foresight, motion: Point, nodes: Vertices) -> Vertices:
    targets = np.concatenate([nodes[start.held], nodes[start.gripped] + motion])
    return foresight.solver.settle(nodes, targets).nodes


def ratio(start: Grasp, nodes: Vertices) -> float:
    return float(start.mesh.volume_ratios(nodes).min())


@pytest.mark.parametrize("motion", [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.01, -0.02, 0.02]])
def test_a_small_pull_is_borne_to_its_end(
    start: Grasp, foresight: Foresight, motion: list[float]
) -> None:
    assert foresight.borne(start.rest, np.array(motion)) == 1.0


@pytest.mark.parametrize("motion", CRUSHING)
def test_what_is_borne_ends_where_a_tetrahedron_would_be_crushed(
    start: Grasp, foresight: Foresight, motion: Point
) -> None:
    assert ratio(start, moved(start, foresight, motion, start.rest)) < LEAST_VOLUME_RATIO
    share = foresight.borne(start.rest, motion)
    assert 0.2 < share < 1.0
    good = moved(start, foresight, share * motion, start.rest)
    assert ratio(start, good) > LEAST_VOLUME_RATIO - 1e-3
    further = share + 2 * PRECISION / float(np.linalg.norm(motion))
    assert ratio(start, moved(start, foresight, further * motion, start.rest)) < LEAST_VOLUME_RATIO


@pytest.mark.parametrize("motion", CRUSHING)
def test_from_there_nothing_further_is_borne_and_all_the_way_back_is(
    start: Grasp, foresight: Foresight, motion: Point
) -> None:
    share = foresight.borne(start.rest, motion)
    there = moved(start, foresight, share * motion, start.rest)
    rest = (1 - share) * motion
    assert foresight.borne(there, rest) * float(np.linalg.norm(rest)) < 3 * PRECISION
    assert foresight.borne(there, -share * motion) == 1.0

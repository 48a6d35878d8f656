"""How good keypoints are, by the simulator's mesh: ground truth that no method sees."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass
from time import process_time

import numpy as np
from scipy.spatial import cKDTree

from dnet.datasets.reader import EpisodeReader
from dnet.errors import NoDisplacement, TooFew
from dnet.evaluation.material_points import MaterialPoints
from dnet.geometry.chamfer import nearest_distances
from dnet.nets.keypoints import Keypoints
from dnet.servo.displacement_heuristic import (
    DisplacementHeuristic,
    FindKeypoints,
)
from dnet.servo.reach import reachable
from dnet.sim.tissue import tissue_mesh
from dnet.types import Cloud, Frame, Place, Point, Tissue

NOISE = 0.001
"""Standard deviation that is added along each axis, in metres."""
_NEAR = 9


@dataclass(frozen=True)
class Case:
    """An episode's rest shape, and one of its shapes as the goal."""

    name: str
    rest: Frame
    goal: Frame
    tissue: Tissue

    @property
    def manipulation_point(self) -> Point:
        """The point that was grasped to bring about the goal."""
        return self.rest.grasp

    def true_places(self, points: Cloud) -> Cloud:
        """Return where points of the rest cloud are in the goal."""
        triangles = tissue_mesh(self.tissue).surface()
        return MaterialPoints.of(points, self.rest.nodes, triangles).at(self.goal.nodes)


@dataclass(frozen=True, slots=True)
class KeypointScores:
    """Means over cases, in metres but for the time."""

    alignment: float
    """From where a keypoint is put in the goal to where that point of the object is."""
    coverage: float
    """From a point of the initial cloud to the nearest keypoint."""
    resampled: float
    """How much the displacement at a place changes if both clouds are sampled anew."""
    noisy: float
    """The same if both clouds have 1 mm of noise."""
    manipulation: float
    """From the manipulation point that the heuristic chooses to the true one."""
    milliseconds: float
    """Processor time to find the keypoints of a case: other programs do not change it."""


def read_cases(
    places: Sequence[Place], count: int, *, random: np.random.Generator
) -> Iterator[Case]:
    """Yield cases, as evenly from the episodes as it goes, each with a random shape as its goal.

    Args:
        places: The episodes' files.
        count: How many cases, fewer if there are not as many shapes.
        random: Where the choice comes from.

    Raises:
        TooFew: If there is no episode.
        DnetError: If an episode cannot be read.
    """
    if not places:
        raise TooFew("number of episodes to judge keypoints by", 0, 1)
    shares = np.diff(np.linspace(0, count, len(places) + 1).astype(int))
    for place, share in zip(places, shares.tolist(), strict=True):
        with EpisodeReader(place) as episode:
            shapes = [k for k, kind in enumerate(episode.kinds) if kind == "shape"]
            rest = episode.frame(episode.kinds.index("rest"))
            for k in random.permutation(shapes)[:share].tolist():
                name = f"{episode.meta.episode_id}:{k}"
                yield Case(name, rest, episode.frame(k), episode.meta.scene.tissue)


def judge(
    find: FindKeypoints,
    cases: Sequence[Case],
    *,
    most: int,
    random: np.random.Generator,
    on_case: Callable[[], None] = lambda: None,
) -> KeypointScores:
    """Return how good the keypoints of a method are.

    Args:
        find: The method.
        cases: What it is judged by.
        most: Keypoints that count for the manipulation point.
        random: Where samples and noise come from.
        on_case: Called after each case.
    """
    rows = []
    for case in cases:
        rows.append(_judge_case(find, case, most=most, random=random))
        on_case()
    return KeypointScores(*np.mean(rows, axis=0).tolist())


def _judge_case(
    find: FindKeypoints, case: Case, *, most: int, random: np.random.Generator
) -> tuple[float, ...]:
    initial, goal = case.rest.cloud, case.goal.cloud
    begun = process_time()
    found = find(initial, goal)
    spent = process_time() - begun
    anew = find(resampled(initial, random), resampled(goal, random))
    noisy = find(with_noise(initial, random), with_noise(goal, random))
    point = _grasp(DisplacementHeuristic(find, most), found, case)
    true = case.true_places(found.initial)
    return (
        float(np.linalg.norm(found.goal - true, axis=1).mean()),
        float(nearest_distances(initial, found.initial).mean()),
        _change(found, anew),
        _change(found, noisy),
        float(np.linalg.norm(point - case.manipulation_point)),
        1e3 * spent,
    )


def _grasp(heuristic: DisplacementHeuristic, found: Keypoints, case: Case) -> Point:
    """Return the heuristic's manipulation point, or the middle of what can be reached."""
    initial = case.rest.cloud
    try:
        return heuristic.choose_by(found, initial, case.goal.cloud).point
    except NoDisplacement:
        # An answer that needs no keypoints, so that every case counts.
        surface = initial[reachable(initial, heuristic.workspace)].astype(np.float64)
        away = np.linalg.norm(surface - surface.mean(axis=0), axis=1)
        return surface[away.argmin()]


def resampled(cloud: Cloud, random: np.random.Generator) -> Cloud:
    """Return as many other points of the same surface, in another order.

    Each lies on the way from a point of the cloud to one of its nearest neighbours.
    """
    _, found = cKDTree(cloud).query(cloud, k=min(_NEAR, len(cloud)))
    near = np.asarray(found, np.int64).reshape(len(cloud), -1)
    rows = np.arange(len(cloud))
    other = cloud[near[rows, random.integers(near.shape[1], size=len(cloud))]]
    share = random.random((len(cloud), 1), dtype=np.float32)
    return random.permutation(cloud + share * (other - cloud))


def with_noise(cloud: Cloud, random: np.random.Generator) -> Cloud:
    """Return a cloud of which every coordinate is off by a little."""
    return cloud + np.float32(NOISE) * random.standard_normal(cloud.shape, dtype=np.float32)


def _change(one: Keypoints, other: Keypoints) -> float:
    """Return the mean difference of displacements, each at the keypoint nearest to another."""
    _, rows = cKDTree(other.initial).query(one.initial)
    difference = (one.goal - one.initial) - (other.goal - other.initial)[rows]
    return float(np.linalg.norm(difference, axis=1).mean())


_COLUMNS = (
    "keypoints",
    "alignment",
    "coverage",
    "resampled",
    "1 mm noise",
    "manipulation point",
    "time",
)


def table_of(scores: dict[str, KeypointScores]) -> str:
    """Return a Markdown table, in millimetres and milliseconds."""
    rows = [_COLUMNS, ("---", *["---:"] * (len(_COLUMNS) - 1))]
    for name, of in scores.items():
        *lengths, time = astuple(of)
        rows.append((name, *(f"{1e3 * length:.1f} mm" for length in lengths), f"{time:.0f} ms"))
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)

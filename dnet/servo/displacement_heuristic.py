"""Where to grasp: near the keypoints that the goal pulls out most (section III of the paper).

The paper takes those that move farthest. On an elastic body that is held at one end, all that lies
beyond the grasp moves about as far as the grasp, and with errors of a few millimetres the farthest
point is anywhere there. What tells is that in such a body a displacement is about the mean of those
around it, unless a force acts there (the equation of Navier and Cauchy: the Laplacian of the
displacement, which is what a point has beyond the mean around it, balances the force). So
keypoints are judged by how much farther they move than their surroundings.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32, Float64
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from dnet.errors import NoDisplacement, OutOfReach
from dnet.geometry.chamfer import chamfer
from dnet.nets.keypoints import Keypoints
from dnet.servo.pickers import Choice
from dnet.servo.reach import reachable, reachable_hidden_sides
from dnet.sim.scenes import Workspace
from dnet.types import Cloud, KeypointPairs, Point

MOST, POWER = 20, 4
"""How many keypoints count, as in the paper, and the power of the pull by which they do."""
NEAR, AROUND = 0.006, 0.025
"""Standard deviations of the Gaussians that a keypoint and its surroundings are averaged by, in
metres: about the distance between keypoints, and a quarter of the length of a box. All four were
chosen on 60 episodes that networks had learned from, which of keypoints, that learn from clouds
alone, tell as much as others, and on the 18 that had been held out."""
FAINT = 1e-3
"""Share of its displacement that every keypoint is pulled by at least: where all move alike, the
displacement decides."""

UNIT, SMOOTHING = 0.1, 1e-3
"""Metres that the spline takes for 1, about the size of an object, and how little it minds not
to go through the displacements that it is made from."""

FindKeypoints = Callable[[Cloud, Cloud], Keypoints]
"""From an initial and a goal cloud to keypoints in both."""


@dataclass(frozen=True)
class KeypointChoice:
    """A manipulation point, and what it was chosen by."""

    point: Point
    """Where to grasp: a point of the initial cloud or of a side that is not seen, in metres."""
    keypoints: Keypoints
    """The object's keypoints in both clouds; after those that were found, those of its hidden
    sides."""
    displacement: Float32[np.ndarray, "k"]
    """How far each keypoint moves, in metres."""
    weights: Float32[np.ndarray, "k"]
    """How much each keypoint counts; they sum to 1."""
    confidence: float
    """Share of the difference between the clouds that the keypoints explain, from 0 to 1: one
    less the Chamfer distance that is left over that which was there."""


@dataclass(frozen=True)
class DisplacementHeuristic:
    """Grasps the mean of the keypoints that are pulled most, each weighing what it is displaced by.

    In the paper that is 20 keypoints, the most displaced. Here it is those that move farthest
    beyond their surroundings, and a power of that weighs them too. And the paper's keypoints are on
    what the camera sees: here hidden sides have some, whose displacement is that of the seen ones
    carried on.
    """

    find: FindKeypoints
    """Finds keypoints, as `KeypointNet.keypoints` does."""
    most: int = MOST
    """How many keypoints count, of those that the gripper can reach."""
    power: int | float = POWER
    """Of the pull, by which displacements are multiplied (paper: 0)."""
    least: float = 0.003
    """Displacement of the most displaced keypoint below which the goal is reached already, in
    metres."""
    workspace: Workspace = field(default_factory=Workspace)
    """Where the gripper can reach."""

    def choose(self, initial: Cloud, goal: Cloud) -> KeypointChoice:
        """Return where to grasp an object to bring it from its initial to its goal shape.

        The mean lies inside the object; the nearest point of the surface that the gripper can
        reach is taken, of the cloud or of a side that the camera does not see.

        Args:
            initial: What is seen of the object before any motion, (n, 3).
            goal: What should be seen, (m, 3).

        Raises:
            NoDisplacement: If hardly anything moves.
            OutOfReach: If no point of the surface can be reached.
            ShortCloud: If a cloud has too few points.
            BadCloud: If a coordinate is NaN or infinite.
        """
        return self.choose_by(self.find(initial, goal), initial, goal)

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the point of `choose` and how sure it is; raise as that does."""
        chosen = self.choose(initial, goal)
        found = chosen.keypoints
        pairs = KeypointPairs(found.initial, found.goal, chosen.weights)
        return Choice(chosen.point, chosen.confidence, keypoints=pairs)

    def choose_by(self, keypoints: Keypoints, initial: Cloud, goal: Cloud) -> KeypointChoice:
        """Return where to grasp by keypoints that are known already; raise as `choose` does."""
        within = reachable(initial, self.workspace)
        hidden = reachable_hidden_sides(initial, self.workspace)
        surface = np.concatenate([initial[within], hidden])
        if not len(surface):
            raise OutOfReach(len(initial))
        _, own = cKDTree(initial).query(keypoints.initial)
        # A few keypoints may have no one within reach: then all may count.
        counted = within[own] if within[own].any() else np.ones(len(keypoints.initial), bool)
        counted = np.concatenate([counted, np.ones(len(hidden), bool)])
        every = with_hidden(keypoints, hidden)
        displacement = np.linalg.norm(every.goal - every.initial, axis=1)
        farthest = float(displacement[counted].max())
        if farthest < self.least:
            raise NoDisplacement("the most displaced keypoint is", farthest, self.least)
        pull = pulls(every)
        weights = np.where(counted, displacement * (pull / pull.max()) ** self.power, 0.0)
        weights = most_of(weights.astype(np.float32), self.most)
        away = np.linalg.norm(surface - weights @ every.initial, axis=1)
        point = surface[away.argmin()].astype(np.float64)
        before = max(chamfer(initial, goal), float(np.finfo(np.float32).tiny))
        confidence = max(0.0, 1.0 - keypoints.residual / before)
        return KeypointChoice(point, every, displacement, weights, confidence)


def with_hidden(keypoints: Keypoints, hidden: Float32[np.ndarray, "h 3"]) -> Keypoints:
    """Return keypoints and, after them, others whose displacement follows from theirs.

    It is that of the thin-plate spline through the displacements that are known (Bookstein 1989;
    in three dimensions its kernel is that of Duchon 1977): of all fields that agree with them the
    least bent, and beyond them an affine map.

    Args:
        keypoints: That are known, four or more that are not all in one plane; else the
            displacement of the nearest is taken.
        hidden: Points of the initial shape, in metres.
    """
    known, moved = keypoints.initial.astype(np.float64), keypoints.goal.astype(np.float64)
    centred = (known - known.mean(axis=0)) / UNIT
    if np.linalg.matrix_rank(centred, tol=1e-3) == centred.shape[1]:
        places = (hidden - known.mean(axis=0)) / UNIT
        spline = RBFInterpolator(centred, moved - known, smoothing=SMOOTHING)
        displacements = spline(places)
    else:
        _, nearest = cKDTree(known).query(hidden)
        displacements = (moved - known)[nearest]
    carried = (hidden + displacements).astype(np.float32)
    return Keypoints(
        np.concatenate([keypoints.initial, hidden]),
        np.concatenate([keypoints.goal, carried]),
        keypoints.residual,
    )


def pulls(keypoints: Keypoints) -> Float64[np.ndarray, "k"]:
    """Return how much farther keypoints move than what is around them, in metres.

    It is the difference of two means of displacements, weighed by a narrow and by a wide Gaussian
    about the keypoint, along its own displacement: on the scale of the wide one the Laplacian,
    turned round. Keypoints that are crowded count less, so that the mean is that over the surface.

    Args:
        keypoints: Of which one moves.
    """
    places = keypoints.initial.astype(np.float64)
    displacements = keypoints.goal.astype(np.float64) - places
    lengths = np.linalg.norm(displacements, axis=1)
    apart = np.square(cdist(places, places))
    beyond = _mean(displacements, apart, NEAR) - _mean(displacements, apart, AROUND)
    along = (beyond * displacements).sum(axis=1) / np.maximum(lengths, np.finfo(float).tiny)
    return np.maximum(along, FAINT * lengths)


def _mean(
    vectors: Float64[np.ndarray, "k 3"], apart: Float64[np.ndarray, "k k"], width: float
) -> Float64[np.ndarray, "k 3"]:
    """Return means about each place, of which squared distances are given."""
    weights = np.exp(-apart / (2 * width**2))
    weights /= weights.sum(axis=0)
    weights /= weights.sum(axis=1, keepdims=True)
    return weights @ vectors


def most_of(weights: Float32[np.ndarray, "k"], most: int) -> Float32[np.ndarray, "k"]:
    """Return the `most` greatest weights in proportion, and 0 for the others; they sum to 1.

    Args:
        weights: Of which one at least is not 0.
        most: How many count.
    """
    kept = np.zeros_like(weights)
    # Stable: of keypoints that weigh the same the first ones count.
    top = np.argsort(-weights, kind="stable")[:most]
    kept[top] = weights[top]
    return kept / kept.sum()

"""Where to grasp: near the keypoints that the goal displaces most (section III of the paper)."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from dnet.errors import NoDisplacement, OutOfReach
from dnet.geometry.chamfer import chamfer
from dnet.nets.keypoints import Keypoints
from dnet.servo.pickers import Choice
from dnet.servo.reach import reachable, reachable_hidden_sides
from dnet.sim.scenes import Workspace
from dnet.types import Cloud, KeypointPairs, Point

MOST, POWER = 100, 20
"""Chosen on 60 episodes that networks had learned from, which of keypoints, that learn from clouds
alone, tell as much as others, and on the 18 that had been held out."""

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
    """Grasps the mean of the most displaced keypoints, each weighing what it is displaced by.

    In the paper that is 20 keypoints, each weighed by its displacement. Displacements that a
    network finds have errors, which make the greatest of them a poor guide: here more keypoints
    count, weighed by a power, so that those that move about as far as the farthest decide. And the
    paper's keypoints are on what the camera sees: here hidden sides have some, too, whose
    displacement is that of the seen ones carried on.
    """

    find: FindKeypoints
    """Finds keypoints, as `KeypointNet.keypoints` does."""
    most: int = MOST
    """How many keypoints count, of those that the gripper can reach (paper: 20)."""
    power: int | float = POWER
    """Of the displacement: what a keypoint weighs (paper: 1)."""
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
        weights = top_weights(np.where(counted, displacement, 0.0), self.most, power=self.power)
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


def top_weights(
    displacement: Float32[np.ndarray, "k"], most: int, *, power: int | float = 1
) -> Float32[np.ndarray, "k"]:
    """Return a power of the `most` greatest displacements, 0 for the others; they sum to 1.

    Args:
        displacement: Of which one at least is not 0.
        most: How many count.
        power: To which they are raised.
    """
    weights = np.zeros_like(displacement)
    # Stable: of keypoints equally displaced the first ones count.
    top = np.argsort(-displacement, kind="stable")[:most]
    # Shares of the greatest, whose powers are no smaller than float32 can tell from one another.
    weights[top] = (displacement[top] / displacement.max()) ** power
    return weights / weights.sum()

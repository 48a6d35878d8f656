"""The values that flow between the parts of dnet: scenes, frames, goals, plans, traces.

Metres, seconds, radians and the world frame, unless a name says otherwise. The world's origin
lies on the table top under the nominal centre of the object, z up; the holding arm stands on the
-x side, the moving arm on the +x side.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float, Float32, Float64, UInt8

Cloud = Float32[np.ndarray, "_ 3"]
Nodes = Float32[np.ndarray, "_ 3"]
Point = Float64[np.ndarray, "3"]
Pose = Float64[np.ndarray, "4 4"]
Poses = Float64[np.ndarray, "_ 4 4"]
Joints = Float64[np.ndarray, "6"]
JointPath = Float64[np.ndarray, "_ 6"]

Place = Path | str
"""Where a file or a folder is: a path of this machine, or a URL of a store that fsspec knows."""

FrameKind = Literal["rest", "shape", "way"]
"""`rest`: after the grasp, before any motion; `shape`: settled; `way`: seen on the way."""

ARMS = ("psm_left", "psm_right")
"""The two patient-side manipulators: the first holds the object, the second deforms it."""


class Transform(NamedTuple):
    """Where one named frame stands in another, as a scene graph stores it."""

    parent: str
    child: str
    translation: Point
    rotation: Float64[np.ndarray, "4"]
    """Unit quaternion, x y z w."""


class LinkWay(NamedTuple):
    """Where links stand in their parents at several times."""

    names: Sequence[tuple[str, str]]
    """Parent and child of each link."""
    translations: Float64[np.ndarray, "_ _ 3"]
    """By time and link, (n, k, 3)."""
    rotations: Float64[np.ndarray, "_ _ 4"]
    """Unit quaternions, x y z w, likewise."""


class Gaps(NamedTuple):
    """How far the points of a cloud and of the goal are from the nearest of the other."""

    there: Float64[np.ndarray, "_"]
    """From each point of the cloud to the goal, in metres."""
    back: Float64[np.ndarray, "_"]
    """From each point of the goal to the cloud."""

    @property
    def chamfer(self) -> float:
        """The symmetric mean Chamfer distance, in metres."""
        return float((np.mean(self.there) + np.mean(self.back)) / 2)


TissueShape = Literal["box", "cylinder", "hemi_ellipsoid"]
"""`cylinder`: lying, its axis along x; `hemi_ellipsoid`: upper half, its flat side down."""


@dataclass(frozen=True, slots=True)
class Tissue:
    """The deformable object: its shape and size at rest, its mesh and its material.

    The defaults are the paper's: a soft box of 1 kPa, Poisson's ratio 0.3.
    """

    shape: TissueShape = "box"
    size: tuple[float, float, float] = (0.10, 0.10, 0.04)
    """Length along its own x, y and z, in metres; the holding arm grips its end at least x."""
    cells: tuple[int, int, int] = (8, 8, 4)
    """Mesh cells along each axis."""
    young: float = 1000.0
    """Young's modulus in pascals."""
    poisson: float = 0.3
    """Poisson's ratio."""
    density: float = 1000.0
    """In kg/m^3."""


@dataclass(frozen=True, slots=True)
class Scene:
    """One initial configuration and manipulation point: what an episode starts from."""

    position: tuple[float, float]
    """Where the centre of the object lies on the table (x, y)."""
    yaw: float
    """How far the object is turned about the vertical."""
    hold: tuple[float, float, float]
    """The point that the holding arm grips."""
    manipulation_point: tuple[float, float, float]
    """The point that the moving arm grasps and displaces."""
    tissue: Tissue = field(default_factory=Tissue)
    """The object."""


@dataclass(frozen=True, slots=True)
class Look:
    """What the depth camera saw, pixel by pixel, row by row from the upper left."""

    depth: Float32[np.ndarray, "h w"]
    """Distance along the optical axis in metres; the camera's far limit where nothing is."""
    mask: UInt8[np.ndarray, "h w"]
    """What each pixel shows: 0 nothing, 1 the object, 2 and more the other bodies, each with a
    number of its own."""


@dataclass(frozen=True, slots=True)
class Frame:
    """What was seen, and where the arms and the grasp were, at one instant."""

    time: float
    """Seconds of simulation since the episode began."""
    kind: FrameKind
    cloud: Cloud
    """Visible surface of the object, in farthest-point order, (n, 3)."""
    grasp: Point
    """The manipulation point: the tip of the moving arm's jaws, (3,)."""
    joints: tuple[Joints, Joints]
    """Joint positions of the holding and the moving arm, in the order of `ARMS`."""
    nodes: Nodes
    """Mesh nodes of the simulator: ground truth for scores, never for a network, (m, 3)."""
    image: Look | None = None
    """What `cloud` was made from, where it is kept."""


@dataclass(frozen=True, slots=True)
class EpisodeMeta:
    """What is known of an episode before its first frame."""

    episode_id: str
    """Unique within a dataset, and the file's stem."""
    seed: int
    index: int
    """Which pair of the recording this is."""
    scene: Scene
    settings: dict[str, Any] = field(default_factory=dict)
    """Everything that shaped the recording (object, camera, workspace, versions), as JSON."""


@dataclass(frozen=True, slots=True)
class Goal:
    """The shape to reach."""

    cloud: Cloud
    source: str
    """Where it came from, for people: a file and a frame."""
    grasp: Point | None = None
    """Where the manipulation point is in it, where that is known: for scores and the oracle."""
    nodes: Nodes | None = None
    """The mesh nodes in it, likewise, (m, 3)."""
    again: Cloud | None = None
    """The same shape seen once more, sampled otherwise: no figure can be expected below its
    distance to `cloud`."""


PlanStatus = Literal["straight", "rrt_connect", "partial", "failed"]
"""`straight`: the straight line of the tip; `rrt_connect`: a planned detour that reaches the
request; `partial`: a shorter motion than requested; `failed`: no motion."""


@dataclass(frozen=True, slots=True)
class KeypointPairs:
    """Keypoints of an object in two clouds; row k of both is the same point of it."""

    initial: Float[np.ndarray, "k 3"]
    """In metres."""
    goal: Float[np.ndarray, "k 3"]
    """In metres."""
    weights: Float[np.ndarray, " k"]
    """How much each counts for the choice of a grasp; 0 for most."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A timed joint path of the moving arm, and how it came about."""

    status: PlanStatus
    path: JointPath
    """Joint positions, (n, 6); a failed plan has the start alone."""
    times: Float64[np.ndarray, "_"]
    """Seconds from the start of the motion, (n,)."""
    requested: Point
    """Displacement of the tip that was asked for."""
    achieved: Point
    """Displacement of the tip at the end of the path."""
    reason: str
    """Why this plan and not a better one, empty for a straight line."""
    checks: int
    """Collision checks made."""
    milliseconds: float
    """Wall time of planning; the only figure here that differs from run to run."""


Outcome = Literal[
    "converged",
    "reached",
    "stalled",
    "out_of_steps",
    "out_of_time",
    "planning_failed",
    "grasp_lost",
    "object_lost",
    "object_crushed",
    "bad_motion",
    "disk_full",
    "interrupted",
]
"""How a run ends. `converged`: the predicted motion is small; `reached`: the goal is near;
`stalled`: it gets no nearer; `grasp_lost`, `object_lost`: the jaws hold nothing, the camera sees
too little; `object_crushed`: the mesh is inside out, as no tissue can be; `bad_motion`: the
prediction is no number."""


@dataclass(frozen=True, slots=True)
class Latency:
    """Wall time of the stages of one turn, in milliseconds: what differs from run to run."""

    observe: float
    """From the call of the camera to a cloud and its distance to the goal."""
    predict: float
    plan: float = 0.0
    execute: float = 0.0
    """Driving the arm and letting the object come to rest: the simulation."""
    log: float = 0.0


@dataclass(frozen=True, slots=True)
class Step:
    """One turn of the servo loop: what was seen, and what was done about it."""

    frame: Frame
    chamfer: float
    """Symmetric mean Chamfer distance from the cloud to the goal, in metres."""
    motion: Point
    """The motion that the controller asks for."""
    plan: Plan | None = None
    """What is done about it; None at the last observation of a run, or of a grasp."""
    latency: Latency | None = None
    """How long it took, once that is known."""
    gaps: Gaps | None = None
    """What `chamfer` is the mean of, for those who draw it."""


@dataclass(frozen=True, slots=True)
class Trace:
    """A whole servo run."""

    goal: Goal
    steps: Sequence[Step]
    outcome: Outcome
    reason: str = ""
    """What led to it, for people, where its name does not say all."""
    last: Frame | None = None
    """What was seen at the end, where no step came of it."""

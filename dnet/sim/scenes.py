"""What is drawn at random: where the object lies, where it is grasped, how far it is moved."""

from dataclasses import dataclass

import numpy as np

from dnet.geometry.pose import rotation_z
from dnet.types import Point, Scene


@dataclass(frozen=True)
class SoftBox:
    """The object of the paper: a soft box on the table."""

    size: tuple[float, float, float] = (0.10, 0.10, 0.04)
    """Length along x, y and z in metres."""
    cells: tuple[int, int, int] = (8, 8, 4)
    """Mesh cells along each axis; four through the thickness bend within 13 % of a beam's
    stiffness, and 405 nodes stay fast."""
    young: float = 1000.0
    """Young's modulus in pascals."""
    poisson: float = 0.3
    """Poisson's ratio."""
    density: float = 1000.0
    """In kg/m^3."""


@dataclass(frozen=True)
class Workspace:
    """The ranges that scenes and displacements are drawn from, uniformly."""

    position: float = 0.01
    """Largest offset of the object from the origin along x and along y, in metres."""
    yaw: float = 0.2
    """Largest turn of the object about the vertical, in radians."""
    grasp_low: tuple[float, float] = (0.020, -0.040)
    """Least manipulation point on the object's top face (x, y in its own frame), in metres."""
    grasp_high: tuple[float, float] = (0.045, 0.040)
    """Greatest manipulation point, likewise."""
    displacement_low: tuple[float, float, float] = (-0.03, -0.05, 0.0)
    """Least displacement of the gripper from the manipulation point, in metres: pushing inwards
    by more than 3 cm, or down, turns tetrahedra inside out."""
    displacement_high: tuple[float, float, float] = (0.05, 0.05, 0.05)
    """Greatest displacement of the gripper, in metres."""
    hold: float = 0.005
    """How far from the object's end the holding arm grips its top face, in metres."""


def draw_scene(workspace: Workspace, box: SoftBox, random: np.random.Generator) -> Scene:
    """Return a random initial configuration and manipulation point on the object's top face."""
    x, y = random.uniform(-workspace.position, workspace.position, size=2)
    yaw = random.uniform(-workspace.yaw, workspace.yaw)
    grasp = random.uniform(workspace.grasp_low, workspace.grasp_high)
    length, _, height = box.size
    hold = np.array([-length / 2 + workspace.hold, 0.0])
    return Scene(
        position=(float(x), float(y)),
        yaw=float(yaw),
        hold=_on_top(hold, (x, y), yaw, height),
        manipulation_point=_on_top(grasp, (x, y), yaw, height),
    )


def draw_displacement(workspace: Workspace, random: np.random.Generator) -> Point:
    """Return a random displacement of the gripper from the manipulation point, in metres."""
    return random.uniform(workspace.displacement_low, workspace.displacement_high)


def _on_top(
    point: np.ndarray, position: tuple[float, float], yaw: float, height: float
) -> tuple[float, float, float]:
    x, y = rotation_z(yaw)[:2, :2] @ point + position
    return (float(x), float(y), height)

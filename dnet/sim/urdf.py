"""The arm's URDF, generated from its link tree: boxes and cylinders, no foreign meshes.

Masses after the dVRK dynamic model of Wang et al. 2019 (arXiv 1902.10875), rounded.
"""

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from dnet.geometry.pose import Rotation3
from dnet.sim.psm import JAW_LENGTH, JOINTS, TIP, TOOL_LENGTH, WRIST_LENGTH
from dnet.sim.psm_links import (
    BACK_OFFSET,
    LINK_JOINTS,
    PARALLELOGRAM_HEIGHT,
    PARALLELOGRAM_OFFSET,
    PIVOT_DISTANCE,
    LinkJoint,
)
from dnet.types import Point

COLOURS = {
    "shell": (0.62, 0.66, 0.72),
    "dark": (0.25, 0.26, 0.30),
    "steel": (0.82, 0.83, 0.86),
    "blue": (0.22, 0.37, 0.62),
}
SHAFT_RADIUS = 0.0042
"""Of an 8 mm instrument, in metres."""
EFFORT = {"revolute": 20.0, "prismatic": 50.0}

Triple = tuple[float, float, float]


def psm_urdf(name: str = "psm") -> str:
    """Return the URDF of one arm; its base frame is the remote centre of motion."""
    robot = psm_tree(name)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def psm_tree(name: str = "psm") -> ElementTree.Element:
    """Return the same as a tree."""
    robot = ElementTree.Element("robot", name=name)
    for material, rgb in COLOURS.items():
        element = ElementTree.SubElement(robot, "material", name=material)
        ElementTree.SubElement(element, "color", rgba=_numbers((*rgb, 1.0)))
    _add_links(robot)
    for joint in LINK_JOINTS:
        _add_joint(robot, joint)
    return robot


def _add_links(robot: ElementTree.Element) -> None:
    link = _link(robot, "base_link", 2.0, (0.1, 0.1, 0.1), (0.0, -0.62, 0.0))
    _box(link, "dark", (0.12, 0.12, 0.16), (0.0, -0.66, 0.0))
    _box(link, "dark", (0.10, 0.10, 0.50), (0.0, -0.70, -0.25), solid=False)

    link = _link(robot, "yaw_link", 1.47, (0.1, 0.1, 0.16), (0.0, 0.0, 0.55))
    _box(link, "blue", (0.10, 0.10, 0.14), (0.0, 0.0, PIVOT_DISTANCE))

    rail = PARALLELOGRAM_OFFSET + 0.02
    link = _link(robot, "pitch_link", 0.40, (0.05, 0.5, 0.05), (0.04, 0.36, 0.0))
    lower = PARALLELOGRAM_HEIGHT - 0.02
    _bar(link, "shell", (rail, lower, 0.0), (rail, lower + 0.48, 0.0), section=(0.05, 0.045))

    link = _link(robot, "insertion_link", 0.58, (0.06, 0.06, 0.08), (0.0, 0.0, 0.0))
    _box(link, "dark", (0.045, 0.06, 0.08), (0.0, 0.0, -0.02))

    link = _link(robot, "roll_link", 0.02, (0.01, 0.01, TOOL_LENGTH), (0.0, 0.0, -TOOL_LENGTH / 2))
    _rod(link, "steel", (0.0, 0.0, -TOOL_LENGTH + 0.005), (0.0, 0.0, 0.0), SHAFT_RADIUS)

    link = _link(robot, "wrist_pitch_link", 0.0125, (0.01, 0.008, 0.008), (0.0045, 0.0, 0.0))
    _rod(link, "steel", (0.0, 0.0, 0.0), (WRIST_LENGTH, 0.0, 0.0), 0.0038)

    link = _link(robot, "wrist_yaw_link", 0.0125, (0.01, 0.008, 0.008), (0.0, 0.0, 0.0))
    _rod(link, "steel", (0.0, 0.0, -0.003), (0.0, 0.0, 0.003), 0.0035)

    along = TIP[:3, 2]
    for side, turned in (("left", along), ("right", along * np.array([1.0, -1.0, -1.0]))):
        middle = _triple(turned * JAW_LENGTH / 2)
        link = _link(robot, f"jaw_{side}_link", 0.0105, (0.004, 0.004, JAW_LENGTH), middle)
        ends = _triple(turned * 0.001), _triple(turned * JAW_LENGTH)
        _bar(link, "steel", *ends, section=(0.003, 0.003))
    _link(robot, "tip_link", 1e-4, (0.002, 0.002, 0.002), (0.0, 0.0, 0.0))

    link = _link(robot, "back_link", 0.70, (0.04, 0.15, 0.03), (0.02, 0.075, 0.0))
    _bar(
        link,
        "shell",
        (0.0, 0.0, 0.0),
        (BACK_OFFSET, PARALLELOGRAM_HEIGHT, 0.0),
        section=(0.03, 0.04),
    )
    link = _link(robot, "bar_link", 0.446, (0.5, 0.03, 0.03), (-0.26, 0.0, 0.0))
    reach = PIVOT_DISTANCE + BACK_OFFSET - PARALLELOGRAM_OFFSET
    _bar(link, "shell", (0.0, 0.0, 0.0), (-reach, 0.0, 0.0), section=(0.03, 0.04))


def _add_joint(robot: ElementTree.Element, joint: LinkJoint) -> None:
    element = ElementTree.SubElement(robot, "joint", name=joint.name, type=joint.kind)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    _add_origin(element, joint.origin[:3, 3], joint.origin[:3, :3])
    if joint.kind == "fixed":
        return
    ElementTree.SubElement(element, "axis", xyz="0 0 1")
    lower, upper = joint.limits
    velocity = next((j.velocity for j in JOINTS if j.name == joint.follows), 3.0)
    ElementTree.SubElement(
        element,
        "limit",
        lower=f"{lower:g}",
        upper=f"{upper:g}",
        velocity=f"{velocity:g}",
        effort=f"{EFFORT[joint.kind]:g}",
    )
    if joint.follows is not None and joint.follows != joint.name:
        ElementTree.SubElement(element, "mimic", joint=joint.follows, multiplier=f"{joint.sign:g}")


def _link(
    robot: ElementTree.Element, name: str, mass: float, size: Triple, centre: Triple
) -> ElementTree.Element:
    """Add a link with the inertia of a box: without one, Bullet gives it a mass of 1 kg."""
    link = ElementTree.SubElement(robot, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(centre))
    ElementTree.SubElement(inertial, "mass", value=f"{mass:g}")
    x, y, z = (side**2 for side in size)
    moments = {"ixx": y + z, "iyy": x + z, "izz": x + y}
    values = {key: f"{max(mass / 12 * value, 1e-7):g}" for key, value in moments.items()}
    ElementTree.SubElement(inertial, "inertia", {**values, "ixy": "0", "ixz": "0", "iyz": "0"})
    return link


def _box(
    link: ElementTree.Element,
    colour: str,
    size: Triple,
    centre: Triple,
    *,
    rotation: Rotation3 | None = None,
    solid: bool = True,
) -> None:
    shape = ElementTree.Element("box", size=_numbers(size))
    _add_shape(link, shape, colour, centre=np.array(centre, float), rotation=rotation, solid=solid)


def _bar(
    link: ElementTree.Element,
    colour: str,
    start: Triple,
    end: Triple,
    *,
    section: tuple[float, float],
) -> None:
    """Add a box that runs from `start` to `end`."""
    middle, rotation, length = _between(start, end)
    _box(link, colour, (*section, length), _triple(middle), rotation=rotation)


def _rod(link: ElementTree.Element, colour: str, start: Triple, end: Triple, radius: float) -> None:
    """Add a cylinder that runs from `start` to `end`."""
    middle, rotation, length = _between(start, end)
    shape = ElementTree.Element("cylinder", radius=f"{radius:g}", length=f"{length:.9g}")
    _add_shape(link, shape, colour, centre=middle, rotation=rotation, solid=True)


def _add_shape(
    link: ElementTree.Element,
    shape: ElementTree.Element,
    colour: str,
    *,
    centre: Point,
    rotation: Rotation3 | None,
    solid: bool,
) -> None:
    for use in ("visual", "collision") if solid else ("visual",):
        element = ElementTree.SubElement(link, use)
        _add_origin(element, centre, np.eye(3) if rotation is None else rotation)
        ElementTree.SubElement(element, "geometry").append(shape)
        if use == "visual":
            ElementTree.SubElement(element, "material", name=colour)


def _between(start: Triple, end: Triple) -> tuple[Point, Rotation3, float]:
    """Return the middle, a rotation whose z runs along, and the length of a segment."""
    a, b = np.array(start, float), np.array(end, float)
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length
    aside = np.array([0.0, 0.0, 1.0]) if abs(z[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    y = np.cross(z, aside)
    y /= np.linalg.norm(y)
    return (a + b) / 2, np.column_stack([np.cross(y, z), y, z]), length


def _add_origin(element: ElementTree.Element, translation: Point, rotation: Rotation3) -> None:
    # Most joints here turn by 90 degrees about y, where roll and yaw are one: setting the yaw to
    # zero, as scipy does, is right and is announced by a warning that tells nothing.
    angles = Rotation.from_matrix(rotation).as_euler("xyz", suppress_warnings=True)
    ElementTree.SubElement(element, "origin", xyz=_numbers(translation), rpy=_numbers(angles))


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{float(value) + 0.0:.12g}" for value in values)


def _triple(vector: Point) -> Triple:
    return (float(vector[0]), float(vector[1]), float(vector[2]))

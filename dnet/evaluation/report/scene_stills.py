"""Pictures of runs: the deformed object, the instruments, the goal as sparse red points."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float64
from matplotlib import rc_context
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from dnet.evaluation.report.palette import CLAY, FAINT, INK, KNOWN, SKY
from dnet.evaluation.report.snapshot import Snapshot, Triangles
from dnet.evaluation.report.still_plots import png_of
from dnet.types import Cloud, Nodes, Point

SPARSE = 250
"""Points of a goal that are drawn: clouds are in farthest-point order, so that any beginning of
one is even."""
NEAR = ((-0.09, 0.14), (-0.10, 0.10), (0.0, 0.13))
"""What a picture of an object shows, along x, y and z in metres."""
FAR = ((-0.26, 0.26), (-0.16, 0.16), (0.0, 0.32))
"""The same with the arms."""
_LIGHT = np.array([0.3, -0.6, 0.75])

Limits = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


def draw_sequence(shots: Sequence[Snapshot], goal: Cloud, distances_mm: Sequence[float]) -> bytes:
    """Return instants of one run beside each other, each with its distance to the goal."""
    figure = Figure(figsize=(3.0 * len(shots), 2.5), layout="constrained")
    for place, (shot, distance) in enumerate(zip(shots, distances_mm, strict=True), start=1):
        axes = _axes(figure, (1, len(shots), place), NEAR)
        axes.set_title(f"{shot.time:.1f} s, {distance:.1f} mm", fontsize=9, color=INK, y=0.97)
        _draw_surface(axes, shot.nodes, shot.triangles)
        _draw_instruments(axes, shot, NEAR)
        _draw_points(axes, goal[:SPARSE])
    return _png(figure)


def draw_setup(shot: Snapshot) -> bytes:
    """Return both instruments and the object."""
    figure = Figure(figsize=(6.0, 4.4), layout="constrained")
    axes = _axes(figure, (1, 1, 1), FAR)
    _draw_surface(axes, shot.nodes, shot.triangles)
    _draw_instruments(axes, shot, FAR)
    return _png(figure)


def draw_result(
    *, initial: Snapshot, goal: Cloud, ends: Sequence[tuple[str, Snapshot, Point]], truth: Point
) -> bytes:
    """Return a row of figure 3: initial and goal shape, manipulation points, and the results.

    Args:
        initial: Of the object at rest.
        goal: The shape to reach.
        ends: Of each method its name, the end of its run, and the point that it chose.
        truth: The point at which the goal was made.
    """
    count = 2 + 2 * len(ends)
    figure = Figure(figsize=(2.5 * count, 2.3), layout="constrained")
    titles = [
        "initial",
        "goal",
        *(f"point, {name}" for name, _, _ in ends),
        *(f"result, {name}" for name, _, _ in ends),
    ]
    fields = [_axes(figure, (1, count, place), NEAR) for place in range(1, count + 1)]
    for axes, title in zip(fields, titles, strict=True):
        axes.set_title(title, fontsize=9, color=INK, y=0.97)
    _draw_surface(fields[0], initial.nodes, initial.triangles)
    _draw_points(fields[1], goal)
    for turn, (_, end, chosen) in enumerate(ends):
        axes = fields[2 + turn]
        _draw_surface(axes, initial.nodes, initial.triangles, alpha=0.35)
        _mark(axes, truth, KNOWN["true point"].colour)
        _mark(axes, chosen, KNOWN["chosen point"].colour)
        axes = fields[2 + len(ends) + turn]
        _draw_surface(axes, end.nodes, end.triangles)
        _draw_points(axes, goal[:SPARSE])
    return _png(figure)


def draw_importance(goal: Cloud, ends: Sequence[tuple[str, Snapshot, Snapshot, Point]]) -> bytes:
    """Return figure 2: the goal, and of each point where it is and what came of it.

    Args:
        goal: The shape to reach.
        ends: Of each point a name, the object at rest, the end of the run, and the point.
    """
    count = 1 + 2 * len(ends)
    figure = Figure(figsize=(2.7 * count, 2.5), layout="constrained")
    fields = [_axes(figure, (1, count, place), NEAR) for place in range(1, count + 1)]
    fields[0].set_title("goal", fontsize=9, color=INK, y=0.97)
    _draw_points(fields[0], goal)
    colours = (CLAY, "#7a4fa3")  # The paper's: red for the good point, purple for the bad one.
    for turn, (name, initial, end, point) in enumerate(ends):
        before, after = fields[1 + 2 * turn], fields[2 + 2 * turn]
        before.set_title(f"{name} point", fontsize=9, color=INK, y=0.97)
        after.set_title(f"result, {name} point", fontsize=9, color=INK, y=0.97)
        _draw_surface(before, initial.nodes, initial.triangles, alpha=0.35)
        _mark(before, point, colours[turn % len(colours)])
        _draw_surface(after, end.nodes, end.triangles)
        _draw_points(after, goal[:SPARSE])
    return _png(figure)


def _axes(figure: Figure, place: tuple[int, int, int], limits: Limits) -> Axes3D:
    axes = figure.add_subplot(*place, projection="3d", computed_zorder=False)
    if not isinstance(axes, Axes3D):
        raise TypeError(axes)
    axes.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    sides = tuple(high - low for low, high in limits)
    axes.set_box_aspect(sides, zoom=1.45)  # pyright: ignore[reportArgumentType]
    axes.view_init(elev=32, azim=-65)
    axes.set_axis_off()
    return axes


def _draw_surface(
    axes: Axes3D, nodes: Nodes, triangles: Triangles, *, alpha: int | float = 1.0
) -> None:
    if not len(triangles):
        return
    corners = nodes[triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    light = 0.62 + 0.38 * np.clip(normals @ _LIGHT, 0.0, 1.0)
    base = np.array([int(SKY[place : place + 2], 16) / 255 for place in (1, 3, 5)])
    colours = np.concatenate([light[:, None] * base, np.full((len(light), 1), alpha)], axis=1)
    surface = Poly3DCollection(list(corners), facecolors=colours, edgecolors="none", zorder=1)
    axes.add_collection3d(surface)


def _draw_instruments(axes: Axes3D, shot: Snapshot, limits: Limits) -> None:
    for instrument in shot.instruments:
        shaft = _inside(instrument, limits)
        axes.plot(*shaft.T, color=FAINT, linewidth=2.2, solid_capstyle="round", zorder=3)
        axes.plot(*instrument[-3:].T, color=INK, linewidth=2.6, zorder=4)


def _inside(path: Float64[np.ndarray, "n 3"], limits: Limits) -> Float64[np.ndarray, "m 3"]:
    """Return the end of a path that is in the picture: nothing is cut off at its edge."""
    pieces = [np.linspace(a, b, 100) for a, b in pairwise(path)]
    fine = np.concatenate([*pieces, path[-1:]])
    low, high = np.array(limits).T
    outside = np.flatnonzero(((fine < low) | (fine > high)).any(axis=1))
    first = int(outside[-1]) + 1 if len(outside) else 0
    return fine[min(first, len(fine) - 2) :]


def _draw_points(axes: Axes3D, cloud: Cloud) -> None:
    size = 6 if len(cloud) <= SPARSE else 2
    axes.scatter(*cloud.T, s=size, c=CLAY, depthshade=False, linewidths=0, zorder=2)


def _mark(axes: Axes3D, point: Point, colour: str) -> None:
    axes.scatter(*point[:, None], s=60, c=colour, depthshade=False, zorder=5)


def _png(figure: Figure) -> bytes:
    with rc_context({"text.parse_math": False}):
        return png_of(figure, dpi=90)

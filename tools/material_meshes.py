"""How fine a mesh has to be: the same pulls of meshes of several resolutions, and what they cost.

The independent solver settles every mesh for the same manipulation points and displacements. Each
shape is compared with that of the finest mesh, at the finest mesh's nodes.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float64

from dnet.sim.grasp import JAW_RADIUS
from dnet.sim.quasistatic import QuasistaticSolver
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.sim.soft_body import NodeIndices
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices
from dnet.sim.tissue import held_nodes, tissue_mesh
from dnet.tools.material_pulls import pulls
from dnet.types import Point, Tissue

Cells = tuple[int, int, int]
Grip = Callable[[Vertices], tuple[NodeIndices, NodeIndices]]
"""Says which nodes of a mesh at rest are held, and which are pulled."""

FINEST: Cells = (20, 20, 8)
CANDIDATES: tuple[Cells, ...] = (
    (6, 6, 2),
    (8, 8, 3),
    (9, 9, 3),
    (8, 8, 4),
    (10, 8, 3),
    (10, 10, 3),
    (10, 8, 4),
    (9, 9, 4),
    (10, 10, 4),
    (12, 12, 4),
    (16, 16, 6),
)
LEAST_THICKNESS = 4
"""Cells through the thickness that a mesh needs: with fewer, bending is too stiff by a fifth."""
MOST_NODES = 450
"""A budget for time, not a law, and set after the figures were seen: 500 would choose 9 x 9 x 4."""
CHUNKS = 50
"""Parts in which points are looked up: all at once would take a gigabyte."""
TIMED = 3
"""Pulls in PyBullet by which a mesh's cost is told."""


@dataclass(frozen=True, slots=True)
class Resolution:
    """A mesh, how near its shapes are to the finest mesh's, and what they cost in PyBullet."""

    cells: Cells
    nodes: int
    pull_mm: float
    """Mean distance to the finest mesh over all nodes and pulls, with the grips of a recording:
    the nodes that the mesh has in the jaws."""
    pull_95_mm: float
    """Mean node distance that 95 % of the pulls stay below."""
    face_mm: float
    """Mean distance where one whole end face is pulled and the other is held: as all meshes
    share these faces, the error is that of the elements alone."""
    step_ms: float
    """Processor time of a simulation step in milliseconds."""
    shape_seconds: float
    """Processor time of a settled shape."""


def compare_meshes(
    tissue: Tissue,
    shapes: int,
    *,
    candidates: tuple[Cells, ...] = CANDIDATES,
    finest: Cells = FINEST,
    seed: int,
    advance: Callable[[], object] = lambda: None,
) -> list[Resolution]:
    """Pull meshes of one box alike, compare them with the finest, and time them in PyBullet.

    Args:
        tissue: The box; its own cells don't matter.
        shapes: How many pulls.
        candidates: Cells of the meshes along each axis.
        finest: Cells of the mesh that the others are compared with.
        seed: Of manipulation points and displacements.
        advance: Called after each pull of all meshes, and after each mesh's timing.

    Raises:
        NoValidShape: If too many draws in a row are rejected while a mesh is timed.
    """
    errors = _errors(tissue, shapes, (*candidates, finest), seed=seed, advance=advance)
    resolutions = []
    for cells, (pull, face) in zip(candidates, errors, strict=True):
        meshed = replace(tissue, cells=cells)
        timed = list(pulls(meshed, TIMED, seed=seed, rejected=Counter()))
        seconds = sum(pull.seconds for pull in timed)
        resolutions.append(
            Resolution(
                cells=cells,
                nodes=len(tissue_mesh(meshed).nodes),
                pull_mm=float(pull.mean()),
                pull_95_mm=float(np.quantile(pull, 0.95)),
                face_mm=float(face.mean()),
                step_ms=1e3 * seconds / sum(pull.steps for pull in timed),
                shape_seconds=seconds / TIMED,
            )
        )
        advance()
    return resolutions


def choose(resolutions: list[Resolution]) -> Resolution:
    """Return the nearest to the finest mesh of those that bend well enough and are affordable."""
    eligible = [
        resolution
        for resolution in resolutions
        if resolution.cells[2] >= LEAST_THICKNESS and resolution.nodes <= MOST_NODES
    ]
    return min(eligible, key=lambda resolution: resolution.pull_mm)


def _errors(
    tissue: Tissue,
    shapes: int,
    every_cells: tuple[Cells, ...],
    *,
    seed: int,
    advance: Callable[[], object],
) -> Float64[np.ndarray, "meshes kinds shapes"]:
    """Return the mean distance in millimetres of all meshes but the last from the last.

    The kinds are pulls by the jaws and pulls of the end face.
    """
    tissues = [replace(tissue, cells=cells) for cells in every_cells]
    meshes = [tissue_mesh(meshed) for meshed in tissues]
    solvers = [QuasistaticSolver(m, young=tissue.young, poisson=tissue.poisson) for m in meshes]
    points = meshes[-1].nodes
    samples = [sampler(mesh, points) for mesh in meshes]
    random = np.random.default_rng(seed)
    workspace = Workspace(position=0.0, yaw=0.0)
    errors = np.empty((len(meshes) - 1, 2, shapes))
    for shape in range(shapes):
        point = np.array(draw_scene(workspace, tissues[-1], random).manipulation_point)
        displacement = draw_displacement(workspace, random)
        grips: tuple[Grip, Grip] = (partial(_by_the_jaws, point=point), _by_the_end_face)
        for kind, grip in enumerate(grips):
            settled = []
            for mesh, solver, sample in zip(meshes, solvers, samples, strict=True):
                held, moved = grip(mesh.nodes)
                solver.hold(np.concatenate([held, moved]))
                targets = np.concatenate([mesh.nodes[held], mesh.nodes[moved] + displacement])
                settled.append(sample(solver.settle(mesh.nodes, targets).nodes))
            distances = np.linalg.norm(np.array(settled[:-1]) - settled[-1], axis=2)
            errors[:, kind, shape] = 1e3 * distances.mean(axis=1)
        advance()
    return errors


def _by_the_jaws(rest: Vertices, *, point: Point) -> tuple[NodeIndices, NodeIndices]:
    """Return what the holding and the moving arm of a recording have between their jaws."""
    held = held_nodes(rest)
    gripped = np.flatnonzero(np.linalg.norm(rest - point, axis=1) < JAW_RADIUS)
    return held, np.setdiff1d(gripped, held)


def _by_the_end_face(rest: Vertices) -> tuple[NodeIndices, NodeIndices]:
    x = rest[:, 0]
    return np.flatnonzero(x == x.min()), np.flatnonzero(x == x.max())


def sampler(mesh: TetrahedralMesh, points: Vertices) -> Callable[[Vertices], Vertices]:
    """Return what tells where points within a mesh at rest are when its nodes are elsewhere."""
    if points is mesh.nodes:
        return lambda nodes: nodes
    # A point's shares in the corners of a tetrahedron: their mean weighted so is the point.
    homogeneous = np.ones((len(mesh.tetrahedra), 4, 4))
    homogeneous[:, :3] = mesh.nodes[mesh.tetrahedra].transpose(0, 2, 1)
    inverse = np.linalg.inv(homogeneous).reshape(-1, 4)
    corners, weights = [], []
    for some in np.array_split(np.column_stack([points, np.ones(len(points))]), CHUNKS):
        shares = (inverse @ some.T).reshape(-1, 4, len(some))
        # The tetrahedron that a point lies in is the one in which no corner's share is negative.
        inside = shares.min(axis=1).argmax(axis=0)
        corners.append(mesh.tetrahedra[inside])
        weights.append(shares[inside, :, np.arange(len(some))])
    corner, weight = np.concatenate(corners), np.concatenate(weights)
    return lambda nodes: np.einsum("pk,pkd->pd", weight, nodes[corner])

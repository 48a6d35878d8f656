"""Scenes stay within the workspace, and grasp a point that the moving arm can reach."""

from typing import get_args

import numpy as np
import pytest

from dnet.errors import NoReachableSurface
from dnet.geometry.pose import rotation_z
from dnet.sim.arms import Placement
from dnet.sim.grasp import grasp
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.sim.tetrahedra import Vertices
from dnet.sim.tissue import hold_point, tissue_mesh
from dnet.sim.tissue_families import TissueFamily
from dnet.types import Point, Scene, Tissue, TissueShape

SHAPES = get_args(TissueShape)
WORKSPACE = Workspace()


def scenes_of(shape: TissueShape, count: int) -> list[Scene]:
    random = np.random.default_rng(5)
    family = TissueFamily(shape, vary=True)
    return [draw_scene(WORKSPACE, family.draw(random), random) for _ in range(count)]


def in_its_own_frame(point: tuple[float, float, float], scene: Scene) -> Point:
    return rotation_z(scene.yaw).T @ (np.array(point) - [*scene.position, 0.0])


def barycentric(point: Point, triangles: Vertices) -> Vertices:
    """Weights of a point's corners in each of (n, 3, 3) triangles and how far off the plane."""
    first = triangles[:, 0]
    along, across = triangles[:, 1] - first, triangles[:, 2] - first
    normal = np.cross(along, across)
    frames = np.stack([along, across, normal / np.linalg.norm(normal, axis=1)[:, None]], axis=2)
    return np.linalg.solve(frames, (point - first)[:, :, None])[:, :, 0]


@pytest.mark.parametrize("shape", SHAPES)
def test_objects_are_laid_down_and_held_within_the_workspace(shape: TissueShape) -> None:
    for scene in scenes_of(shape, 60):
        assert abs(scene.yaw) <= WORKSPACE.yaw
        assert np.all(np.abs(scene.position) <= WORKSPACE.position)
        hold = in_its_own_frame(scene.hold, scene)
        np.testing.assert_allclose(hold, hold_point(scene.tissue), atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_manipulation_points_are_on_the_surface_that_the_moving_arm_reaches(
    shape: TissueShape,
) -> None:
    for scene in scenes_of(shape, 60):
        point = in_its_own_frame(scene.manipulation_point, scene)
        mesh = tissue_mesh(scene.tissue)
        triangles = mesh.nodes[mesh.surface()]
        u, v, height = barycentric(point, triangles).T
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (np.abs(height) < 1e-9)
        assert inside.any()
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        facing = normals[inside] @ rotation_z(scene.yaw).T @ np.array(WORKSPACE.toward)
        assert facing.max() >= WORKSPACE.facing - 1e-9
        assert point[0] >= mesh.nodes[:, 0].min() + WORKSPACE.clearance - 1e-12


@pytest.mark.parametrize("shape", SHAPES)
def test_both_arms_reach_the_object_and_close_on_it(shape: TissueShape) -> None:
    for scene in scenes_of(shape, 200):
        found = grasp(scene, Placement())
        assert len(found.gripped) > 0
        assert len(found.held) >= 5


def test_points_are_spread_over_the_surface_by_area() -> None:
    random = np.random.default_rng(0)
    tissue = Tissue()
    scenes = [draw_scene(WORKSPACE, tissue, random) for _ in range(600)]
    points = np.array([in_its_own_frame(s.manipulation_point, s) for s in scenes])
    # The top beyond the clearance is 5 cm by 10 cm, the end face 10 cm by 4 cm.
    on_top = np.isclose(points[:, 2], 0.04)
    assert on_top.mean() == pytest.approx(5 / 9, abs=0.06)
    assert points[:, 1].mean() == pytest.approx(0, abs=0.005)
    assert points[:, 1].std() == pytest.approx(0.1 / np.sqrt(12), rel=0.1)


def test_the_same_draws_give_the_same_scene() -> None:
    one, same = (
        [draw_scene(WORKSPACE, Tissue(), random) for _ in range(3)]
        for random in (np.random.default_rng(1), np.random.default_rng(1))
    )
    assert one == same
    assert len({scene.manipulation_point for scene in one}) == 3


def test_displacements_fill_the_workspace() -> None:
    random = np.random.default_rng(0)
    low, high = np.array(WORKSPACE.displacement_low), np.array(WORKSPACE.displacement_high)
    drawn = np.array([draw_displacement(WORKSPACE, random) for _ in range(500)])
    assert np.all((drawn >= low) & (drawn <= high))
    np.testing.assert_allclose(np.ptp(drawn, axis=0), high - low, rtol=0.03)


def test_an_object_shorter_than_the_clearance_is_refused() -> None:
    with pytest.raises(NoReachableSurface, match="40 x 100 x 40 mm"):
        draw_scene(WORKSPACE, Tissue(size=(0.04, 0.1, 0.04)), np.random.default_rng(0))

"""The world without inertia: the object is in equilibrium wherever the arms are."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from dnet.geometry.camera import Camera, DepthImage
from dnet.geometry.pose import inverse
from dnet.sim.arms import HOME, Placement
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_blocks import add_picture
from dnet.sim.bullet_eyes import depth_image
from dnet.sim.foresight import Foresight
from dnet.sim.furniture import TABLE
from dnet.sim.grasp import JAW_RADIUS, Grasp, at, grasp, slip
from dnet.sim.quasistatic import QuasistaticSolver
from dnet.sim.soft_picture import SoftPicture
from dnet.sim.tetrahedra import Vertices
from dnet.sim.world import Settling
from dnet.types import JointPath, Joints, Nodes, Point, Pose, Scene

STRIDE = 0.04
"""Between two equilibria on the way, in seconds: 8 mm at the speed of a planned motion."""


class QuasistaticWorld:
    """A `World` whose object is at rest at every instant, as if the arms moved very slowly.

    The shapes are those to which `BulletWorld` settles, found directly and many times faster.
    Bullet draws what the camera sees, and moves nothing.
    """

    _grasp: Grasp
    """What the arms hold, since the last reset."""
    _solver: QuasistaticSolver

    def __init__(
        self,
        *,
        placement: Placement | None = None,
        camera: Camera | None = None,
        jaw_radius: float = JAW_RADIUS,
    ) -> None:
        """Start a Bullet server of its own in this process.

        Args:
            placement: Where the arms stand.
            camera: The depth camera.
            jaw_radius: Nodes this near to the tip are between the jaws, in metres.
        """
        self._placement = placement or Placement()
        self._camera = camera or Camera()
        self._jaw_radius = jaw_radius
        self._client = start_server()
        self._time = 0.0
        self._joints = (HOME, HOME)
        self.object_id = -1

    def close(self) -> None:
        """Stop the server."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def reset(self, scene: Scene) -> None:
        """Set the object down at rest, held and grasped as the scene says.

        Raises:
            Unreachable: If an arm cannot reach its point.
            EmptyGrasp: If no node is within the jaws' radius of the manipulation point.
        """
        start = grasp(scene, self._placement, jaw_radius=self._jaw_radius)
        self._scene = scene

        client = self._client
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
        self._picture = SoftPicture(client, start.mesh)
        self.object_id = self._picture.body
        self._arms = BulletArms(client, self._placement)
        self._arms.touch_nothing()
        add_picture(TABLE, client)
        self._time = 0.0
        self._take(start)

    def restore(self) -> None:
        """Put the object back at rest and the arms where they grasped it; the clock goes on."""
        self._joints = self._grasp.joints
        rest = self._grasp.rest
        self._iterations = 0
        self._found = self._solver.settle(rest, rest[self._grasp.pinned])

    def release(self) -> None:
        """Open the moving arm's jaws: the object is held by the other arm alone."""
        rest = self._grasp.rest
        self._grasp = replace(self._grasp, gripped=self._grasp.gripped[:0])
        self._solver.hold(self._grasp.pinned)
        self._found = self._solver.settle(rest, rest[self._grasp.pinned])

    def regrasp(self, point: Point) -> None:
        """Close the moving arm's jaws at a point of the object, at rest, as `reset` does.

        The clock goes on.

        Raises:
            Unreachable: If the arm cannot reach the point.
            EmptyGrasp: If no node is within the jaws' radius of it.
        """
        scene = at(self._scene, point)
        self._take(grasp(scene, self._placement, jaw_radius=self._jaw_radius))

    def slip(self) -> float:
        """Return how far what the moving arm grasped is from between its jaws, in metres."""
        nodes = self._found.nodes
        return slip(self._grasp, self._placement, nodes=nodes, joints=self._joints[1])

    @property
    def time(self) -> float:
        """Seconds of simulation since the reset."""
        return self._time

    @property
    def joints(self) -> tuple[Joints, Joints]:
        """Joint positions of the holding and the moving arm."""
        return self._joints

    @property
    def tip(self) -> Point:
        """Where the moving arm's jaws meet, in the world."""
        return self._jaws(self._joints[1])[:3, 3].copy()

    def nodes(self) -> Nodes:
        """Return the mesh nodes, in metres, (n, 3)."""
        return self._found.nodes.astype(np.float32)

    def follow(self, path: JointPath, times: Float64[np.ndarray, "_"]) -> None:
        """Drive the moving arm along a timed joint path; what it grasps goes with it.

        Args:
            path: Joint positions, (n, 6); the first should be where the arm stands.
            times: When to be at each, in seconds from now, increasing from 0, (n,).
        """
        count = max(1, int(np.ceil(times[-1] / STRIDE)))
        instants = np.linspace(0.0, times[-1], count + 1)[1:]
        columns = [np.interp(instants, times, path[:, k]) for k in range(path.shape[1])]
        way = np.array([self._pinned_at(joints) for joints in np.column_stack(columns)])
        self._found = self._solver.follow(self._found.nodes, way)
        self._iterations += self._found.iterations
        self._joints = (self._joints[0], path[-1].copy())
        self._time += float(times[-1])

    def settle(self) -> Settling:
        """Say how the object came to rest, which it did at once; a step is an iteration."""
        steps, self._iterations = self._iterations, 0
        ratio = float(self._grasp.mesh.volume_ratios(self._found.nodes).min())
        return Settling(settled=self._found.converged, steps=steps, least_volume_ratio=ratio)

    def foresee(self, displacement: Point) -> float:
        """Return the least volume ratio that a displacement from rest leads to."""
        return self._foresight.least_volume_ratio(displacement)

    def borne(self, motion: Point) -> float:
        """Return how much of a straight motion of the tip the object bears, as a share."""
        if not len(self._grasp.gripped):
            return 1.0
        return self._foresight.borne(self._found.nodes, motion)

    def deviation(self) -> float:
        """Return how far the worst node is from where the grasp takes it straight from rest."""
        return self._foresight.deviation(self._found.nodes)

    def look(self) -> DepthImage:
        """Return what the depth camera sees, drawn by Bullet's software renderer."""
        self._picture.show(self._found.nodes)
        self._arms.show(self._joints)
        return depth_image(self._camera, self._client)

    def _take(self, start: Grasp) -> None:
        self._grasp = start
        self._foresight = Foresight(start, self._scene.tissue)
        self._solver = self._foresight.solver
        self.restore()

    def _jaws(self, joints: Joints) -> Pose:
        return self._placement.arms[1].forward(joints)

    def _pinned_at(self, joints: Joints) -> Vertices:
        """Return where the gripped nodes are, those of the holding arm first."""
        rest = self._grasp.rest
        moved = self._jaws(joints) @ inverse(self._jaws(self._grasp.joints[1]))
        gripped = rest[self._grasp.gripped] @ moved[:3, :3].T + moved[:3, 3]
        return np.concatenate([rest[self._grasp.held], gripped])

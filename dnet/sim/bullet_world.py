"""The world in PyBullet: two kinematic arms, a soft box, a depth camera."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64

from dnet.errors import EmptyGrasp
from dnet.geometry.camera import Camera, DepthImage
from dnet.geometry.pose import inverse, rotation_z
from dnet.sim.arms import HOME, Placement
from dnet.sim.bullet import pybullet
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_blocks import add_picture
from dnet.sim.furniture import TABLE
from dnet.sim.scenes import SoftBox
from dnet.sim.soft_body import SoftBody
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices, box_mesh
from dnet.sim.world import Settling
from dnet.types import JointPath, Joints, Nodes, Point, Pose, Scene


@dataclass(frozen=True)
class BulletSettings:
    """Everything that shapes the world; the defaults are the paper's soft box."""

    box: SoftBox = field(default_factory=SoftBox)
    placement: Placement = field(default_factory=Placement)
    camera: Camera = field(default_factory=Camera)
    jaw_radius: float = 0.016
    """Nodes this near to the tip are between the jaws, in metres."""
    courant: float = 0.7
    """Time step as a share of cell size over 1 m/s; the body becomes unstable above 1.2."""
    block: int = 20
    """Steps between two looks at whether the body has come to rest."""
    tolerance: float = 1e-4
    """The body rests when no node moves farther than this in a block, in metres."""
    patience: int = 2000
    """Steps after which settling is given up."""

    @property
    def time_step(self) -> float:
        """Seconds a simulation step."""
        cell = min(s / n for s, n in zip(self.box.size, self.box.cells, strict=True))
        return self.courant * cell / 1.0


class BulletWorld:
    """A `World` in PyBullet, without gravity, as the paper's simulation.

    The arms are kinematic: they are exactly where the path says, and the nodes between the jaws
    move rigidly with the tool. The nodes of the end face that the holding arm grips stay put.
    Every reset starts a new simulation, so an episode does not depend on those before it.
    """

    def __init__(self, settings: BulletSettings | None = None) -> None:
        """Start a Bullet server of its own in this process."""
        self.settings = settings or BulletSettings()
        self.mesh: TetrahedralMesh = box_mesh(self.settings.box.size, self.settings.box.cells)
        self._client: int = pybullet.connect(pybullet.DIRECT)
        self._time = 0.0
        self._joints = (HOME, HOME)
        self._jaws: Pose = self.settings.placement.arms[1].forward(HOME)
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
        place = self.settings.placement
        hold = place.joints_at(0, np.array(scene.hold))
        grasp = place.joints_at(1, np.array(scene.manipulation_point))
        nodes = _posed(self.mesh.nodes, scene, self.settings.box.size[2])
        gripped = _near(nodes, np.array(scene.manipulation_point), self.settings.jaw_radius)
        if not len(gripped):
            distance = float(np.linalg.norm(nodes - scene.manipulation_point, axis=1).min())
            raise EmptyGrasp(scene.manipulation_point, distance, self.settings.jaw_radius)

        client = self._client
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
        pybullet.setGravity(0, 0, 0, physicsClientId=client)
        pybullet.setTimeStep(self.settings.time_step, physicsClientId=client)
        # Bullet's grid for contact between soft bodies: none is in use, so coarse is cheap.
        pybullet.setPhysicsEngineParameter(sparseSdfVoxelSize=0.25, physicsClientId=client)
        self._body = SoftBody(
            client,
            self.mesh,
            young=self.settings.box.young,
            poisson=self.settings.box.poisson,
            density=self.settings.box.density,
        )
        self.object_id = self._body.body
        self._rest = nodes
        self._held = np.flatnonzero(self.mesh.nodes[:, 0] <= self.mesh.nodes[:, 0].min() + 1e-9)
        self._gripped = np.setdiff1d(gripped, self._held)
        self._arms = BulletArms(client, place)
        self._arms.touch_nothing()
        add_picture(TABLE, client)
        self._grasped = (hold, grasp)
        self._time = 0.0
        self.restore()

    def restore(self) -> None:
        """Put the object back at rest and the arms where they grasped it; the clock goes on."""
        every = np.arange(len(self._rest))
        self._body.release()
        self._body.place(every, self._rest)
        # Stopping takes a step, in which the nodes still drift at the speed they had.
        self._body.stop()
        self._body.place(every, self._rest)
        self._body.pin(self._held)
        self._body.pin(self._gripped)
        self._joints = self._grasped
        self._jaws = self.settings.placement.arms[1].forward(self._grasped[1])

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
        return self._jaws[:3, 3].copy()

    def nodes(self) -> Nodes:
        """Return the mesh nodes, in metres, (n, 3)."""
        return self._body.nodes().astype(np.float32)

    def follow(self, path: JointPath, times: Float64[np.ndarray, "_"]) -> None:
        """Drive the moving arm along a timed joint path; what it grasps goes with it.

        Args:
            path: Joint positions, (n, 6); the first should be where the arm stands.
            times: When to be at each, in seconds from now, increasing from 0, (n,).
        """
        count = int(np.ceil(times[-1] / self.settings.time_step))
        instants = np.minimum(np.arange(1, count + 1) * self.settings.time_step, times[-1])
        columns = [np.interp(instants, times, path[:, k]) for k in range(path.shape[1])]
        arm = self.settings.placement.arms[1]
        for joints in np.column_stack(columns):
            jaws = arm.forward(joints)
            moved = jaws @ inverse(self._jaws)
            where = self._body.nodes()[self._gripped] @ moved[:3, :3].T + moved[:3, 3]
            self._body.place(self._gripped, where)
            self._jaws = jaws
            self._step()
        self._joints = (self._joints[0], path[-1].copy())

    def settle(self) -> Settling:
        """Let the object come to rest with the arms still.

        Blocks of steps, each from a standstill, until one moves no node farther than the
        tolerance: what is left then is a few hundredths of a millimetre.
        """
        before = self._body.nodes()
        steps, settled = 0, False
        while not settled and steps < self.settings.patience:
            for _ in range(self.settings.block):
                self._step()
            after = self._body.nodes()
            self._body.stop()
            self._time += self.settings.time_step
            steps += self.settings.block + 1
            moved = float(np.abs(after - before).max())
            settled = moved < self.settings.tolerance
            before = after
            if not np.isfinite(moved):
                return Settling(settled=False, steps=steps, least_volume_ratio=float("nan"))
        ratio = float(self.mesh.volume_ratios(before).min())
        return Settling(settled=settled, steps=steps, least_volume_ratio=ratio)

    def look(self) -> DepthImage:
        """Return what the depth camera sees, drawn by Bullet's software renderer."""
        self._arms.show(self._joints)
        camera = self.settings.camera
        _, _, _, buffer, mask = pybullet.getCameraImage(
            camera.width,
            camera.height,
            viewMatrix=_view_matrix(camera),
            projectionMatrix=pybullet.computeProjectionMatrixFOV(
                fov=float(np.degrees(camera.field_of_view)),
                aspect=camera.width / camera.height,
                nearVal=camera.near,
                farVal=camera.far,
            ),
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        shape = (camera.height, camera.width)
        stored = np.asarray(buffer, dtype=np.float64).reshape(shape)
        near, far = camera.near, camera.far
        depth = far * near / (far - (far - near) * stored)
        return DepthImage(
            depth.astype(np.float32), np.asarray(mask, dtype=np.int32).reshape(shape), camera
        )

    def _step(self) -> None:
        pybullet.stepSimulation(physicsClientId=self._client)
        self._time += self.settings.time_step


def _posed(nodes: Vertices, scene: Scene, height: float) -> Vertices:
    """Return the rest shape as it lies on the table."""
    offset = np.array([*scene.position, height / 2])
    return nodes @ rotation_z(scene.yaw).T + offset


def _near(nodes: Vertices, point: Point, radius: float) -> Int64[np.ndarray, "_"]:
    return np.flatnonzero(np.linalg.norm(nodes - point, axis=1) < radius)


def _view_matrix(camera: Camera) -> list[float]:
    """Return OpenGL's view matrix, column by column: it looks along -z with y up."""
    optical_to_gl = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix: list[float] = (optical_to_gl @ inverse(camera.pose)).T.ravel().tolist()
    return matrix

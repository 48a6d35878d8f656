"""The world in PyBullet: two arms, a soft object, a depth camera."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from dnet.geometry.camera import Camera, DepthImage
from dnet.sim.arms import HOME, Placement
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_blocks import add_picture
from dnet.sim.bullet_eyes import depth_image
from dnet.sim.bullet_grip import Drive, Grip
from dnet.sim.foresight import Foresight
from dnet.sim.furniture import TABLE
from dnet.sim.grasp import JAW_RADIUS, Grasp, at, grasp, slip
from dnet.sim.kinematic_grip import KinematicGrip
from dnet.sim.material import wave_speed
from dnet.sim.motor_grip import MotorGrip
from dnet.sim.soft_body import SoftBody
from dnet.sim.tissue import tissue_mesh
from dnet.sim.world import Settling
from dnet.types import JointPath, Joints, Nodes, Point, Scene, Tissue


@dataclass(frozen=True)
class BulletSettings:
    """Everything that shapes the world."""

    placement: Placement = field(default_factory=Placement)
    camera: Camera = field(default_factory=Camera)
    drive: Drive = "kinematic"
    """How the arms hold and grasp. `kinematic`: they are exactly where the path says, and what they
    grip with them. `motor`: position motors drive them along the path within limits of force and
    velocity, and what they grip is anchored to their wrists; slower, to the same shapes."""
    jaw_radius: float = JAW_RADIUS
    """Nodes this near to the tip are between the jaws, in metres."""
    courant: float = 1.25
    """Time step as a multiple of the least altitude of a tetrahedron over the speed of sound in
    the object. At rest the body becomes unstable above 2.3, but stretched far it is stiffer: at
    1.5 some shapes swing for ever."""
    block: int = 18
    """Steps of the usual box between two looks at whether it has come to rest; an object with a
    finer mesh takes as many more as its steps are shorter."""
    tolerance: float = 1e-4
    """The body rests when no node moves farther than this in a block, in metres."""
    patience: int = 600
    """Steps after which settling is given up, likewise."""

    def time_step(self, tissue: Tissue) -> float:
        """Return the seconds that a simulation step of an object may take."""
        altitude = float(tissue_mesh(tissue).least_altitude())
        return self.courant * altitude / wave_speed(tissue.young, tissue.poisson, tissue.density)

    def refinement(self, tissue: Tissue) -> float:
        """Return how many steps of an object last as long as one of the usual box would."""
        return tissue_mesh(Tissue()).least_altitude() / tissue_mesh(tissue).least_altitude()


class BulletWorld:
    """A `World` in PyBullet, without gravity, as the paper's simulation.

    The nodes between the moving arm's jaws go rigidly with them; the holding arm keeps the nodes
    of the end that it grips. Every reset starts a new simulation, so an episode does not depend
    on those before it.
    """

    _start: Grasp
    """What the arms hold, since the last reset."""

    def __init__(self, settings: BulletSettings | None = None) -> None:
        """Start a Bullet server of its own in this process."""
        self.settings = settings or BulletSettings()
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
        start = grasp(scene, self.settings.placement, jaw_radius=self.settings.jaw_radius)
        self._scene, self._rest, self._mesh = scene, start.rest, start.mesh

        client = self._client
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
        pybullet.setGravity(0, 0, 0, physicsClientId=client)
        self._step_time = self.settings.time_step(scene.tissue)
        self._refinement = self.settings.refinement(scene.tissue)
        pybullet.setTimeStep(self._step_time, physicsClientId=client)
        # Bullet's grid for contact between soft bodies: none is in use, so coarse is cheap.
        pybullet.setPhysicsEngineParameter(sparseSdfVoxelSize=0.25, physicsClientId=client)
        self._body = SoftBody(
            client,
            self._mesh,
            young=scene.tissue.young,
            poisson=scene.tissue.poisson,
            density=scene.tissue.density,
        )
        self.object_id = self._body.body
        self._grip = self._new_grip()
        add_picture(TABLE, client)
        self._time = 0.0
        self._take(start)

    def restore(self) -> None:
        """Put the object back at rest and the arms where they grasped it; the clock goes on."""
        every = np.arange(len(self._rest))
        self._grip.release()
        self._body.place(every, self._rest)
        # Stopping takes a step, in which the nodes still drift at the speed they had.
        self._body.stop()
        self._body.place(every, self._rest)
        self._grip.take(self._start.held, self._start.gripped, joints=self._start.joints)
        self._joints = self._grip.joints

    def release(self) -> None:
        """Open the moving arm's jaws: the object is held by the other arm alone."""
        nothing = self._start.gripped[:0]
        self._start = replace(self._start, gripped=nothing)
        self._grip.release()
        self._grip.take(self._start.held, nothing, joints=self._joints)

    def regrasp(self, point: Point) -> None:
        """Close the moving arm's jaws at a point of the object, at rest, as `reset` does.

        The clock goes on.

        Raises:
            Unreachable: If the arm cannot reach the point.
            EmptyGrasp: If no node is within the jaws' radius of it.
        """
        self._take(grasp(at(self._scene, point), self._place, jaw_radius=self.settings.jaw_radius))

    def slip(self) -> float:
        """Return how far what the moving arm grasped is from between its jaws, in metres."""
        nodes = self._body.nodes()
        return slip(self._start, self._place, nodes=nodes, joints=self._joints[1])

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
        return self.settings.placement.arms[1].forward(self._joints[1])[:3, 3].copy()

    def nodes(self) -> Nodes:
        """Return the mesh nodes, in metres, (n, 3)."""
        return self._body.nodes().astype(np.float32)

    def follow(self, path: JointPath, times: Float64[np.ndarray, "_"]) -> None:
        """Drive the moving arm along a timed joint path; what it grasps goes with it.

        Args:
            path: Joint positions, (n, 6); the first should be where the arm stands.
            times: When to be at each, in seconds from now, increasing from 0, (n,).
        """
        count = int(np.ceil(times[-1] / self._step_time))
        instants = np.minimum(np.arange(1, count + 1) * self._step_time, times[-1])
        columns = [np.interp(instants, times, path[:, k]) for k in range(path.shape[1])]
        for joints in np.column_stack(columns):
            self._grip.lead(joints)
            self._step()
        self._joints = self._grip.joints

    def settle(self) -> Settling:
        """Let the arms and the object come to rest.

        Blocks of steps, each from a standstill, until the arms stand still and a block moves no
        node farther than the tolerance: what is left then is a few hundredths of a millimetre.
        """
        before = self._body.nodes()
        steps, settled = 0, False
        block = round(self.settings.block * self._refinement)
        while not settled and steps < self.settings.patience * self._refinement:
            for _ in range(block):
                self._step()
            after, still = self._body.nodes(), self._grip.still
            self._body.stop()
            self._time += self._step_time
            steps += block + 1
            moved = float(np.abs(after - before).max())
            settled = still and moved < self.settings.tolerance
            before = after
            self._joints = self._grip.joints
            if not np.isfinite(moved):
                return Settling(settled=False, steps=steps, least_volume_ratio=float("nan"))
        ratio = float(self._mesh.volume_ratios(before).min())
        return Settling(settled=settled, steps=steps, least_volume_ratio=ratio)

    def foresee(self, displacement: Point) -> float:
        """Return the least volume ratio that a displacement from rest leads to."""
        return self._foresight.least_volume_ratio(displacement)

    def borne(self, motion: Point) -> float:
        """Return how much of a straight motion of the tip the object bears, as a share."""
        if not len(self._start.gripped):
            return 1.0
        return self._foresight.borne(self._body.nodes(), motion)

    def deviation(self) -> float:
        """Return how far the worst node is from where the grasp takes it straight from rest."""
        return self._foresight.deviation(self._body.nodes())

    def look(self) -> DepthImage:
        """Return what the depth camera sees, drawn by Bullet's software renderer."""
        self._grip.show()
        return depth_image(self.settings.camera, self._client)

    @property
    def _place(self) -> Placement:
        return self.settings.placement

    def _take(self, start: Grasp) -> None:
        self._start = start
        self._foresight = Foresight(start, self._scene.tissue)
        self.restore()

    def _new_grip(self) -> Grip:
        place = self._place
        arms = BulletArms(self._client, place)
        arms.touch_nothing()
        if self.settings.drive == "motor":
            return MotorGrip(self._client, self._body, arms)
        return KinematicGrip(self._body, arms, moving=place.arms[1])

    def _step(self) -> None:
        pybullet.stepSimulation(physicsClientId=self._client)
        self._time += self._step_time

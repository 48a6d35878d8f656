"""The calls of PyBullet that dnet makes, and no others; vectors are any sequence of floats."""

from collections.abc import Sequence

import numpy as np

ACTIVATION_STATE_DISABLE_SLEEPING: int
ACTIVATION_STATE_SLEEP: int
DIRECT: int
ER_TINY_RENDERER: int
GEOM_BOX: int
GEOM_CYLINDER: int
MESH_DATA_SIMULATION_MESH: int
POSITION_CONTROL: int
RESET_USE_DEFORMABLE_WORLD: int

def connect(method: int) -> int: ...
def disconnect(physicsClientId: int = 0) -> None: ...
def resetSimulation(flags: int = 0, physicsClientId: int = 0) -> None: ...
def setGravity(gravX: float, gravY: float, gravZ: float, physicsClientId: int = 0) -> None: ...
def setTimeStep(timeStep: float, physicsClientId: int = 0) -> None: ...
def setPhysicsEngineParameter(
    *, enableFileCaching: int = 1, sparseSdfVoxelSize: float = 0.25, physicsClientId: int = 0
) -> None: ...
def stepSimulation(physicsClientId: int = 0) -> None: ...
def loadURDF(
    fileName: str,
    basePosition: Sequence[float] = ...,
    baseOrientation: Sequence[float] = ...,
    *,
    useFixedBase: bool = False,
    physicsClientId: int = 0,
) -> int: ...
def loadSoftBody(
    fileName: str,
    *,
    mass: float = 1.0,
    useNeoHookean: int = 0,
    NeoHookeanMu: float = 1.0,
    NeoHookeanLambda: float = 1.0,
    NeoHookeanDamping: float = 0.1,
    useMassSpring: int = 0,
    springElasticStiffness: float = 1.0,
    springDampingStiffness: float = 0.1,
    springBendingStiffness: float = 0.1,
    collisionMargin: float = 0.02,
    useSelfCollision: int = 0,
    useFaceContact: int = 0,
    repulsionStiffness: float = 0.5,
    physicsClientId: int = 0,
) -> int: ...
def createSoftBodyAnchor(
    softBodyBodyUniqueId: int,
    nodeIndex: int,
    bodyUniqueId: int,
    linkIndex: int,
    *,
    physicsClientId: int = 0,
) -> int: ...
def removeConstraint(userConstraintUniqueId: int, physicsClientId: int = 0) -> None: ...
def changeDynamics(
    bodyUniqueId: int,
    linkIndex: int,
    *,
    mass: float = ...,
    activationState: int = ...,
    localInertiaDiagonal: Sequence[float] = ...,
    physicsClientId: int = 0,
) -> None: ...
def getMeshData(
    bodyUniqueId: int, linkIndex: int = -1, *, flags: int = 0, physicsClientId: int = 0
) -> tuple[int, Sequence[Sequence[float]]]: ...
def resetMeshData(
    bodyUniqueId: int, vertices: Sequence[Sequence[float]], physicsClientId: int = 0
) -> None: ...
def createCollisionShape(
    shapeType: int,
    *,
    halfExtents: Sequence[float] = ...,
    radius: float = 0.5,
    height: float = 1.0,
    physicsClientId: int = 0,
) -> int: ...
def createVisualShape(
    shapeType: int,
    *,
    halfExtents: Sequence[float] = ...,
    rgbaColor: Sequence[float] = ...,
    physicsClientId: int = 0,
) -> int: ...
def createMultiBody(
    baseMass: float = 0.0,
    baseCollisionShapeIndex: int = -1,
    baseVisualShapeIndex: int = -1,
    basePosition: Sequence[float] = ...,
    *,
    physicsClientId: int = 0,
) -> int: ...
def getNumJoints(bodyUniqueId: int, physicsClientId: int = 0) -> int: ...
def getJointInfo(
    bodyUniqueId: int, jointIndex: int, physicsClientId: int = 0
) -> tuple[
    int, bytes, int, int, int, int, float, float, float, float, float, float, bytes,
    int, Sequence[float], Sequence[float], Sequence[float], int,
]: ...  # fmt: skip
def resetJointState(
    bodyUniqueId: int, jointIndex: int, targetValue: float, *, physicsClientId: int = 0
) -> None: ...
def setJointMotorControl2(
    bodyUniqueId: int,
    jointIndex: int,
    controlMode: int,
    *,
    targetPosition: float = 0.0,
    targetVelocity: float = 0.0,
    force: float = 0.0,
    positionGain: float = 0.1,
    velocityGain: float = 1.0,
    maxVelocity: float = ...,
    physicsClientId: int = 0,
) -> None: ...
def getJointStates(
    bodyUniqueId: int, jointIndices: Sequence[int], physicsClientId: int = 0
) -> Sequence[tuple[float, float, Sequence[float], float]]: ...
def getLinkState(
    bodyUniqueId: int,
    linkIndex: int,
    *,
    computeForwardKinematics: bool = False,
    physicsClientId: int = 0,
) -> tuple[Sequence[float], ...]: ...
def getMatrixFromQuaternion(quaternion: Sequence[float]) -> Sequence[float]: ...
def setCollisionFilterGroupMask(
    bodyUniqueId: int,
    linkIndexA: int,
    collisionFilterGroup: int,
    collisionFilterMask: int,
    physicsClientId: int = 0,
) -> None: ...
def getClosestPoints(
    bodyA: int, bodyB: int, distance: float, physicsClientId: int = 0
) -> Sequence[
    tuple[int, int, int, int, int, Sequence[float], Sequence[float], Sequence[float], float, float]
]: ...
def computeProjectionMatrixFOV(
    fov: float, aspect: float, nearVal: float, farVal: float, physicsClientId: int = 0
) -> Sequence[float]: ...
def getCameraImage(
    width: int,
    height: int,
    viewMatrix: Sequence[float],
    projectionMatrix: Sequence[float],
    *,
    renderer: int = ...,
    physicsClientId: int = 0,
) -> tuple[int, int, np.ndarray, np.ndarray, np.ndarray]: ...

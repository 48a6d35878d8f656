"""What a depth camera sees in a Bullet server, drawn by Bullet's software renderer."""

import numpy as np

from dnet.geometry.camera import Camera, DepthImage
from dnet.geometry.pose import inverse
from dnet.sim.bullet import pybullet


def depth_image(camera: Camera, client: int) -> DepthImage:
    """Return what a camera sees now: distances in metres, and whose they are."""
    near, far = camera.near, camera.far
    _, _, _, buffer, mask = pybullet.getCameraImage(
        camera.width,
        camera.height,
        viewMatrix=_view_matrix(camera),
        projectionMatrix=pybullet.computeProjectionMatrixFOV(
            fov=float(np.degrees(camera.field_of_view)),
            aspect=camera.width / camera.height,
            nearVal=near,
            farVal=far,
        ),
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    shape = (camera.height, camera.width)
    stored = np.asarray(buffer, dtype=np.float64).reshape(shape)
    depth = far * near / (far - (far - near) * stored)
    return DepthImage(
        depth.astype(np.float32), np.asarray(mask, dtype=np.int32).reshape(shape), camera
    )


def _view_matrix(camera: Camera) -> list[float]:
    """Return OpenGL's view matrix, column by column: it looks along -z with y up."""
    optical_to_gl = np.diag([1.0, -1.0, -1.0, 1.0])
    matrix: list[float] = (optical_to_gl @ inverse(camera.pose)).T.ravel().tolist()
    return matrix

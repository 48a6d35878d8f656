"""Numpy values as Foxglove protobuf messages, the vocabulary of an episode file."""

from collections.abc import Sequence

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from jaxtyping import Float32, Float64, UInt8

from dnet.geometry.camera import Pinhole
from dnet.types import ARMS, Cloud, Joints, Point, Transform

WORLD = "world"
CAMERA = "camera"
"""The camera's frame: x right, y down, z forward."""

Color = tuple[int, int, int]


def point_cloud(cloud: Cloud, nanoseconds: int, *, color: Color | None = None) -> PointCloud:
    """Return `cloud` as packed little-endian float32, with one colour for all if given."""
    message = PointCloud(frame_id=WORLD)
    message.timestamp.FromNanoseconds(nanoseconds)
    # A pose without both parts does not pass `rerun rrd verify`.
    message.pose.position.SetInParent()
    message.pose.orientation.w = 1.0
    for column, name in enumerate("xyz"):
        message.fields.add(name=name, offset=4 * column, type=PackedElementField.FLOAT32)
    packed = np.ascontiguousarray(cloud, dtype="<f4")
    if color is None:
        message.point_stride = 12
        message.data = packed.tobytes()
        return message
    rows = np.zeros(len(cloud), dtype=[("xyz", "<f4", (3,)), ("rgba", "u1", (4,))])
    rows["xyz"] = packed
    rows["rgba"] = (*color, 255)
    for column, name in enumerate(("red", "green", "blue", "alpha")):
        message.fields.add(name=name, offset=12 + column, type=PackedElementField.UINT8)
    message.point_stride = 16
    message.data = rows.tobytes()
    return message


def joint_states(
    names: Sequence[str], joints: tuple[Joints, Joints], nanoseconds: int
) -> JointStates:
    """Return the joint positions of both arms, named "psm_left/yaw" and so on."""
    message = JointStates()
    message.timestamp.FromNanoseconds(nanoseconds)
    for arm, positions in zip(ARMS, joints, strict=True):
        for name, position in zip(names, positions, strict=True):
            message.joints.add(name=f"{arm}/{name}", position=float(position))
    return message


def frame_transforms(transforms: Sequence[Transform], nanoseconds: int) -> FrameTransforms:
    """Return where every link stands in its parent."""
    message = FrameTransforms()
    for transform in transforms:
        entry = message.transforms.add(
            parent_frame_id=transform.parent, child_frame_id=transform.child
        )
        entry.timestamp.FromNanoseconds(nanoseconds)
        _set_pose(entry.translation, entry.rotation, transform.translation, transform.rotation)
    return message


def pose_in_world(
    position: Point, rotation: Float64[np.ndarray, "4"], nanoseconds: int
) -> PoseInFrame:
    """Return a pose in the world frame; `rotation` is a quaternion, x y z w."""
    message = PoseInFrame(frame_id=WORLD)
    message.timestamp.FromNanoseconds(nanoseconds)
    _set_pose(message.pose.position, message.pose.orientation, position, rotation)
    return message


def camera_calibration(camera: Pinhole, nanoseconds: int) -> CameraCalibration:
    """Return how the pixels of `camera` look into its frame.

    K takes camera coordinates to pixel indices, counted from 0 at the upper left: pixel (u, v)
    looks along inv(K) @ (u, v, 1), with no half pixel added.
    """
    message = CameraCalibration(frame_id=CAMERA, width=camera.width, height=camera.height)
    message.timestamp.FromNanoseconds(nanoseconds)
    # Foxglove has no name for a lens without distortion: this one has five coefficients of 0.
    message.distortion_model = "plumb_bob"
    message.D.extend([0.0] * 5)
    message.K.extend(camera.intrinsics.ravel().tolist())
    message.R.extend(np.eye(3).ravel().tolist())
    message.P.extend(np.pad(camera.intrinsics, ((0, 0), (0, 1))).ravel().tolist())
    return message


def raw_image(
    pixels: Float32[np.ndarray, "h w"] | UInt8[np.ndarray, "h w"], nanoseconds: int
) -> RawImage:
    """Return an image of little-endian float32, or of bytes, seen by the camera."""
    height, width = pixels.shape
    bytewise = pixels.dtype == np.uint8
    packed = np.ascontiguousarray(pixels, dtype="u1" if bytewise else "<f4")
    message = RawImage(
        frame_id=CAMERA,
        width=width,
        height=height,
        encoding="mono8" if bytewise else "32FC1",
        step=width * packed.itemsize,
        data=packed.tobytes(),
    )
    message.timestamp.FromNanoseconds(nanoseconds)
    return message


def log(text: str, nanoseconds: int, *, level: str, name: str) -> Log:
    """Return a line of text; `level` is one of debug, info, warning, error."""
    message = Log(level=Log.Level.Value(level.upper()), name=name, message=text)
    message.timestamp.FromNanoseconds(nanoseconds)
    return message


def _set_pose(
    position: object,
    orientation: object,
    translation: Point,
    rotation: Float64[np.ndarray, "4"],
) -> None:
    """Fill a vector and a quaternion message, even where they are zero: both must be present."""
    position.SetInParent()  # type: ignore[attr-defined]
    for axis, value in zip("xyz", translation, strict=True):
        setattr(position, axis, float(value))
    for axis, value in zip("xyzw", rotation, strict=True):
        setattr(orientation, axis, float(value))

"""The messages and the metadata of an episode as values of `dnet.types`.

Each function raises one of `UNREADABLE` on content that is not what it should be.
"""

import json
import math
from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from jaxtyping import Float32, Float64, UInt8
from scipy.spatial.transform import Rotation

from dnet.datasets.point_cloud import NotFinite
from dnet.geometry.pose import pose
from dnet.types import (
    ARMS,
    EpisodeMeta,
    FrameKind,
    Joints,
    Point,
    Pose,
    Scene,
    Tissue,
    TissueShape,
    Transform,
)

UNREADABLE = (ValueError, TypeError, KeyError, OverflowError, RecursionError, DecodeError)
JOINTS_PER_ARM = 6
WORLD = "world"
LARGEST_MESSAGE = 64 * 1024
"""Bytes of a message without points or pixels that are still parsed: dnet writes 3 KiB at most, and
parsed ones take many times their bytes."""
MOST_TRANSFORMS = 256
"""Transforms of one message that are still read: dnet writes 25."""
LARGEST_DOCUMENT = 16 * 2**20
"""Bytes of JSON in the metadata that are still parsed; dnet writes 10 KiB."""
MOST_CELLS = 1_000_000
"""Cells of an object's mesh that are still believed; dnet makes 256, and at most some thousands."""
UNIT_TOLERANCE = 0.01
"""How far the length of a quaternion may be from 1 for a rotation that is still read."""

_KINDS = get_args(FrameKind)
_SHAPES = get_args(TissueShape)


def read_position(message: memoryview) -> Point:
    """Return the position of a foxglove.PoseInFrame."""
    return read_placement(message)[0]


def read_placement(message: memoryview) -> tuple[Point, Float64[np.ndarray, "4"]]:
    """Return position and orientation, a quaternion x y z w, of a foxglove.PoseInFrame."""
    placed = PoseInFrame.FromString(_small(message)).pose
    return (
        np.array([getattr(placed.position, axis) for axis in "xyz"]),
        np.array([getattr(placed.orientation, axis) for axis in "xyzw"]),
    )


def read_joints(message: memoryview) -> tuple[Joints, Joints]:
    """Return the joint positions of both arms in a foxglove.JointStates."""
    states = JointStates.FromString(_small(message)).joints
    left, right = (
        np.array([joint.position for joint in states if joint.name.startswith(f"{arm}/")])
        for arm in ARMS
    )
    if len(left) != JOINTS_PER_ARM or len(right) != JOINTS_PER_ARM:
        raise ValueError(f"{len(left)} and {len(right)} joints, not {JOINTS_PER_ARM} of each arm")
    return left, right


def read_transforms(message: memoryview) -> list[Transform]:
    """Return the transforms of a foxglove.FrameTransforms."""
    entries = FrameTransforms.FromString(_small(message)).transforms
    if len(entries) > MOST_TRANSFORMS:
        raise ValueError(f"{len(entries)} transforms, at most {MOST_TRANSFORMS} are read")
    return [
        Transform(
            entry.parent_frame_id,
            entry.child_frame_id,
            np.array([getattr(entry.translation, axis) for axis in "xyz"]),
            np.array([getattr(entry.rotation, axis) for axis in "xyzw"]),
        )
        for entry in entries
    ]


def read_calibration(message: memoryview) -> tuple[str, int, int, Float64[np.ndarray, "3 3"]]:
    """Return frame, width, height and the matrix K of a foxglove.CameraCalibration."""
    calibration = CameraCalibration.FromString(_small(message))
    if (
        len(calibration.K) != 9
        or not np.isfinite(calibration.K).all()
        or not all((calibration.width, calibration.height, calibration.K[0], calibration.K[4]))
    ):
        raise ValueError("no pinhole camera")
    intrinsics = np.array(calibration.K).reshape(3, 3)
    return calibration.frame_id, calibration.width, calibration.height, intrinsics


def read_depth(message: memoryview) -> Float32[np.ndarray, "h w"]:
    """Return the distances in a foxglove.RawImage of float32, read-only."""
    depth = _read_pixels(message, "32FC1", np.dtype("<f4"))
    if not np.isfinite(depth).all():
        raise NotFinite("a depth of NaN or infinity")
    return depth


def read_mask(message: memoryview) -> UInt8[np.ndarray, "h w"]:
    """Return the numbers in a foxglove.RawImage of bytes, read-only."""
    return _read_pixels(message, "mono8", np.dtype("u1"))


def read_pose(message: memoryview, *, frame: str) -> Pose:
    """Return where `frame` stands in the world, of a foxglove.FrameTransforms."""
    for entry in read_transforms(message):
        if (entry.parent, entry.child) == (WORLD, frame):
            # Of a quaternion of length 1e200 scipy makes a matrix of zeros.
            length = math.hypot(*entry.rotation)
            if not abs(length - 1) <= UNIT_TOLERANCE:
                raise ValueError(f"a quaternion of length {length:g} for {frame[:40]!r}, not 1")
            rotation = Rotation.from_quat(entry.rotation).as_matrix()
            placed = pose(rotation, entry.translation)
            if np.isfinite(placed).all():
                return placed
    raise ValueError(f"it does not say where {frame[:40]!r} stands in {WORLD!r}")


def read_line(message: memoryview) -> str:
    """Return the text of a foxglove.Log."""
    text: str = Log.FromString(_small(message)).message
    return text


def read_frame_end(message: memoryview) -> tuple[int, FrameKind, float]:
    """Return number, kind and time of a frame: what a dnet.Frame says."""
    record = json.loads(_small(message))
    kind = record["kind"]
    if kind not in _KINDS:
        raise ValueError(f"a frame of kind {str(kind)[:40]!r}, not one of {', '.join(_KINDS)}")
    return _whole(record["index"]), kind, _finite(record["time"])


def read_step(message: memoryview) -> dict[str, Any]:
    """Return a dnet.Step: index, time, chamfer, motion, plan or None."""
    record: dict[str, Any] = dict(json.loads(_small(message)))
    record["time"] = _finite(record["time"])
    record["chamfer"] = _finite(record["chamfer"])
    record["motion"] = list(_numbers(record["motion"], 3))
    return record


def read_meta(record: Mapping[str, str]) -> EpisodeMeta:
    """Return what the metadata `dnet.episode` says."""
    return EpisodeMeta(
        episode_id=record["episode_id"],
        seed=_int64(record["seed"]),
        index=_int64(record["index"]),
        scene=read_scene(record["scene"]),
        settings=dict(_document(record["settings"])),
    )


def read_scene(text: str) -> Scene:
    """Return the scene that a JSON document describes."""
    scene = _document(text)
    return Scene(
        position=_numbers(scene["position"], 2),
        yaw=_finite(scene["yaw"]),
        hold=_numbers(scene["hold"], 3),
        manipulation_point=_numbers(scene["manipulation_point"], 3),
        tissue=_read_tissue(scene["tissue"]),
    )


def _read_tissue(record: Mapping[str, Any]) -> Tissue:
    if record["shape"] not in _SHAPES:
        raise ValueError(f"an object of shape {str(record['shape'])[:40]!r}")
    # Each cell becomes several tetrahedra of a mesh: two dozen bytes could ask for all memory.
    cells = _numbers(record["cells"], 3)
    if any(cell < 1 or cell != int(cell) for cell in cells) or math.prod(cells) > MOST_CELLS:
        raise ValueError(f"a mesh of {str(record['cells'])[:40]} cells, at most {MOST_CELLS}")
    size = _numbers(record["size"], 3)
    if min(size) < 0:
        raise ValueError(f"an object of {str(record['size'])[:40]} m")
    return Tissue(
        shape=record["shape"],
        size=size,
        cells=(int(cells[0]), int(cells[1]), int(cells[2])),
        young=_finite(record["young"]),
        poisson=_finite(record["poisson"]),
        density=_finite(record["density"]),
    )


def read_result(record: Mapping[str, str]) -> dict[str, Any]:
    """Return what the metadata `dnet.result` says."""
    return {key: _document(value) for key, value in record.items()}


def _document(text: str) -> Any:
    if len(text) > LARGEST_DOCUMENT:
        raise ValueError(f"{len(text)} bytes of JSON, at most {LARGEST_DOCUMENT} are parsed")
    return json.loads(text)


def _read_pixels(message: memoryview, encoding: str, dtype: np.dtype[Any]) -> Any:
    image = RawImage.FromString(bytes(message))
    step = image.width * dtype.itemsize
    if (image.encoding, image.step, len(image.data)) != (encoding, step, image.height * step):
        raise ValueError(f"no image of {image.width} x {image.height} pixels in {encoding}")
    return np.frombuffer(image.data, dtype).reshape(image.height, image.width)


def _numbers(values: Any, count: int) -> Any:
    if len(values) != count:
        raise ValueError(f"{str(values)[:40]} are not {count} numbers")
    return tuple(_finite(value) for value in values)


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise NotFinite(f"{number} where a number must be")
    return number


def _int64(text: str) -> int:
    number = int(text)
    if not -(2**63) <= number < 2**63:
        raise OverflowError(f"{text[:40]} where a number of 64 bits must be")
    return number


def _whole(value: Any) -> int:
    # 1.5 would become 1, and true too.
    if type(value) is not int:
        raise TypeError(f"{str(value)[:40]!r} where a whole number must be")
    return value


def _small(message: memoryview) -> bytes:
    if len(message) > LARGEST_MESSAGE:
        raise ValueError(f"{len(message)} bytes, at most {LARGEST_MESSAGE} are read")
    return bytes(message)

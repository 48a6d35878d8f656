"""The messages and the metadata of an episode as values of `dnet.types`.

Each function raises one of `UNREADABLE` on content that is not what it should be.
"""

import json
import math
from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.message import DecodeError

from dnet.types import ARMS, EpisodeMeta, FrameKind, Joints, Point, Scene, Transform

UNREADABLE = (ValueError, TypeError, KeyError, OverflowError, RecursionError, DecodeError)
JOINTS_PER_ARM = 6

_KINDS = get_args(FrameKind)


def read_position(message: memoryview) -> Point:
    """Return the position of a foxglove.PoseInFrame."""
    position = PoseInFrame.FromString(bytes(message)).pose.position
    return np.array([position.x, position.y, position.z])


def read_joints(message: memoryview) -> tuple[Joints, Joints]:
    """Return the joint positions of both arms in a foxglove.JointStates."""
    states = JointStates.FromString(bytes(message)).joints
    left, right = (
        np.array([joint.position for joint in states if joint.name.startswith(f"{arm}/")])
        for arm in ARMS
    )
    if len(left) != JOINTS_PER_ARM or len(right) != JOINTS_PER_ARM:
        raise ValueError(f"{len(left)} and {len(right)} joints, not {JOINTS_PER_ARM} of each arm")
    return left, right


def read_transforms(message: memoryview) -> list[Transform]:
    """Return the transforms of a foxglove.FrameTransforms."""
    return [
        Transform(
            entry.parent_frame_id,
            entry.child_frame_id,
            np.array([getattr(entry.translation, axis) for axis in "xyz"]),
            np.array([getattr(entry.rotation, axis) for axis in "xyzw"]),
        )
        for entry in FrameTransforms.FromString(bytes(message)).transforms
    ]


def read_line(message: memoryview) -> str:
    """Return the text of a foxglove.Log."""
    text: str = Log.FromString(bytes(message)).message
    return text


def read_frame_end(message: memoryview) -> tuple[int, FrameKind, float]:
    """Return number, kind and time of a frame: what a dnet.Frame says."""
    record = json.loads(bytes(message))
    kind = record["kind"]
    if kind not in _KINDS:
        raise ValueError(f"a frame of kind {str(kind)[:40]!r}, not one of {', '.join(_KINDS)}")
    return int(record["index"]), kind, _finite(record["time"])


def read_step(message: memoryview) -> dict[str, Any]:
    """Return a dnet.Step: index, time, chamfer, motion, plan or None."""
    record: dict[str, Any] = dict(json.loads(bytes(message)))
    record["time"] = _finite(record["time"])
    record["chamfer"] = _finite(record["chamfer"])
    record["motion"] = list(_numbers(record["motion"], 3))
    return record


def read_meta(record: Mapping[str, str]) -> EpisodeMeta:
    """Return what the metadata `dnet.episode` says."""
    scene = json.loads(record["scene"])
    return EpisodeMeta(
        episode_id=record["episode_id"],
        seed=int(record["seed"]),
        index=int(record["index"]),
        scene=Scene(
            position=_numbers(scene["position"], 2),
            yaw=float(scene["yaw"]),
            hold=_numbers(scene["hold"], 3),
            manipulation_point=_numbers(scene["manipulation_point"], 3),
        ),
        settings=dict(json.loads(record["settings"])),
    )


def read_result(record: Mapping[str, str]) -> dict[str, Any]:
    """Return what the metadata `dnet.result` says."""
    return {key: json.loads(value) for key, value in record.items()}


def _numbers(values: Any, count: int) -> Any:
    if len(values) != count:
        raise ValueError(f"{values} are not {count} numbers")
    return tuple(_finite(value) for value in values)


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{number} where a number must be")
    return number

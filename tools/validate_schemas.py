"""The channels of an episode: whether each topic has the schema and the encoding that it must."""

from collections import Counter

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import Message
from mcap_protobuf.schema import build_file_descriptor_set

from dnet.datasets.reader import (
    CALIBRATION,
    CLOUD,
    DEPTH,
    GOAL,
    GRIPPER,
    JOINTS,
    LOG,
    MASK,
    NODES,
    POINT,
    TRANSFORMS,
)
from dnet.recorders.json_text import to_json
from dnet.recorders.schemas import JSON_SCHEMAS
from dnet.tools.validate_contents import Contents
from dnet.tools.validate_findings import Findings

FOXGLOVE: dict[str, type[Message]] = {
    CLOUD: PointCloud,
    NODES: PointCloud,
    GOAL: PointCloud,
    POINT: PointCloud,
    JOINTS: JointStates,
    TRANSFORMS: FrameTransforms,
    GRIPPER: PoseInFrame,
    CALIBRATION: CameraCalibration,
    DEPTH: RawImage,
    MASK: RawImage,
    LOG: Log,
}
"""Message by topic."""


def check_channels(contents: Contents, findings: Findings) -> None:
    """Compare the channels and schemas of the topics of an episode with what they should be."""
    topics = Counter(channel.topic for channel in contents.channels.values())
    for topic, count in topics.items():
        if count > 1:
            findings.error("channel", f"{topic} has {count} channels, readers take the first alone")
    for channel in contents.channels.values():
        wanted = _schema(channel.topic)
        if wanted is None:
            continue
        schema = contents.schemas.get(channel.schema_id)
        got = ("", "", b"") if schema is None else (schema.name, schema.encoding, schema.data)
        for what, one, other in (
            ("message encoding", channel.message_encoding, wanted[3]),
            ("schema", got[0], wanted[0]),
            ("schema encoding", got[1], wanted[1]),
        ):
            if one != other:
                findings.error("schema", f"{channel.topic} has {what} {one!r}, must be {other!r}")
        if got[0] == wanted[0] and got[2] != wanted[2]:
            findings.warn("schema", f"{channel.topic} has another {got[0]} than this dnet writes")


def _schema(topic: str) -> tuple[str, str, bytes, str] | None:
    """Return name, encoding and content of a topic's schema, and its messages' encoding."""
    if topic in JSON_SCHEMAS:
        name, schema = JSON_SCHEMAS[topic]
        return name, "jsonschema", to_json(schema).encode(), "json"
    if topic in FOXGLOVE:
        message = FOXGLOVE[topic]
        content = build_file_descriptor_set(message).SerializeToString()
        return message.DESCRIPTOR.full_name, "protobuf", content, "protobuf"
    return None

"""A point cloud message read where it lies, without copying its points."""

import numpy as np
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

from dnet.types import Cloud

# Wire types of protobuf (https://protobuf.dev/programming-guides/encoding).
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_STRIDE = PointCloud.POINT_STRIDE_FIELD_NUMBER
_FIELDS = PointCloud.FIELDS_FIELD_NUMBER
_DATA = PointCloud.DATA_FIELD_NUMBER
_XYZ = [
    PackedElementField(name=name, offset=4 * column, type=PackedElementField.FLOAT32)
    for column, name in enumerate("xyz")
]
_PLAIN = b"".join(entry.SerializeToString() for entry in _XYZ)

MOST_FIELDS = 256
"""Fields of a message that are still read, the fields of a point among them; dnet writes 12."""


class NotFinite(ValueError):
    """Numbers that are NaN or infinite."""


def read_point_cloud(message: memoryview) -> Cloud:
    """Return the points of a foxglove.PointCloud message, read-only, (n, 3).

    Points packed as three float32 alone, as `dnet` writes them, are a view of `message`; points
    with colours or other fields between them are copied.

    Raises:
        ValueError: If the message is not a cloud of float32 x, y and z.
        NotFinite: If one of them is NaN or infinite.
    """
    extent = packed_extent(message)
    if extent is None:
        points = _copy(message)
    else:
        start, stop = extent
        points = np.frombuffer(message[start:stop], dtype="<f4").reshape(-1, 3)
    if not np.isfinite(points).all():
        raise NotFinite("a cloud with NaN or infinite coordinates")
    return points


def packed_extent(message: memoryview) -> tuple[int, int] | None:
    """Return where in a foxglove.PointCloud message its points begin and end, twelve bytes each.

    None if the points are not packed as three float32 alone.

    Raises:
        ValueError: If the message is none, or ends within a point.
    """
    stride = start = stop = 0
    layout = b""
    for field, begin, end in _walk(message):
        if field == _STRIDE:
            stride = int.from_bytes(message[begin:end], "little")
        elif field == _FIELDS and len(layout) <= len(_PLAIN):
            layout += bytes(message[begin:end])
        elif field == _DATA:
            start, stop = begin, end
    if layout != _PLAIN or stride != 12:
        return None
    if (stop - start) % stride:
        raise ValueError(f"{stop - start} bytes are no whole number of points")
    return start, stop


def _copy(message: memoryview) -> Cloud:
    cloud = PointCloud.FromString(bytes(message))
    fields = {field.name: field for field in cloud.fields}
    if any(name not in fields or fields[name].type != _XYZ[0].type for name in "xyz"):
        raise ValueError("x, y and z must be there and be float32")
    if cloud.point_stride < 12 or len(cloud.data) % cloud.point_stride:
        raise ValueError(f"{len(cloud.data)} bytes are no whole number of points")
    packed = np.dtype(
        {
            "names": list("xyz"),
            "formats": ["<f4"] * 3,
            "offsets": [fields[name].offset for name in "xyz"],
            "itemsize": cloud.point_stride,
        }
    )
    rows = np.frombuffer(cloud.data, dtype=packed)
    points = np.stack([rows[name] for name in "xyz"], axis=1).astype(np.float32)
    points.flags.writeable = False
    return points


def _walk(message: memoryview) -> list[tuple[int, int, int]]:
    """Return number, begin and end of each field of a protobuf message."""
    fields: list[tuple[int, int, int]] = []
    place, end = 0, len(message)
    while place < end:
        tag, place = _varint(message, place)
        kind = tag & 7
        if kind == _BYTES:
            size, place = _varint(message, place)
        elif kind == _FIXED32:
            size = 4
        elif kind == _FIXED64:
            size = 8
        elif kind == _VARINT:
            _, after = _varint(message, place)
            size = after - place
        else:
            raise ValueError(f"protobuf knows no wire type {kind}")
        if size > end - place:
            raise ValueError(f"a field of {size} bytes where {end - place} are left")
        # A list of millions of empty fields would take fifty times the bytes of the message.
        if len(fields) == MOST_FIELDS:
            raise ValueError(f"more than {MOST_FIELDS} fields")
        fields.append((tag >> 3, place, place + size))
        place += size
    return fields


def _varint(message: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if place >= len(message) or shift > 63:
            raise ValueError("a number that does not end")
        byte = message[place]
        place += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, place
        shift += 7

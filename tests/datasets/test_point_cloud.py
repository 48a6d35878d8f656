from collections.abc import Sequence

import numpy as np
import pytest
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from google.protobuf.message import DecodeError
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dnet.datasets.point_cloud import read_point_cloud
from dnet.recorders.messages import point_cloud
from dnet.types import Cloud

CLOUDS = arrays(
    np.float32,
    st.tuples(st.integers(0, 40), st.just(3)),
    elements=st.floats(-10, 10, width=32),
)


@given(cloud=CLOUDS, nanoseconds=st.integers(0, 2**62))
def test_a_plain_cloud_is_a_readonly_view_of_its_message(cloud: Cloud, nanoseconds: int) -> None:
    message = point_cloud(cloud, nanoseconds).SerializeToString()
    points = read_point_cloud(memoryview(message))
    np.testing.assert_array_equal(points, cloud)
    assert points.dtype == np.float32
    assert not points.flags.writeable
    within = np.frombuffer(message, np.uint8)
    assert len(cloud) == 0 or np.shares_memory(points, within)


@given(cloud=CLOUDS)
def test_a_coloured_cloud_has_the_same_points(cloud: Cloud) -> None:
    message = point_cloud(cloud, 0, color=(1, 2, 3)).SerializeToString()
    points = read_point_cloud(memoryview(message))
    np.testing.assert_array_equal(points, cloud)
    assert not points.flags.writeable


def test_fields_may_come_in_any_order() -> None:
    rows = np.zeros(4, dtype=[("z", "<f4"), ("x", "<f4"), ("w", "<f4"), ("y", "<f4")])
    for name in "xyz":
        rows[name] = np.random.default_rng(ord(name)).uniform(size=4)
    message = PointCloud(point_stride=16, data=rows.tobytes())
    for offset, name in enumerate("zxwy"):
        message.fields.add(name=name, offset=4 * offset, type=PackedElementField.FLOAT32)
    points = read_point_cloud(memoryview(message.SerializeToString()))
    np.testing.assert_array_equal(points, np.stack([rows["x"], rows["y"], rows["z"]], axis=1))


def other(
    *, stride: int = 12, size: int = 24, names: Sequence[str] = "xyz", offset: int = 0,
    kind: "PackedElementField.NumericType.ValueType" = PackedElementField.FLOAT32,
) -> bytes:  # fmt: skip
    message = PointCloud(point_stride=stride, data=bytes(size))
    for place, name in enumerate(names):
        message.fields.add(name=name, offset=offset + 4 * place, type=kind)
    return message.SerializeToString()


@pytest.mark.parametrize(
    "message",
    [
        other(size=25),
        other(stride=0),
        other(stride=11),
        other(names="xy"),
        other(offset=8),
        other(kind=PackedElementField.FLOAT64),
        other(stride=2**32 - 1, size=24),
        b"",
        b"\x32\xff\xff\xff\xff\x7f",
        b"\xff" * 40,
        b"\x36",
    ],
)
def test_what_is_no_cloud_is_refused(message: bytes) -> None:
    with pytest.raises((ValueError, DecodeError)):
        read_point_cloud(memoryview(message))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_cloud_with_holes_is_refused(bad: float) -> None:
    cloud = np.ones((5, 3), dtype=np.float32)
    cloud[2, 1] = bad
    with pytest.raises(ValueError, match="NaN or infinite"):
        read_point_cloud(memoryview(point_cloud(cloud, 0).SerializeToString()))


@given(message=st.binary(max_size=80))
def test_arbitrary_bytes_are_read_or_refused(message: bytes) -> None:
    try:
        points = read_point_cloud(memoryview(message))
    except (ValueError, DecodeError):
        return
    assert points.shape[1:] == (3,)

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadEpisode, MissingPath, NoSuchFrame
from dnet.geometry.camera import Camera
from dnet.recorders.messages import frame_transforms
from dnet.sim.urdf import psm_urdf
from dnet.types import Transform
from tests.recorders.rollout import ARMS, frames, meta, with_image, write, write_servo

Change = Callable[[str, int, bytes], bytes | None]


def rewrite(
    source: Path,
    target: Path,
    change: Change = lambda _topic, _number, content: content,
    *,
    compression: CompressionType = CompressionType.NONE,
    metadata: dict[str, str] | None = None,
) -> Path:
    """Copy an episode with the stock tools, changing or dropping (None) some messages."""
    with source.open("rb") as old, target.open("wb") as new:
        reader = make_reader(old)
        writer = Writer(new, chunk_size=100_000, compression=compression)
        writer.start()
        for record in reader.iter_metadata():
            changed = record.metadata if metadata is None else record.metadata | metadata
            writer.add_metadata(record.name, changed)
        for attached in reader.iter_attachments():
            writer.add_attachment(0, 0, attached.name, attached.media_type, attached.data)
        channels: dict[str, int] = {}
        counts: dict[str, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            topic = channel.topic
            if topic not in channels:
                assert schema is not None
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[topic] = writer.register_channel(topic, channel.message_encoding, number)
            count = counts.get(topic, 0)
            counts[topic] = count + 1
            content = change(topic, count, message.data)
            if content is not None:
                time = message.log_time
                writer.add_message(channels[topic], time, content, time, message.sequence)
        writer.finish()
    return target


@pytest.mark.parametrize(
    "compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]
)
def test_what_was_written_is_what_is_read(tmp_path: Path, compression: CompressionType) -> None:
    seen = frames(5)
    path = write(tmp_path / "a.mcap", seen, name="one")
    if compression != CompressionType.NONE:
        path = rewrite(path, tmp_path / "b.mcap", compression=compression)
    with EpisodeReader(path) as episode:
        assert episode.path == path
        assert episode.meta == meta("one")
        assert episode.finished
        assert episode.result == {"frames": len(seen), "rejected": {"folded": 2}}
        assert len(episode) == len(seen)
        assert episode.kinds == tuple(one.kind for one in seen)
        np.testing.assert_array_equal(episode.times, [one.time for one in seen])
        np.testing.assert_array_equal(episode.grasps, [one.grasp for one in seen])
        for index, one in enumerate(seen):
            read = episode.frame(index)
            assert (read.time, read.kind) == (one.time, one.kind)
            np.testing.assert_array_equal(read.cloud, one.cloud)
            np.testing.assert_array_equal(episode.cloud(index), one.cloud)
            np.testing.assert_array_equal(read.grasp, one.grasp)
            np.testing.assert_array_equal(read.nodes, one.nodes)
            np.testing.assert_array_equal(read.joints[0], one.joints[0])
            np.testing.assert_array_equal(read.joints[1], one.joints[1])


def test_transforms_are_those_of_the_arms(tmp_path: Path) -> None:
    seen = frames(2)
    with EpisodeReader(write(tmp_path / "a.mcap", seen)) as episode:
        for index, one in enumerate(seen):
            for read, wanted in zip(
                episode.transforms(index), ARMS.transforms(one.joints), strict=True
            ):
                assert (read.parent, read.child) == (wanted.parent, wanted.child)
                np.testing.assert_array_equal(read.translation, wanted.translation)
                np.testing.assert_array_equal(read.rotation, wanted.rotation)


def camera_at(rotation: list[float], height: float) -> bytes:
    entry = Transform("world", "camera", np.array([0.0, 0.0, height]), np.array(rotation))
    return frame_transforms([entry], 0).SerializeToString()


def test_the_camera_comes_back(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24, eye=(0.05, -0.3, 0.4))
    with EpisodeReader(write(tmp_path / "a.mcap", frames(2), camera=camera)) as episode:
        read = episode.camera()
    assert read is not None
    assert (read.width, read.height) == (32, 24)
    np.testing.assert_array_equal(read.intrinsics, camera.intrinsics)
    np.testing.assert_allclose(read.pose, camera.pose, atol=1e-12)


def test_without_a_camera_or_a_frame_there_is_none_to_read(tmp_path: Path) -> None:
    with EpisodeReader(write(tmp_path / "a.mcap", frames(2))) as episode:
        assert episode.camera() is None
    with EpisodeReader(write(tmp_path / "b.mcap", [], camera=Camera())) as episode:
        assert episode.camera() is None


@pytest.mark.parametrize(
    ("topic", "content"),
    [
        ("/camera/calibration", b""),
        ("/camera/calibration", b"\xff\xff"),
        ("/camera/calibration", CameraCalibration(K=[1.0] * 9).SerializeToString()),
        ("/camera/calibration", CameraCalibration(
            width=4, height=3, K=[np.nan] * 9).SerializeToString()),
        ("/camera/calibration", CameraCalibration(
            width=4, height=3, K=[0.0] * 9).SerializeToString()),
        ("/tf", b""),
        ("/tf", camera_at([0.0, 0.0, 0.0, 0.0], 0.1)),
        ("/tf", camera_at([0.0, 0.0, 0.0, 1.0], np.nan)),
    ],
)  # fmt: skip
def test_a_spoiled_camera_is_refused(tmp_path: Path, topic: str, content: bytes) -> None:
    source = write(tmp_path / "a.mcap", frames(2), camera=Camera())
    spoiled = rewrite(
        source, tmp_path / "b.mcap", lambda name, _, old: content if name == topic else old
    )
    with (
        EpisodeReader(spoiled) as episode,
        pytest.raises(BadEpisode, match=f"b.mcap has an unreadable {topic}"),
    ):
        episode.camera()


def test_images_come_back_with_their_own_frames(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    seen = frames(4)
    for index in (1, 2, 5):
        seen[index] = with_image(seen[index], camera, seed=index)
    # Two looks at one instant.
    seen[2] = replace(seen[2], time=seen[1].time)
    with EpisodeReader(write(tmp_path / "a.mcap", seen, camera=camera)) as episode:
        for index, one in enumerate(seen):
            read, whole = episode.image(index), episode.frame(index).image
            if one.image is None:
                assert read is None
                assert whole is None
                continue
            assert read is not None
            assert whole is not None
            assert read.depth.dtype == np.float32
            assert read.mask.dtype == np.uint8
            np.testing.assert_array_equal(read.depth, one.image.depth)
            np.testing.assert_array_equal(read.mask, one.image.mask)
            np.testing.assert_array_equal(whole.depth, one.image.depth)
        with pytest.raises(NoSuchFrame):
            episode.image(len(seen))


def test_an_image_and_the_camera_give_the_points_that_were_seen(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    one = with_image(frames(2)[0], camera)
    assert one.image is not None
    with EpisodeReader(write(tmp_path / "a.mcap", [one], camera=camera)) as episode:
        view, image = episode.camera(), episode.image(0)
    assert view is not None
    assert image is not None
    chosen = one.image.mask == 1
    np.testing.assert_allclose(
        view.points(image.depth, image.mask == 1),
        camera.pinhole.points(one.image.depth, chosen),
        atol=1e-7,
    )


@pytest.mark.parametrize(
    ("topic", "content"),
    [
        ("/camera/depth", b""),
        ("/camera/depth", b"\xff\xff"),
        ("/camera/depth", None),
        ("/camera/mask", None),
        ("/camera/mask", RawImage(
            width=2, height=2, step=2, encoding="mono8", data=bytes(4)).SerializeToString()),
        ("/camera/mask", RawImage(
            width=32, height=24, step=32, encoding="rgb8", data=bytes(768)).SerializeToString()),
        ("/camera/depth", RawImage(
            width=32, height=24, step=128, encoding="32FC1", data=bytes(8)).SerializeToString()),
        ("/camera/depth", RawImage(width=32, height=24, step=128, encoding="32FC1",
            data=b"\xff" * 3072).SerializeToString()),
    ],
)  # fmt: skip
def test_a_spoiled_image_is_refused(tmp_path: Path, topic: str, content: bytes | None) -> None:
    camera = Camera(width=32, height=24)
    source = write(tmp_path / "a.mcap", [with_image(frames(2)[0], camera)], camera=camera)
    spoiled = rewrite(
        source, tmp_path / "b.mcap", lambda name, _, old: content if name == topic else old
    )
    with (
        EpisodeReader(spoiled) as episode,
        pytest.raises(BadEpisode, match="has an unreadable /camera/"),
    ):
        episode.image(0)


def test_images_that_could_belong_to_either_of_two_frames_are_refused(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    first = frames(2)[0]
    seen = [first, with_image(first, camera)]
    with (
        EpisodeReader(write(tmp_path / "a.mcap", seen, camera=camera)) as episode,
        pytest.raises(BadEpisode, match=r"unreadable /camera/depth .*do not match the frames"),
    ):
        episode.image(1)


def test_arrays_cannot_be_changed_by_mistake(tmp_path: Path) -> None:
    with EpisodeReader(write(tmp_path / "a.mcap", frames(2))) as episode:
        for values in (episode.cloud(0), episode.nodes(0), episode.times, episode.grasps):
            with pytest.raises(ValueError, match="read-only"):
                values[0] = 0.0


def test_clouds_stay_valid_after_the_file_is_closed(tmp_path: Path) -> None:
    seen = frames(2)
    with EpisodeReader(write(tmp_path / "a.mcap", seen)) as episode:
        cloud = episode.cloud(1)
    np.testing.assert_array_equal(cloud, seen[1].cloud)


def test_a_servo_run_has_a_goal_and_steps(tmp_path: Path) -> None:
    seen = frames(3)
    with EpisodeReader(write_servo(tmp_path / "run.mcap")) as episode:
        goal = episode.goal()
        assert goal is not None
        np.testing.assert_array_equal(goal, seen[-1].cloud)
        steps = episode.steps()
        assert [step["index"] for step in steps] == [0, 1, 2]
        assert [step["time"] for step in steps] == [0.0, 1.0, 2.0]
        np.testing.assert_array_equal(steps[0]["motion"], seen[-1].grasp - seen[0].grasp)
        assert [step["plan"] and step["plan"]["status"] for step in steps] == [
            "straight", "straight", None
        ]  # fmt: skip
        assert [text.split(":")[0] for _, text in episode.lines()] == ["step 0", "step 1", "step 2"]


def test_a_recording_has_neither_goal_nor_steps_but_lines(tmp_path: Path) -> None:
    with EpisodeReader(write(tmp_path / "a.mcap", frames(3))) as episode:
        assert episode.goal() is None
        assert episode.steps() == []
        assert episode.lines() == [
            (0.0, "frame 0: rest"),
            (1.0, "frame 2: shape"),
            (2.0, "frame 4: shape"),
        ]


def test_attachments_come_back(tmp_path: Path) -> None:
    with EpisodeReader(write(tmp_path / "a.mcap", frames(2))) as episode:
        assert episode.attachment("psm.urdf").decode() == psm_urdf()
        with pytest.raises(MissingPath, match=r"mesh\.vtk.*holds psm\.urdf, config\.json"):
            episode.attachment("mesh.vtk")


@pytest.mark.parametrize("index", [-1, 3, 10**30])
def test_a_frame_that_is_not_there_is_refused(tmp_path: Path, index: int) -> None:
    with EpisodeReader(write(tmp_path / "a.mcap", frames(2))) as episode:
        for read in (episode.cloud, episode.nodes, episode.frame, episode.transforms):
            with pytest.raises(NoSuchFrame, match=f"no frame {index}: it has 3 frames, 0 to 2"):
                read(index)


def test_a_reader_travels_between_processes(tmp_path: Path) -> None:
    with (
        EpisodeReader(write(tmp_path / "a.mcap", frames(2))) as episode,
        pickle.loads(pickle.dumps(episode)) as other,  # noqa: S301
    ):
        assert other.meta == episode.meta
        np.testing.assert_array_equal(other.cloud(1), episode.cloud(1))


FRAME_TOPICS = [
    "/cloud/current", "/cloud/nodes", "/manipulation_point", "/joint_states", "/tf", "/gripper",
    "/frame",
]  # fmt: skip


@pytest.mark.parametrize("missing", FRAME_TOPICS)
def test_a_last_frame_that_lacks_a_message_does_not_count(tmp_path: Path, missing: str) -> None:
    seen = frames(3)
    source = write(tmp_path / "a.mcap", seen)
    last = len(seen) - 1
    cut = rewrite(
        source,
        tmp_path / "b.mcap",
        lambda topic, number, content: None if (topic, number) == (missing, last) else content,
    )
    with EpisodeReader(cut) as episode:
        assert len(episode) == last
        np.testing.assert_array_equal(episode.grasps, [one.grasp for one in seen[:last]])


@pytest.mark.parametrize("missing", FRAME_TOPICS)
def test_a_message_lost_in_the_middle_does_not_shift_the_others(
    tmp_path: Path, missing: str
) -> None:
    source = write(tmp_path / "a.mcap", frames(3))
    holed = rewrite(
        source,
        tmp_path / "b.mcap",
        lambda topic, number, content: None if (topic, number) == (missing, 1) else content,
    )
    with pytest.raises(BadEpisode, match="do not match the frames"):
        EpisodeReader(holed)


def test_an_episode_without_a_frame_is_empty(tmp_path: Path) -> None:
    with EpisodeReader(write(tmp_path / "a.mcap", [])) as episode:
        assert len(episode) == 0
        assert episode.kinds == ()
        assert episode.grasps.shape == (0, 3)
        assert episode.finished


def test_another_mcap_is_not_taken_for_an_episode(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    with pytest.raises(BadEpisode, match="not a dnet episode"):
        EpisodeReader(path)


@pytest.mark.parametrize(
    ("spoiled", "complaint"),
    [
        ({"schema_version": "2"}, "schema version 2, this dnet reads 1"),
        ({"seed": "x"}, "unreadable metadata"),
        ({"scene": "{}"}, "unreadable metadata"),
        ({"scene": "[" * 100_000}, "unreadable metadata"),
        ({"scene": json.dumps({"position": [1], "yaw": 0, "hold": [], "manipulation_point": []})},
         "are not 2 numbers"),
        ({"settings": "[1]"}, "unreadable metadata"),
        ({"settings": "{"}, "unreadable metadata"),
    ],
)  # fmt: skip
def test_spoiled_metadata_is_refused(
    tmp_path: Path, spoiled: dict[str, str], complaint: str
) -> None:
    source = write(tmp_path / "a.mcap", frames(2))
    with pytest.raises(BadEpisode, match=complaint):
        EpisodeReader(rewrite(source, tmp_path / "b.mcap", metadata=spoiled))


@pytest.mark.parametrize(
    ("topic", "content"),
    [
        ("/frame", b"not json"),
        ("/frame", b"[]"),
        ("/frame", b'{"index": 0, "kind": "rest", "time": "soon"}'),
        ("/frame", b'{"index": 0, "kind": ["rest"], "time": 0}'),
        ("/frame", b'{"index": 5, "kind": "rest", "time": 0}'),
        ("/frame", b'{"index": 0, "kind": "rest", "time": 1e999}'),
        ("/frame", b'{"index": 0, "kind": "rest", "time": 1' + b"0" * 400 + b"}"),
        ("/frame", b"[" * 100_000),
        ("/gripper", b"\xff\xff"),
        ("/joint_states", b""),
        ("/joint_states", b"\xff\xff"),
        ("/cloud/current", b"\xff\xff"),
        ("/cloud/nodes", b""),
    ],
)
def test_a_spoiled_message_is_refused(tmp_path: Path, topic: str, content: bytes) -> None:
    source = write(tmp_path / "a.mcap", frames(2))
    spoiled = rewrite(
        source,
        tmp_path / "b.mcap",
        lambda name, number, old: content if (name, number) == (topic, 0) else old,
    )

    def read() -> None:
        with EpisodeReader(spoiled) as episode:
            episode.frame(0)

    with pytest.raises(BadEpisode, match=f"b.mcap has an unreadable {topic}"):
        read()


@pytest.mark.parametrize(
    "content", [b"[]", b"{}", b'{"time": 0, "chamfer": 0, "motion": [1, 2]}', b"\x00"]
)
def test_a_spoiled_step_is_refused(tmp_path: Path, content: bytes) -> None:
    source = write_servo(tmp_path / "a.mcap")
    spoiled = rewrite(
        source, tmp_path / "b.mcap", lambda name, _, old: content if name == "/step" else old
    )
    with EpisodeReader(spoiled) as episode, pytest.raises(BadEpisode, match="unreadable /step"):
        episode.steps()

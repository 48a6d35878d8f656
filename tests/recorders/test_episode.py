import json
import subprocess
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rerun.chunk import McapReader

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BackInTime, BadNumber, OccupiedOutput
from dnet.geometry.camera import Camera
from dnet.geometry.pose import look_at
from dnet.recorders.arms import orientation_in_world
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.viewer_process import RERUN
from dnet.types import Transform
from tests.recorders.rollout import (
    ARMS,
    frame,
    frames,
    meta,
    step,
    with_image,
    write,
    write_servo,
)

TOPICS = {
    "/cloud/current": "foxglove.PointCloud",
    "/cloud/nodes": "foxglove.PointCloud",
    "/manipulation_point": "foxglove.PointCloud",
    "/joint_states": "foxglove.JointStates",
    "/tf": "foxglove.FrameTransforms",
    "/gripper": "foxglove.PoseInFrame",
    "/frame": "dnet.Frame",
    "/log": "foxglove.Log",
}


def decoded(path: Path, topic: str) -> list[tuple[int, Any]]:
    """Read with the stock reader, checksums on: an oracle apart from our own reader."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (message.log_time, content)
            for _, _, message, content in reader.iter_decoded_messages(topics=[topic])
        ]


def raw(path: Path, topic: str) -> list[dict[str, Any]]:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return [json.loads(message.data) for _, _, message in reader.iter_messages(topics=[topic])]


def test_each_topic_has_its_schema_and_one_message_a_frame(tmp_path: Path) -> None:
    seen = frames(4)
    path = write(tmp_path / "a.mcap", seen)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    schemas = {
        channel.topic: summary.schemas[channel.schema_id].name
        for channel in summary.channels.values()
    }
    assert schemas == TOPICS
    counts = summary.statistics.channel_message_counts
    by_topic = {channel.topic: counts[number] for number, channel in summary.channels.items()}
    assert {by_topic[topic] for topic in TOPICS if topic != "/log"} == {len(seen)}


def test_an_independent_reader_sees_the_very_numbers(tmp_path: Path) -> None:
    seen = frames(3)
    path = write(tmp_path / "a.mcap", seen)
    clouds = decoded(path, "/cloud/current")
    grippers = decoded(path, "/gripper")
    states = decoded(path, "/joint_states")
    assert len(clouds) == len(seen)
    for one, (time, cloud), (_, gripper), (_, state) in zip(
        seen, clouds, grippers, states, strict=True
    ):
        assert time == round(one.time * 1e9)
        assert cloud.frame_id == "world"
        np.testing.assert_array_equal(np.frombuffer(cloud.data, "<f4").reshape(-1, 3), one.cloud)
        position = gripper.pose.position
        np.testing.assert_array_equal([position.x, position.y, position.z], one.grasp)
        names = [joint.name for joint in state.joints]
        assert names[0] == "psm_left/yaw"
        assert names[11] == "psm_right/wrist_yaw"
        np.testing.assert_array_equal(
            [joint.position for joint in state.joints], np.concatenate(one.joints)
        )


def test_the_manipulation_point_is_one_coloured_point_at_the_grasp(tmp_path: Path) -> None:
    seen = frames(2)
    path = write(tmp_path / "a.mcap", seen)
    for one, (_, cloud) in zip(seen, decoded(path, "/manipulation_point"), strict=True):
        assert [field.name for field in cloud.fields] == [
            *"xyz", "red", "green", "blue", "alpha"
        ]  # fmt: skip
        assert len(cloud.data) == cloud.point_stride == 16
        np.testing.assert_array_equal(
            np.frombuffer(cloud.data[:12], "<f4"), one.grasp.astype(np.float32)
        )


def test_transforms_lead_from_the_world_to_the_grasp(tmp_path: Path) -> None:
    seen = frames(3)
    path = write(tmp_path / "a.mcap", seen)
    for one, (_, message) in zip(seen, decoded(path, "/tf"), strict=True):
        by_child = {entry.child_frame_id: entry for entry in message.transforms}
        assert all(entry.HasField("translation") for entry in message.transforms)
        place, at = np.zeros(3), "psm_right/tip_link"
        while at != "world":
            entry = by_child[at]
            x, y, z, w = (getattr(entry.rotation, axis) for axis in "xyzw")
            vector = np.array([x, y, z])
            place = place + 2 * np.cross(vector, np.cross(vector, place) + w * place)
            place = place + [getattr(entry.translation, axis) for axis in "xyz"]
            at = entry.parent_frame_id
        np.testing.assert_allclose(place, one.grasp, atol=1e-9)


def test_the_gripper_is_turned_as_its_tool(tmp_path: Path) -> None:
    one = frames(2)[-1]
    path = write(tmp_path / "a.mcap", [one])
    ((_, message),) = decoded(path, "/gripper")
    x, y, z, w = (getattr(message.pose.orientation, axis) for axis in "xyzw")
    along = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    np.testing.assert_allclose(
        along, ARMS.placement.arms[1].forward(one.joints[1])[:3, 2], atol=1e-9
    )


def test_a_camera_is_described_once_before_all_else(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    path = write(tmp_path / "a.mcap", frames(3), camera=camera)
    ((time, message),) = decoded(path, "/camera/calibration")
    assert time == 0
    assert (message.frame_id, message.width, message.height) == ("camera", 32, 24)
    assert message.distortion_model == "plumb_bob"
    assert list(message.D) == [0.0] * 5
    np.testing.assert_array_equal(message.R, np.eye(3).ravel())
    np.testing.assert_array_equal(message.K, camera.intrinsics.ravel())
    projection = np.array(message.P).reshape(3, 4)
    np.testing.assert_array_equal(projection[:, :3], camera.intrinsics)
    np.testing.assert_array_equal(projection[:, 3], np.zeros(3))
    with path.open("rb") as file:
        first = next(make_reader(file).iter_messages(log_time_order=False))
    assert first[1].topic == "/camera/calibration"


def test_every_frame_says_where_the_camera_stands(tmp_path: Path) -> None:
    camera = Camera(eye=(0.05, -0.3, 0.4))
    seen = frames(3)
    path = write(tmp_path / "a.mcap", seen, camera=camera)
    plain = write(tmp_path / "b.mcap", seen)
    wanted = look_at(np.array(camera.eye), np.array(camera.target))
    for (_, message), (_, without) in zip(decoded(path, "/tf"), decoded(plain, "/tf"), strict=True):
        *arms, entry = message.transforms
        assert list(map(str, arms)) == list(map(str, without.transforms))
        assert (entry.parent_frame_id, entry.child_frame_id) == ("world", "camera")
        place = [getattr(entry.translation, axis) for axis in "xyz"]
        np.testing.assert_array_equal(place, camera.eye)
        x, y, z, w = (getattr(entry.rotation, axis) for axis in "xyzw")
        forward = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        np.testing.assert_allclose(forward, wanted[:3, 2], atol=1e-12)


def test_images_are_logged_with_the_frames_that_have_them(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    seen = frames(3)
    seen[1] = with_image(seen[1], camera)
    path = write(tmp_path / "a.mcap", seen, camera=camera)
    ((depth_time, depth),) = decoded(path, "/camera/depth")
    ((mask_time, mask),) = decoded(path, "/camera/mask")
    assert depth_time == mask_time == round(seen[1].time * 1e9)
    image = seen[1].image
    assert image is not None
    for message, encoding, dtype, wanted in (
        (depth, "32FC1", "<f4", image.depth),
        (mask, "mono8", "u1", image.mask),
    ):
        assert (message.frame_id, message.encoding) == ("camera", encoding)
        assert (message.width, message.height) == (32, 24)
        assert message.step == 32 * np.dtype(dtype).itemsize
        np.testing.assert_array_equal(np.frombuffer(message.data, dtype).reshape(24, 32), wanted)


def test_rerun_hangs_the_images_on_the_camera_and_the_camera_in_the_world(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    path = write(tmp_path / "a.mcap", [with_image(frames(2)[0], camera)], camera=camera)
    found: dict[tuple[str, str], Any] = {}
    for chunk in McapReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            found[chunk.entity_path, name] = batch.column(name).to_pylist()
    ((parent,),) = found["/camera/calibration", "Pinhole:parent_frame"]
    ((plane,),) = found["/camera/calibration", "Pinhole:child_frame"]
    assert [parent] in found["/tf", "Transform3D:child_frame"]
    for topic in ("/camera/depth", "/camera/mask"):
        assert found[topic, "CoordinateFrame:frame"] == [[plane]]
        ((drawn,),) = found[topic, "Image:format"]
        assert (drawn["width"], drawn["height"]) == (32, 24)


def test_a_frame_that_hangs_on_itself_still_has_an_orientation() -> None:
    loop = [Transform("b", "a", np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])),
            Transform("a", "b", np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))]  # fmt: skip
    found = orientation_in_world(loop, "a")
    assert found is not None
    np.testing.assert_allclose(found, [0, 0, 0, 1])
    assert orientation_in_world(loop, "c") is None


def test_the_same_calls_write_the_same_bytes(tmp_path: Path) -> None:
    first = write_servo(tmp_path / "one" / "run.mcap").read_bytes()
    assert first == write_servo(tmp_path / "two" / "run.mcap").read_bytes()
    assert first != write(tmp_path / "run.mcap", frames(3)).read_bytes()


def test_wall_times_do_not_change_the_bytes(tmp_path: Path) -> None:
    seen, goal = frames(2)[0], frames(2)[-1]
    for name, milliseconds in (("slow", 900.0), ("fast", 1.0)):
        turn = step(seen, goal)
        assert turn.plan is not None
        turn = replace(turn, plan=replace(turn.plan, milliseconds=milliseconds))
        with EpisodeWriter(tmp_path / name, meta(), arms=ARMS, attachments={}) as writer:
            writer.add_step(turn, 0)
            writer.finish({})
    assert (tmp_path / "slow").read_bytes() == (tmp_path / "fast").read_bytes()


def assert_rerun_accepts(path: Path, topics: Iterable[str]) -> None:
    command = [*RERUN, "mcap", "check", "--full", str(path)]
    checked = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert checked.returncode == 0, checked.stderr
    for topic in topics:
        line = next(line for line in checked.stdout.splitlines() if f" {topic} " in line)
        assert line.startswith("ok"), line


def test_rerun_checks_it_without_complaint(tmp_path: Path) -> None:
    run = write_servo(tmp_path / "run.mcap")
    assert_rerun_accepts(run, (*TOPICS.keys() - {"/log"}, "/cloud/goal", "/step"))
    seen = [with_image(one, Camera()) for one in frames(2)]
    recording = write(tmp_path / "a.mcap", seen, camera=Camera())
    cameras = ("/camera/calibration", "/camera/depth", "/camera/mask")
    assert_rerun_accepts(recording, (*TOPICS.keys() - {"/log"}, *cameras))


def test_a_step_is_written_with_its_frame_and_only_once(tmp_path: Path) -> None:
    seen = frames(2)
    turn = step(seen[0], seen[-1])
    with EpisodeWriter(tmp_path / "a.mcap", meta(), arms=ARMS, attachments={}) as writer:
        writer.add(seen[0])
        writer.add_step(turn, 0)
        writer.add_step(step(seen[-1], seen[-1], planned=False), 1)
        assert len(writer) == 2
        writer.finish({})
    first, second = raw(tmp_path / "a.mcap", "/step")
    np.testing.assert_array_equal(first["motion"], turn.motion)
    assert first["chamfer"] == turn.chamfer
    assert first["plan"]["status"] == "straight"
    assert "milliseconds" not in json.dumps(first)
    assert (second["index"], second["motion"], second["plan"]) == (1, [0, 0, 0], None)


def test_a_finished_episode_is_never_overwritten(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", frames(2))
    before = path.read_bytes()
    with pytest.raises(OccupiedOutput, match=r"a\.mcap already holds an episode"):
        EpisodeWriter(path, meta(), arms=ARMS, attachments={})
    assert path.read_bytes() == before


def test_of_two_writers_of_one_path_the_second_does_not_win(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with EpisodeWriter(path, meta(), arms=ARMS, attachments={}) as writer:
        writer.add(frames(2)[0])
        path.write_bytes(b"somebody else's")
        with pytest.raises(OccupiedOutput):
            writer.finish({})
    assert path.read_bytes() == b"somebody else's"


def test_only_a_finished_episode_has_its_name(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with EpisodeWriter(path, meta(), arms=ARMS, attachments={}) as writer:
        writer.add(frames(2)[0])
        assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
        writer.finish({"x": 1})
        assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.parametrize("trouble", [RuntimeError("diverged"), KeyboardInterrupt()])
def test_an_interrupted_episode_keeps_its_frames_under_its_part_name(
    tmp_path: Path, trouble: BaseException
) -> None:
    path = tmp_path / "a.mcap"
    seen = frames(3)

    def interrupted() -> None:
        with EpisodeWriter(path, meta(), arms=ARMS, attachments={"a.txt": b"x"}) as writer:
            for one in seen:
                writer.add(one)
            raise trouble

    with pytest.raises(type(trouble)):
        interrupted()
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap.part"]
    with EpisodeReader(tmp_path / "a.mcap.part") as episode:
        assert not episode.finished
        assert episode.result is None
        assert episode.meta == meta()
        assert len(episode) == len(seen)
        np.testing.assert_array_equal(episode.cloud(4), seen[4].cloud)


def test_a_killed_process_loses_no_frame_that_was_added(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = EpisodeWriter(path, meta(), arms=ARMS, attachments={})
    seen = frames(3)
    for one in seen:
        writer.add(one)
    # What another process, or the same after SIGKILL, finds on the disk at this moment.
    left = writer.part.read_bytes()
    for one in seen:
        assert one.cloud.tobytes() in left
    writer.__exit__(None, None, None)


def test_time_does_not_run_backwards(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "a.mcap", meta(), arms=ARMS, attachments={}) as writer:
        writer.add(frame(1.0, np.zeros(3)))
        writer.add(frame(1.0, np.zeros(3)))
        with pytest.raises(BackInTime, match=r"0\.500000 s came after one at 1\.000000 s"):
            writer.add(frame(0.5, np.zeros(3)))
        assert len(writer) == 2


@pytest.mark.parametrize("what", ["cloud", "nodes", "grasp", "moving arm"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_diverged_frame_is_refused_and_leaves_no_trace(
    tmp_path: Path, what: str, bad: float
) -> None:
    good = frames(2)
    spoiled = good[1]
    arrays = {
        "cloud": spoiled.cloud.copy(),
        "nodes": spoiled.nodes.copy(),
        "grasp": spoiled.grasp.copy(),
        "moving arm": spoiled.joints[1].copy(),
    }
    arrays[what].flat[-1] = bad
    spoiled = replace(
        spoiled,
        cloud=arrays["cloud"],
        nodes=arrays["nodes"],
        grasp=arrays["grasp"],
        joints=(spoiled.joints[0], arrays["moving arm"]),
    )
    with EpisodeWriter(tmp_path / "a.mcap", meta(), arms=ARMS, attachments={}) as writer:
        writer.add(good[0])
        with pytest.raises(BadNumber, match=what):
            writer.add(spoiled)
        writer.add(good[2])
        writer.finish({})
    with EpisodeReader(tmp_path / "a.mcap") as episode:
        np.testing.assert_array_equal(episode.times, [good[0].time, good[2].time])


def test_a_depth_that_is_no_number_is_refused(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    spoiled = with_image(frames(2)[0], camera)
    assert spoiled.image is not None
    spoiled.image.depth[3, 4] = np.nan
    with EpisodeWriter(tmp_path / "a.mcap", meta(), arms=ARMS, attachments={}) as writer:
        with pytest.raises(BadNumber, match="depth"):
            writer.add(spoiled)
        assert len(writer) == 0


def test_a_goal_with_holes_is_refused(tmp_path: Path) -> None:
    cloud = frames(2)[0].cloud.copy()
    cloud[3, 1] = np.nan
    with EpisodeWriter(tmp_path / "a.mcap", meta(), arms=ARMS, attachments={}) as writer:
        with pytest.raises(BadNumber, match="goal"):
            writer.set_goal(cloud)
        writer.finish({})


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    result=st.dictionaries(
        st.text(max_size=8),
        st.recursive(
            st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
            lambda inner: (
                st.lists(inner, max_size=3)
                | st.dictionaries(st.text(max_size=4), inner, max_size=3)
            ),
            max_leaves=6,
        ),
        max_size=4,
    )
)
def test_any_result_comes_back(
    tmp_path_factory: pytest.TempPathFactory, result: dict[str, Any]
) -> None:
    path = tmp_path_factory.mktemp("result") / "a.mcap"
    with EpisodeWriter(path, meta(), arms=ARMS, attachments={}) as writer:
        writer.finish(result)
    with EpisodeReader(path) as episode:
        assert episode.finished
        assert episode.result == result


def test_a_result_may_hold_numpy_but_nothing_else_unknown(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "a.mcap", meta(), arms=ARMS, attachments={}) as writer:
        with pytest.raises(TypeError, match=r"cannot hold .*object.* of type object"):
            writer.finish({"x": object()})
        writer.finish({"x": np.float32(0.5), "y": np.arange(3), "z": Path("a/b"), "b": np.True_})
    with EpisodeReader(tmp_path / "a.mcap") as episode:
        assert episode.result == {"x": 0.5, "y": [0, 1, 2], "z": "a/b", "b": True}

"""Golden episodes: each version is read for ever, and none is changed without a new one."""

import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf.message import Message
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from dnet.datasets import reader
from dnet.datasets.reader import EpisodeReader
from dnet.recorders import episode as writer
from tests.recorders.golden import make

GOLDEN = Path(__file__).parent / "golden"
RECORDING, RUN = GOLDEN / make.RECORDING, GOLDEN / make.RUN
DIGESTS = {
    RECORDING: "7a98b450072399c177e01fe3e17a7223c90ba66a10882ed8165fcde159fd387f",
    RUN: "5a6859ab74fa012a46f52418a79b301c01e9179699bb7c7ae3ba008649ffd769",
}
DOCUMENT = Path(__file__).parents[2] / "recorders" / "README.md"
ANOTHER_VERSION = """is no longer what version 1 says. If that is meant: add 1 to SCHEMA_VERSION in
recorders/episode.py and datasets/reader.py, describe it in recorders/README.md, and put golden
files of the new version beside those of the old, which must stay readable."""


@pytest.mark.parametrize("path", DIGESTS, ids=lambda path: path.name)
def test_a_golden_file_stays_as_it_is(path: Path) -> None:
    assert hashlib.sha256(path.read_bytes()).hexdigest() == DIGESTS[path]


def test_every_value_of_the_golden_recording_is_read() -> None:
    with EpisodeReader(RECORDING) as episode:
        assert episode.meta == make.META
        assert episode.finished
        assert episode.result == make.RESULT
        assert_attachments(episode)
        assert len(episode) == 4
        assert episode.kinds == ("rest", "way", "shape", "shape")
        np.testing.assert_array_equal(episode.times, [0.25, 0.5, 0.75, 1.5])
        for index, wanted in enumerate(make.frames()):
            frame = episode.frame(index)
            assert_same_view(frame, wanted)
            assert frame.image is not None
            assert wanted.image is not None
            np.testing.assert_array_equal(frame.image.depth, wanted.image.depth)
            np.testing.assert_array_equal(frame.image.mask, wanted.image.mask)
            assert_transforms(episode, index, wanted)
        np.testing.assert_array_equal(episode.grasps, [one.grasp for one in make.frames()])
        assert_camera(episode)
        assert episode.goal() is None
        assert episode.steps() == []
        assert episode.lines() == [
            (0.25, "frame 0: rest"),
            (0.75, "frame 2: shape"),
            (1.5, "frame 3: shape"),
        ]


def test_every_value_of_the_golden_run_is_read() -> None:
    with EpisodeReader(RUN) as episode:
        assert episode.meta == make.RUN_META
        assert episode.result == make.RUN_RESULT
        assert_attachments(episode)
        assert_camera(episode)
        assert episode.kinds == ("rest", "shape")
        for index, step in enumerate(make.steps()):
            assert_same_view(episode.frame(index), step.frame)
            assert episode.image(index) is None
            assert_transforms(episode, index, step.frame)
        goal = episode.goal()
        assert goal is not None
        np.testing.assert_array_equal(goal, make.goal())
        plan = {
            "status": "rrt_connect",
            "requested": [0.0, 0.03125, 0.0156],
            "achieved": [0.0, 0.03125, 0.015625],
            "reason": "the straight line meets the other arm",
            "checks": 37,
        }
        motions = [0.0, 0.03125, 0.0156], [0.0005, 0.0, -0.001]
        assert episode.steps() == [
            {"index": 0, "time": 0.25, "chamfer": 0.0185, "motion": motions[0], "plan": plan},
            {"index": 1, "time": 1.5, "chamfer": 0.00125, "motion": motions[1], "plan": None},
        ]
        why = "rrt_connect (the straight line meets the other arm)"
        assert episode.lines() == [
            (0.25, f"step 0: Chamfer 18.50 mm, motion 34.9 mm, plan {why}"),
            (1.5, "step 1: Chamfer 1.25 mm, motion 1.1 mm"),
        ]


@pytest.mark.parametrize(
    ("golden", "write"), [(RECORDING, make.write_recording), (RUN, make.write_run)]
)
def test_the_same_calls_write_the_same_messages_as_ever(
    tmp_path: Path, golden: Path, write: Callable[[Path], Path]
) -> None:
    today = write(tmp_path / golden.name)
    then, now = messages(golden), messages(today)
    for topic, wanted in then.items():
        assert now.get(topic) == wanted, f"{topic} {ANOTHER_VERSION}"
    # What is new may stand between what was there, but does not reorder it.
    order = [topic for topic in topics(today) if topic in then]
    assert order == topics(golden), f"the order of records {ANOTHER_VERSION}"
    records = metadata(today)
    for name, wanted_record in metadata(golden).items():
        for key, value in wanted_record.items():
            assert records[name].get(key) == value, f"{key} of {name} {ANOTHER_VERSION}"
    held = attachments(today)
    for name, content in attachments(golden).items():
        assert held.get(name) == content, f"attachment {name} {ANOTHER_VERSION}"


def test_reader_writer_and_document_speak_of_one_version() -> None:
    assert reader.SCHEMA_VERSION == writer.SCHEMA_VERSION
    assert f'schema version "{writer.SCHEMA_VERSION}"' in DOCUMENT.read_text().splitlines()[0]
    assert f"| `schema_version` | text | `{writer.SCHEMA_VERSION}` |" in DOCUMENT.read_text()


@pytest.mark.parametrize("path", [RECORDING, RUN], ids=lambda path: path.name)
def test_the_document_names_all_that_an_episode_holds(path: Path) -> None:
    named = set(re.findall(r"`([^`\n]+)`", DOCUMENT.read_text()))
    assert set(messages(path)) <= named
    assert set(attachments(path)) <= named
    assert {kind for kind, _ in attachments(path).values()} <= named
    for name, record in metadata(path).items():
        assert {name, *record} <= named
        if "scene" in record:
            assert set(keys(json.loads(record["scene"]))) <= named
        if "settings" in record:
            assert json.loads(record["settings"]).keys() - {"note"} <= named
    with path.open("rb") as file:
        found = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message in found.iter_messages():
            assert schema is not None
            assert schema.name in named
            if channel.message_encoding == "json":
                assert set(keys(json.loads(message.data))) <= named
        decodable = [topic for topic in messages(path) if topic not in ("/frame", "/step")]
        for *_, content in found.iter_decoded_messages(topics=decodable):
            missing = set(fields(content)) - named
            assert not missing, f"{content.DESCRIPTOR.full_name} has {missing}"


def test_the_document_tells_how_to_read_an_episode(tmp_path: Path) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    shutil.copyfile(RECORDING, tmp_path / "episode.mcap")
    command = [sys.executable, "-W", "error", "-c", example]
    said = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert said.returncode == 0, said.stderr
    first, *rest = said.stdout.splitlines()
    assert first == "episode-5-00007 finished"
    for line, frame in zip(rest, make.frames(), strict=True):
        assert line.endswith(f"{frame.kind} {frame.time} (32, 3) {frame.cloud.mean(axis=0)}")


def test_golden_clouds_are_in_farthest_point_order() -> None:
    for frame in make.frames():
        away = np.linalg.norm(frame.cloud - frame.cloud[0], axis=1)
        for index in range(1, len(frame.cloud)):
            assert away[index] == away.max() > 0
            nearer = np.linalg.norm(frame.cloud - frame.cloud[index], axis=1)
            away = np.minimum(away, nearer)


def assert_same_view(frame: Any, wanted: Any) -> None:
    assert (frame.time, frame.kind) == (wanted.time, wanted.kind)
    np.testing.assert_array_equal(frame.cloud, wanted.cloud)
    np.testing.assert_array_equal(frame.nodes, wanted.nodes)
    np.testing.assert_array_equal(frame.grasp, wanted.grasp)
    np.testing.assert_array_equal(frame.joints, wanted.joints)


def assert_transforms(episode: EpisodeReader, index: int, frame: Any) -> None:
    *links, camera = episode.transforms(index)
    for found, wanted in zip(links, make.PlainArms().transforms(frame.joints), strict=True):
        assert (found.parent, found.child) == (wanted.parent, wanted.child)
        np.testing.assert_array_equal(found.translation, wanted.translation)
        np.testing.assert_array_equal(found.rotation, wanted.rotation)
    assert (camera.parent, camera.child) == ("world", "camera")
    np.testing.assert_array_equal(camera.translation, [0.0, 0.0, 0.5])
    np.testing.assert_array_equal(camera.rotation, [1.0, 0.0, 0.0, 0.0])


def assert_camera(episode: EpisodeReader) -> None:
    camera = episode.camera()
    assert camera is not None
    assert (camera.width, camera.height) == (8, 6)
    np.testing.assert_array_equal(camera.intrinsics, [[8, 0, 4], [0, 8, 2], [0, 0, 1]])
    np.testing.assert_array_equal(camera.pose[:3, 3], [0.0, 0.0, 0.5])
    np.testing.assert_allclose(camera.pose[:3, :3], np.diag([1, -1, -1]), atol=1e-15)


def assert_attachments(episode: EpisodeReader) -> None:
    held = {name: episode.attachment(name) for name in episode.attachments}
    assert held == make.ATTACHMENTS


def messages(path: Path) -> dict[str, list[tuple[Any, ...]]]:
    """Return all of every message by topic, with its schema's name and our own schemas."""
    found = defaultdict(list)
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            ours = schema.data if schema.encoding == "jsonschema" else b""
            kind = (schema.name, schema.encoding, channel.message_encoding, ours)
            times = (message.log_time, message.publish_time, message.sequence)
            found[channel.topic].append((*kind, *times, message.data))
    return dict(found)


def topics(path: Path) -> list[str]:
    """Return the topic of each message, in the order of the file."""
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(log_time_order=False)
        return [channel.topic for _, channel, _ in found]


def metadata(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as file:
        return {record.name: record.metadata for record in make_reader(file).iter_metadata()}


def attachments(path: Path) -> dict[str, tuple[str, bytes]]:
    """Return media type and content of each attachment."""
    with path.open("rb") as file:
        found = make_reader(file).iter_attachments()
        return {entry.name: (entry.media_type, entry.data) for entry in found}


def fields(message: Message) -> Iterator[str]:
    """Yield the name of every field that is set, within messages too; times have no parts."""
    for field, value in message.ListFields():
        yield field.name
        if isinstance(value, Message):
            if value.DESCRIPTOR.full_name != "google.protobuf.Timestamp":
                yield from fields(value)
        elif field.message_type is not None:
            for entry in value:
                yield from fields(entry)


def keys(record: Any, above: str = "") -> Iterator[str]:
    """Yield every key of nested records, joined by dots."""
    for key, value in record.items() if isinstance(record, dict) else ():
        yield f"{above}{key}"
        yield from keys(value, f"{above}{key}.")

import hashlib
import json
import shutil
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from mcap.opcode import Opcode
from mcap.writer import CompressionType

from dnet.commands.inspect_validate import Validate
from dnet.errors import FaultyEpisodes, MissingPath, NoEpisodes, TooFew
from dnet.geometry.camera import Camera
from dnet.recorders import messages
from dnet.recorders.episode import EpisodeWriter
from dnet.tools.validate import Validation, validate
from dnet.tools.validate_findings import LONGEST, MOST_ALIKE
from dnet.types import Frame
from tests.datasets.surgery import Change, Message, mend, only, records, rewrite
from tests.recorders.rollout import ARMS, frames, meta, with_image, write, write_servo

CAMERA = Camera(width=8, height=6)
POINTS = 16


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("source") / "a.mcap", few())


@pytest.fixture(scope="module")
def pictured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    seen = [with_image(one, CAMERA) for one in few()]
    return write(tmp_path_factory.mktemp("source") / "a.mcap", seen, camera=CAMERA)


@pytest.fixture(scope="module")
def servo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_servo(tmp_path_factory.mktemp("source") / "a.mcap")


def few(count: int = 3) -> list[Frame]:
    return frames(count, points=POINTS)


def checks(validation: Validation, severity: str = "error") -> set[str]:
    return {one.check for one in validation.findings if one.severity == severity}


def cloud(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[bytes], bytes]:
    """Change the points of a cloud message, which are the last frame's."""
    points = change(few()[1].cloud.copy())
    return lambda _old: messages.point_cloud(points, 0).SerializeToString()


def without_first(points: np.ndarray) -> np.ndarray:
    return points[1:]


def not_a_number(points: np.ndarray) -> np.ndarray:
    points[3, 1] = np.nan
    return points


def grip(content: bytes, *, position: float = 0.0, rotation: float = 1.0) -> bytes:
    message = PoseInFrame.FromString(content)
    message.pose.position.x += position
    for axis in "xyzw":
        value = getattr(message.pose.orientation, axis)
        setattr(message.pose.orientation, axis, value * rotation)
    return message.SerializeToString()


def turn(content: bytes) -> bytes:
    message = FrameTransforms.FromString(content)
    message.transforms[-1].rotation.w += 0.5
    return message.SerializeToString()


def in_degrees(content: bytes) -> bytes:
    message = JointStates.FromString(content)
    for joint in message.joints:
        joint.position = float(np.rad2deg(joint.position))
    return message.SerializeToString()


def without_joint(content: bytes) -> bytes:
    message = JointStates.FromString(content)
    del message.joints[0]
    return message.SerializeToString()


def edit(**changes: Any) -> Callable[[bytes], bytes]:
    return lambda content: json.dumps(json.loads(content) | changes).encode()


def depth(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[bytes], bytes]:
    image = with_image(few()[1], CAMERA).image
    assert image is not None
    return lambda _old: messages.raw_image(change(image.depth), 0).SerializeToString()


def shift(topic: str, number: int, time: int) -> Change:
    return lambda one: [
        replace(one, time=time) if (one.topic, one.number) == (topic, number) else one
    ]


def test_whole_episodes_have_no_faults(tmp_path: Path) -> None:
    pictured = [with_image(one, CAMERA) for one in few()]
    write(tmp_path / "a.mcap", few())
    write(tmp_path / "b.mcap", pictured, camera=CAMERA)
    write_servo(tmp_path / "c.mcap")
    for kind in (CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4):
        directory = tmp_path / kind.name
        directory.mkdir()
        rewrite(tmp_path / "b.mcap", directory / "b.mcap", compression=kind)
    seen: list[tuple[int, int]] = []
    paths = [tmp_path, *sorted(path for path in tmp_path.iterdir() if path.is_dir())]
    found = validate(paths, on_file=lambda done, total: seen.append((done, total)))
    assert found == Validation(6, ())
    assert seen == [(done, 6) for done in range(1, 7)]


@pytest.mark.parametrize(
    ("topic", "content", "wanted"),
    [
        ("/cloud/current", cloud(not_a_number), {"not-finite"}),
        ("/cloud/nodes", cloud(lambda points: 1e3 * points[::2]), {"units"}),
        ("/cloud/current", cloud(without_first), {"points"}),
        ("/cloud/current", lambda _old: b"\xff\xff", {"message"}),
        ("/manipulation_point", cloud(lambda points: points), {"message"}),
        ("/manipulation_point", cloud(lambda points: points[:1]), {"grasp"}),
        ("/gripper", lambda old: grip(old, position=1e-6), {"grasp"}),
        ("/gripper", lambda old: grip(old, rotation=2.0), {"quaternion"}),
        ("/gripper", lambda old: grip(old, position=np.inf), {"not-finite"}),
        ("/gripper", lambda old: grip(old, position=1e300), {"grasp", "units"}),
        ("/tf", turn, {"quaternion"}),
        ("/tf", lambda _old: b"", {"message"}),
        ("/joint_states", in_degrees, {"units"}),
        ("/joint_states", without_joint, {"message"}),
        ("/frame", edit(index=5), {"frame-index"}),
        ("/frame", edit(index=1.0), {"message"}),
        ("/frame", edit(kind="other"), {"message"}),
        ("/frame", edit(time=0.51), {"frame-time"}),
        ("/frame", edit(time=1e300), {"message"}),
        ("/frame", edit(time=float("nan")), {"not-finite"}),
        ("/camera/depth", depth(lambda pixels: 1e3 * pixels), {"units"}),
        ("/camera/depth", depth(lambda pixels: pixels[1:]), {"images"}),
        ("/camera/depth", depth(lambda pixels: np.nan * pixels), {"not-finite"}),
        ("/camera/mask", lambda _old: None, {"images"}),
        ("/cloud/nodes", lambda _old: None, {"frame-count", "frame-time"}),
        ("/frame", lambda _old: None,
            {"frame-count", "frame-time", "frame-index", "result-frames", "images"}),
    ],
)  # fmt: skip
def test_a_spoiled_message_is_found_by_its_own_check(
    tmp_path: Path,
    pictured: Path,
    topic: str,
    content: Callable[[bytes], bytes | None],
    wanted: set[str],
) -> None:
    with np.errstate(invalid="ignore"):
        path = rewrite(pictured, tmp_path / "a.mcap", only(topic, 1, content))
    found = validate([path])
    assert checks(found) == wanted
    assert {one.file for one in found.findings} == {str(path)}


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        (lambda _old: b"[]", {"message"}),
        (edit(index=7), {"step-index"}),
        (edit(chamfer=float("inf")), {"not-finite"}),
    ],
)
def test_a_spoiled_step_is_found(
    tmp_path: Path, servo: Path, content: Callable[[bytes], bytes], wanted: set[str]
) -> None:
    path = rewrite(servo, tmp_path / "a.mcap", only("/step", 1, content))
    assert checks(validate([path])) == wanted


def test_time_that_runs_backwards_is_found(tmp_path: Path, source: Path) -> None:
    path = rewrite(source, tmp_path / "a.mcap", shift("/log", 1, 5))
    assert checks(validate([path])) == set()
    path = rewrite(source, tmp_path / "a.mcap", shift("/cloud/current", 4, 5))
    found = validate([path])
    assert checks(found) == {"time-order", "frame-time"}
    assert (
        found.findings[0].what
        == "/cloud/current 4 is from 5 ns, the one before it from 1500000000 ns"
    )


def test_a_topic_that_is_none_is_named(tmp_path: Path, source: Path) -> None:
    path = rewrite(
        source,
        tmp_path / "a.mcap",
        lambda one: [one, replace(one, topic="/more")] if one.topic == "/frame" else [one],
    )
    found = validate([path])
    assert (found.errors, checks(found, "warning")) == (0, {"topic"})


@pytest.mark.parametrize(
    ("schemas", "severity"),
    [
        (lambda name, encoding, data: (name.replace("Pose", "Rose"), encoding, data), "error"),
        (lambda name, _encoding, data: (name, "ros2msg", data), "error"),
        (lambda name, encoding, data: (name, encoding, data + b" "), "warning"),
    ],
)
def test_another_schema_is_found(
    tmp_path: Path, source: Path, schemas: Callable[..., tuple[str, str, bytes]], severity: str
) -> None:
    found = validate([rewrite(source, tmp_path / "a.mcap", schemas=schemas)])
    assert checks(found) | checks(found, "warning") == {"schema"}
    assert {one.severity for one in found.findings} == {severity}


def test_another_encoding_is_found(tmp_path: Path, source: Path) -> None:
    path = rewrite(source, tmp_path / "a.mcap", encodings={"/frame": "cbor"})
    (one,) = validate([path]).findings
    assert (one.check, one.what) == ("schema", "/frame has message encoding 'cbor', must be 'json'")


@pytest.mark.parametrize(
    ("record", "changes", "wanted"),
    [
        ("dnet.episode", None, {"metadata"}),
        ("dnet.episode", {"schema_version": "9"}, {"schema-version"}),
        ("dnet.episode", {"scene": None}, {"metadata"}),
        ("dnet.episode", {"scene": "{}"}, {"metadata"}),
        ("dnet.episode", {"seed": "9" * 5000}, {"metadata"}),
        ("dnet.episode", {"settings": '{"laboratory": {"points": 2048}}'}, {"points"}),
        ("dnet.episode", {"settings": '{"points": 2048}'}, {"points"}),
        ("dnet.episode", {"settings": f'{{"points": {POINTS}}}'}, set()),
        ("dnet.result", None, {"unfinished"}),
        ("dnet.result", {"frames": "99"}, {"result-frames"}),
        ("dnet.result", {"frames": "[" * 100_000}, {"metadata"}),
    ],
)
def test_spoiled_metadata_are_found(
    tmp_path: Path,
    source: Path,
    record: str,
    changes: dict[str, str | None] | None,
    wanted: set[str],
) -> None:

    def change(name: str, old: dict[str, str]) -> dict[str, str] | None:
        if name != record:
            return old
        if changes is None:
            return None
        return {key: value for key, value in (old | changes).items() if value is not None}

    assert checks(validate([rewrite(source, tmp_path / "a.mcap", metadata=change)])) == wanted


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("psm.urdf", b"<robot>"),
        ("psm.urdf", b"<html/>"),
        ("psm.urdf", b""),
        ("psm.urdf", b'<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>'),
        ("config.json", b"{"),
        ("config.json", b"[" * 100_000),
    ],
)
def test_an_attachment_that_is_not_what_its_name_says_is_found(
    tmp_path: Path, source: Path, name: str, content: bytes
) -> None:
    path = rewrite(source, tmp_path / "a.mcap", attachments={name: content})
    (one,) = validate([path]).findings
    assert (one.severity, one.check) == ("error", "attachment")
    assert one.what.startswith(f"{name} cannot be parsed: ")


def place(content: bytes | bytearray, opcode: int, number: int = 0) -> int:
    """Where the body of a record begins."""
    return [one.start + 9 for one in records(content) if one.opcode == opcode][number]


@pytest.mark.parametrize(
    ("opcode", "offset", "wanted"),
    [
        (Opcode.STATISTICS, 0, {"statistics"}),
        (Opcode.STATISTICS, 14, {"statistics"}),
        (Opcode.STATISTICS, 26, {"statistics"}),
        (Opcode.STATISTICS, 48, {"statistics"}),
        (Opcode.CHUNK_INDEX, 0, {"chunk-index"}),
        (Opcode.ATTACHMENT_INDEX, 16, {"attachment-index"}),
        (Opcode.METADATA_INDEX, 8, {"metadata-index"}),
        (Opcode.CHUNK, 0, {"chunk-index"}),
        (Opcode.MESSAGE_INDEX, 6, {"message-index"}),
        (Opcode.MESSAGE_INDEX, 14, {"message-index"}),
        (Opcode.ATTACHMENT, 0, {"attachment-index"}),
        (Opcode.CHANNEL, 4 + 4, {"channel"}),
    ],
)
def test_an_index_that_does_not_agree_with_the_data_is_found(
    tmp_path: Path, source: Path, opcode: int, offset: int, wanted: set[str]
) -> None:
    """All checksums are right: only the parts contradict each other."""
    content = bytearray(source.read_bytes())
    content[place(content, opcode) + offset] ^= 1
    path = tmp_path / "a.mcap"
    path.write_bytes(mend(content))
    found = validate([path])
    assert checks(found) == wanted
    assert not checks(found, "warning")


def test_checksums_that_are_not_there_are_warned_of(tmp_path: Path, source: Path) -> None:
    content = bytearray(source.read_bytes())
    path = tmp_path / "a.mcap"
    struct.pack_into("<I", content, place(content, Opcode.DATA_END), 0)
    struct.pack_into("<I", content, place(content, Opcode.FOOTER) + 16, 0)
    path.write_bytes(content)
    found = validate([path])
    assert (found.errors, checks(found, "warning")) == (0, {"no-checksum"})
    assert [one.what.split(" has ")[0] for one in found.findings] == ["the data", "the summary"]
    path.write_bytes(mend(content, crc=lambda _content: 0))
    found = validate([path])
    assert (found.errors, checks(found, "warning")) == (0, {"no-checksum"})
    assert found.findings[-1].what == "and 4 more of these"


def test_bytes_between_data_and_summary_are_found(tmp_path: Path, source: Path) -> None:
    content = bytearray(source.read_bytes())
    footer = place(content, Opcode.FOOTER)
    start = struct.unpack_from("<Q", content, footer)[0]
    first = next(one for one in records(content) if one.start == start)
    struct.pack_into("<Q", content, footer, first.end)
    path = tmp_path / "a.mcap"
    path.write_bytes(mend(content))
    assert checks(validate([path])) == {"summary"}


def interrupted(path: Path, attachments: dict[str, bytes] | None = None) -> Path:
    with EpisodeWriter(path, meta(path.stem), arms=ARMS, attachments=attachments or {}) as writer:
        for one in few():
            writer.add(one)
    return writer.part


def test_unfinished_recordings_are_warned_of_under_their_part_name_alone(tmp_path: Path) -> None:
    part = interrupted(tmp_path / "a.mcap")
    killed = tmp_path / "b.mcap.part"
    killed.write_bytes(part.read_bytes()[:-300])
    found = validate([tmp_path])
    assert [(one.severity, one.check, one.file) for one in found.findings] == [
        ("warning", "unfinished", str(part)),
        ("warning", "unfinished", str(killed)),
    ]
    assert "whole frames are readable" in found.findings[0].what
    part.replace(tmp_path / "a.mcap")
    assert checks(validate([tmp_path / "a.mcap"])) == {"unfinished"}


@pytest.mark.parametrize("content", [b"", b"something else", b"\x89MCAP0\r\n" * 2])
def test_a_file_that_cannot_be_opened_is_one_finding(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    found = validate([tmp_path])
    assert [(one.severity, one.check) for one in found.findings] == [("error", "unreadable")]
    assert found.episodes == 1


def test_two_recordings_of_one_id_are_found(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", few(), name="a")
    write(tmp_path / "b.mcap", few(), name="a")
    write(tmp_path / "other" / "a.mcap", few(), name="a")
    found = validate([tmp_path, tmp_path / "other", tmp_path / "a.mcap"])
    assert found.episodes == 3
    assert [(one.check, one.severity, Path(one.file).name) for one in found.findings] == [
        ("episode-id", "warning", "b.mcap"),
        ("episode-id", "error", "b.mcap"),
    ]


def manifest(directory: Path, **changes: Any) -> dict[str, Any]:
    episodes = {
        path.stem: {
            "bytes": path.stat().st_size,
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "frames": 5,
        }
        | changes
        for path in directory.glob("*.mcap")
    }
    return {"episodes": episodes}


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({}, None),
        ({"bytes": 7}, "not the 7 it had"),
        ({"sha256": "0"}, "has SHA-256"),
        ({"frames": 6}, "a.mcap has 5 frames, not 6"),
    ],
)
def test_the_manifest_is_held_against_the_files(
    tmp_path: Path, source: Path, changes: dict[str, Any], what: str | None
) -> None:
    shutil.copy(source, tmp_path / "a.mcap")
    path = tmp_path / "manifest.json"
    path.write_text(json.dumps(manifest(tmp_path, **changes)))
    found = validate([tmp_path]).findings
    assert len(found) == (what is not None)
    for one in found:
        assert (one.severity, one.check, one.file) == ("error", "manifest", str(path))
        assert what is not None
        assert what in one.what


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{}", b'{"episodes": 3}', b"\xff", b"[" * 100_000]
)
def test_a_manifest_that_is_none_is_found(tmp_path: Path, source: Path, content: bytes) -> None:
    shutil.copy(source, tmp_path / "a.mcap")
    (tmp_path / "manifest.json").write_bytes(content)
    assert checks(validate([tmp_path])) == {"manifest"}


def test_a_manifest_that_names_others_makes_nobody_open_them(tmp_path: Path, source: Path) -> None:
    directory = tmp_path / "data"
    directory.mkdir()
    shutil.copy(source, directory / "a.mcap")
    (tmp_path / "secret.mcap").write_bytes(b"not to be read")
    listed = {"episodes": {"../secret": {"bytes": 1, "sha256": "0"}, "b": {}}}
    (directory / "manifest.json").write_text(json.dumps(listed))
    found = validate([directory])
    assert (found.errors, found.episodes) == (0, 1)
    assert [one.what.split(";")[0] for one in found.findings] == [
        "../secret.mcap is not there",
        "b.mcap is not there",
        "a.mcap is not in it",
    ]


def test_findings_of_a_kind_are_told_so_often_and_then_counted(tmp_path: Path) -> None:
    def spoil(one: Message) -> list[Message]:
        return [replace(one, content=b"\xff")] if one.topic == "/cloud/nodes" else [one]

    source = write(tmp_path / "source" / "a.mcap", few(8))
    found = validate([rewrite(source, tmp_path / "a.mcap", spoil)])
    assert len(found.findings) == MOST_ALIKE + 1
    assert found.findings[-1].what == f"and {15 - MOST_ALIKE} more of these"


def test_a_name_in_the_file_steers_no_terminal(tmp_path: Path, source: Path) -> None:
    name = "\x1b[2J\n" + "x" * 10_000
    rewrite(
        source,
        tmp_path / "a.mcap",
        lambda one: [one, replace(one, topic=name)] if one.topic == "/log" else [one],
    )
    (one,) = validate([tmp_path]).findings
    assert one.what.startswith("\\x1b[2J\\nxxx")
    assert len(one.what) < LONGEST + 20


def run(*arguments: str | Path) -> None:
    tyro.cli(Validate, args=[str(argument) for argument in arguments]).run()


def test_the_command_says_that_there_is_no_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "a.mcap", few())
    write(tmp_path / "b.mcap", few())
    run(tmp_path)
    assert capsys.readouterr() == ("2 episodes, no faults\n", "")


def test_the_command_prints_the_findings_and_then_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.mcap").write_bytes(b"something else")
    interrupted(tmp_path / "b.mcap")
    with pytest.raises(FaultyEpisodes, match="1 errors and 1 warnings in 2 episodes"):
        run(tmp_path)
    header, error, warning, last = capsys.readouterr().out.splitlines()
    assert header.split() == ["file", "severity", "check", "note"]
    assert error.split()[:3] == [str(tmp_path / "a.mcap"), "error", "unreadable"]
    assert warning.split()[1:3] == ["warning", "unfinished"]
    assert last == "1 errors, 1 warnings in 2 episodes"
    with pytest.raises(FaultyEpisodes):
        run(tmp_path, "--json")
    said = json.loads(capsys.readouterr().out)
    assert (said["errors"], said["warnings"], said["episodes"]) == (1, 1, 2)
    assert [one["check"] for one in said["findings"]] == ["unreadable", "unfinished"]


def test_warnings_fail_only_where_they_are_to(tmp_path: Path) -> None:
    interrupted(tmp_path / "a.mcap")
    run(tmp_path)
    with pytest.raises(FaultyEpisodes, match="0 errors and 1 warnings"):
        run(tmp_path, "--strict")


def test_nothing_to_validate_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingPath, match="nowhere"):
        validate([tmp_path / "nowhere"])
    with pytest.raises(NoEpisodes):
        validate([tmp_path])
    with pytest.raises(TooFew):
        validate([])

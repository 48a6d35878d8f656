"""A scene in Rerun: the object, its goal, the two arms, and what is planned and measured.

Servo runs and replayed episodes log the same entities, so one blueprint shows both.
"""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
from jaxtyping import Float64
from rerun.urdf import UrdfTree

from dnet.recorders.arms import ArmModel
from dnet.recorders.goal_distance import Colors, Distances
from dnet.types import ARMS, Cloud, Frame, JointPath, Joints, Latency, Point, Transform

WORLD = "world"
TIME_TIMELINE = "sim_time"

CURRENT, GOAL = "cloud/current", "cloud/goal"
MANIPULATION_POINT, MOTION, TIP_PATH, TABLE = "manipulation_point", "motion", "plan/tip", "table"
CHAMFER, MOTION_LENGTH, LATENCY, JOINTS = "chamfer", "motion_length", "latency", "joints"
LOG = "log"
TRUE_MOTION, LEGACY, NODES = "motion/true", "legacy", "node_distance"
DISTANCES = {"chamfer": CHAMFER, "legacy": LEGACY, "nodes": NODES}
"""The curve of each figure of `GoalDistance`."""

STAGES = ("observe", "predict", "plan", "execute", "log")
"""Of a turn of the servo loop, as `Latency` names them."""

CURRENT_COLOR = (92, 158, 255)
GOAL_COLOR = (64, 190, 96)
POINT_COLOR = (255, 72, 48)
MOTION_COLOR = (255, 196, 0)
TRUE_COLOR = (245, 245, 245)
FLOOR_COLOR = (150, 150, 158)
PATH_COLOR = (226, 110, 255)
TABLE_COLOR = (58, 60, 68)

POINT_RADIUS = 0.0009
"""Of a cloud's points: half the spacing of 2048 points on an object of 10 cm, in metres."""
TABLE_SIZE = (0.34, 0.26, 0.004)


class RerunScene:
    """Logs the values of `dnet.types` to a Rerun recording.

    Args:
        recording: The stream to log to.
        urdf: The URDF of one arm, drawn once for each; empty draws no arms.
        counter: Name of the timeline that counts what is logged, such as "step".
        place: Where its entities hang, so that one recording can hold several scenes.
    """

    def __init__(
        self, recording: rr.RecordingStream, *, urdf: str, counter: str, place: str = ""
    ) -> None:
        self.recording = recording
        self.place = place
        self._counter = counter
        # Entities without a named frame hang on the implicit root, which stands in the world.
        recording.log("/", rr.Transform3D(parent_frame=WORLD, child_frame="tf#/"), static=True)
        self._log_table()
        if urdf:
            self._log_arms(urdf)
        self._name_series()

    def set_time(self, seconds: float, *, count: int | None = None) -> None:
        """Set where on the timelines the next values go; without a count, on time alone."""
        self.recording.set_time(TIME_TIMELINE, duration=seconds)
        if count is None:
            self.recording.disable_timeline(self._counter)
        else:
            self.recording.set_time(self._counter, sequence=count)

    def log_goal(self, cloud: Cloud, *, label: str = "goal") -> None:
        """Log the shape to reach, for all times."""
        points = rr.Points3D(_aligned(cloud), colors=GOAL_COLOR, radii=0.8 * POINT_RADIUS)
        self._static(GOAL, points)
        if len(cloud):
            # The corner nearest to the lower right of the view, away from the arms.
            corner = cloud[(cloud[:, 0] - cloud[:, 2]).argmax()]
            text = rr.Points3D(
                [corner], labels=[label], show_labels=True, colors=GOAL_COLOR, radii=POINT_RADIUS
            )
            self._static(f"{GOAL}/label", text)

    def log_cloud(self, cloud: Cloud, colors: Colors | None = None) -> None:
        """Log the visible surface, in one colour or each point in its own."""
        chosen = CURRENT_COLOR if colors is None else colors
        points = rr.Points3D(_aligned(cloud), colors=chosen, radii=POINT_RADIUS)
        self._log(CURRENT, points)

    def log_manipulation_point(self, point: Point) -> None:
        """Log where the moving arm holds the object."""
        self._log(MANIPULATION_POINT, rr.Points3D([point], colors=POINT_COLOR, radii=0.003))

    def log_frame(
        self, frame: Frame, transforms: Sequence[Transform], distances: Distances | None = None
    ) -> None:
        """Log what was seen and where the arms were, and how far it is from the goal."""
        self.log_cloud(frame.cloud, None if distances is None else distances.colors)
        if distances is not None:
            self.log_distances(frame.grasp, distances)
        self.log_manipulation_point(frame.grasp)
        self.log_transforms(transforms)
        self.log_joints(frame.joints)

    def log_motion(self, grasp: Point, motion: Point) -> None:
        """Log a motion of the grasp as an arrow, and its length as a curve."""
        arrow = rr.Arrows3D(origins=[grasp], vectors=[motion], colors=MOTION_COLOR, radii=0.0012)
        self._log(MOTION, arrow)
        self.log_scalar(MOTION_LENGTH, 1e3 * float(np.linalg.norm(motion)))

    def log_distances(self, grasp: Point, distances: Distances) -> None:
        """Log curves of how far a frame is from the goal, and the true motion as an arrow."""
        for name, value in distances.figures.items():
            self.log_scalar(DISTANCES[name], value)
        if distances.motion is not None:
            arrow = rr.Arrows3D(
                origins=[grasp], vectors=[distances.motion], colors=TRUE_COLOR, radii=0.0007
            )
            self._log(TRUE_MOTION, arrow)

    def log_floor(self, floor: Mapping[str, float], times: tuple[float, float]) -> None:
        """Log the least that each curve can be expected to come to, from one time to another."""
        for name, value in floor.items():
            self.recording.send_columns(
                placed(self.place, f"{DISTANCES[name]}/floor"),
                indexes=[rr.TimeColumn(TIME_TIMELINE, duration=times)],
                columns=rr.Scalars.columns(scalars=[value, value]),
            )

    def log_tip_path(self, path: Float64[np.ndarray, "_ 3"] | None) -> None:
        """Log where the tip of the moving arm is planned to go."""
        if path is None or len(path) < 2:
            self._log(TIP_PATH, rr.Clear(recursive=False))
            return
        self._log(TIP_PATH, rr.LineStrips3D([path], colors=PATH_COLOR, radii=0.0008))

    def log_transforms(self, transforms: Sequence[Transform]) -> None:
        """Log where every link of both arms stands."""
        for entry in transforms:
            self._log(
                f"tf/{entry.child}",
                rr.Transform3D(
                    translation=entry.translation,
                    quaternion=rr.Quaternion(xyzw=entry.rotation),
                    parent_frame=framed(self.place, entry.parent),
                    child_frame=framed(self.place, entry.child),
                ),
            )

    def log_transforms_along(
        self, times: Float64[np.ndarray, "_"], rows: Sequence[Sequence[Transform]]
    ) -> None:
        """Log the links of both arms at each of `times`, on the time line alone."""
        if not rows:
            return
        when = rr.TimeColumn(TIME_TIMELINE, duration=times)
        for column in zip(*rows, strict=True):
            self.recording.send_columns(
                placed(self.place, f"tf/{column[0].child}"),
                indexes=[when],
                columns=rr.Transform3D.columns(
                    translation=np.stack([entry.translation for entry in column]),
                    quaternion=np.stack([entry.rotation for entry in column]),
                    parent_frame=[framed(self.place, entry.parent) for entry in column],
                    child_frame=[framed(self.place, entry.child) for entry in column],
                ),
            )

    def log_joints(self, joints: tuple[Joints, Joints]) -> None:
        """Log the joint positions of both arms as curves."""
        for arm, positions in zip(ARMS, joints, strict=True):
            self._log(f"{JOINTS}/{arm}", rr.Scalars(positions))

    def log_joints_along(
        self, times: Float64[np.ndarray, "_"], joints: tuple[JointPath, JointPath]
    ) -> None:
        """Log the joint positions at each of `times`, on the time line alone."""
        when = rr.TimeColumn(TIME_TIMELINE, duration=times)
        for arm, path in zip(ARMS, joints, strict=True):
            self.recording.send_columns(
                placed(self.place, f"{JOINTS}/{arm}"),
                indexes=[when],
                columns=rr.Scalars.columns(scalars=path),
            )

    def log_scalar(self, entity: str, value: float) -> None:
        """Log one figure of a curve."""
        self._log(entity, rr.Scalars(value))

    def log_latency(self, latency: Latency) -> None:
        """Log how long each stage of a turn took, in milliseconds, as curves."""
        self._log(LATENCY, rr.Scalars([getattr(latency, name) for name in STAGES]))

    def log_text(self, text: str, *, level: str = "INFO") -> None:
        """Log a line for people."""
        self._log(LOG, rr.TextLog(text, level=level))

    def name_joints(self, names: Sequence[str]) -> None:
        """Give the joints' curves their names."""
        for arm in ARMS:
            series = rr.SeriesLines(names=[f"{arm} {name}" for name in names])
            self._static(f"{JOINTS}/{arm}", series)

    def _log_table(self) -> None:
        x, y, z = TABLE_SIZE
        # A little lower than the object's underside, so that the two do not flicker.
        box = rr.Boxes3D(
            half_sizes=[[x / 2, y / 2, z / 2]],
            centers=[[0.0, 0.0, -z / 2 - 5e-4]],
            colors=TABLE_COLOR,
            fill_mode="solid",
        )
        self._static(TABLE, box)

    def _log_arms(self, urdf: str) -> None:
        with tempfile.TemporaryDirectory() as directory:
            path = Path(directory) / "psm.urdf"
            path.write_text(urdf, encoding="utf-8")
            for arm in ARMS:
                prefix = drawn_at(self.place, arm)
                tree = UrdfTree.from_file_path(
                    path, entity_path_prefix=prefix, frame_prefix=framed(self.place, f"{arm}/")
                )
                # The joints move: static transforms would hold every link at position zero.
                shapes = tree.stream(include_joint_transforms=False)
                # The shapes for collision checks would be drawn over those for the eye.
                collision = f"/{prefix}/{tree.name}/collision_geometries/**"
                self.recording.send_chunks(shapes.drop(content=collision))

    def _name_series(self) -> None:
        self._static(CHAMFER, rr.SeriesLines(names="Chamfer (mm)", colors=CURRENT_COLOR, widths=2))
        self._static(
            MOTION_LENGTH, rr.SeriesLines(names="motion (mm)", colors=MOTION_COLOR, widths=2)
        )
        self._static(LEGACY, rr.SeriesLines(names="legacy norm", colors=CURRENT_COLOR, widths=2))
        self._static(NODES, rr.SeriesLines(names="nodes (mm)", colors=POINT_COLOR, widths=2))
        for entity in DISTANCES.values():
            floor = rr.SeriesLines(names="floor", colors=FLOOR_COLOR, widths=1)
            self._static(f"{entity}/floor", floor)
        self._static(LATENCY, rr.SeriesLines(names=list(STAGES)))

    def _log(self, entity: str, value: rr.AsComponents) -> None:
        self.recording.log(placed(self.place, entity), value)

    def _static(self, entity: str, value: rr.AsComponents) -> None:
        self.recording.log(placed(self.place, entity), value, static=True)


def placed(place: str, entity: str) -> str:
    """Return where an entity of the scene at `place` hangs."""
    return f"{place}/{entity}" if place else entity


def framed(place: str, frame: str) -> str:
    """Return what a frame of the scene at `place` is called; all scenes stand in one world."""
    return frame if not place or frame == WORLD else f"{place}.{frame}"


def drawn_at(place: str, arm: str) -> str:
    """Return where an arm's shapes hang: Rerun takes no path there, but a name."""
    return f"{place}_{arm}" if place else arm


def _aligned(cloud: Cloud) -> Cloud:
    """Return `cloud`, copied if it is a view of a file at an odd address.

    Rerun ends the whole process on such an array.
    """
    return np.require(cloud, dtype=np.float32, requirements=["C", "ALIGNED"])


def transforms_along(
    arms: ArmModel, joints: tuple[JointPath, JointPath]
) -> list[Sequence[Transform]]:
    """Return the link frames at every row of two joint paths."""
    holding, moving = joints
    return [arms.transforms((left, right)) for left, right in zip(holding, moving, strict=True)]

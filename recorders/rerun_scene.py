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

from dnet.recorders.goal_distance import Colors, Distances
from dnet.recorders.link_rows import WORLD, LinkRows, framed, placed, time_column
from dnet.types import ARMS, Cloud, Frame, JointPath, Joints, Latency, LinkWay, Point

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
        self._links = LinkRows(recording, place=place)
        self._now: tuple[float, int | None] = (0.0, None)
        self._log_table()
        self._log_looks()
        if urdf:
            self._log_arms(urdf)
        self._name_series()

    def set_time(self, seconds: float, *, count: int | None = None) -> None:
        """Set where on the timelines the next values go; without a count, on time alone."""
        self._now = seconds, count
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
        self._log(CURRENT, rr.Points3D(_aligned(cloud), colors=chosen))

    def log_manipulation_point(self, point: Point) -> None:
        """Log where the moving arm holds the object."""
        self._log(MANIPULATION_POINT, rr.Points3D([point]))

    def log_frame(
        self,
        frame: Frame,
        links: LinkWay,
        distances: Distances | None = None,
        *,
        floor: Mapping[str, float] | None = None,
    ) -> None:
        """Log what was seen and where the arms were, and how far it is from the goal."""
        self.log_cloud(frame.cloud, None if distances is None else distances.colors)
        if distances is not None:
            self.log_distances(frame.grasp, distances, floor or {})
        self.log_manipulation_point(frame.grasp)
        self.log_links(links)
        self.log_joints(frame.joints)

    def log_motion(self, grasp: Point, motion: Point) -> None:
        """Log a motion of the grasp as an arrow, and its length as a curve."""
        self._log(MOTION, rr.Arrows3D(origins=[grasp], vectors=[motion]))
        self.log_scalar(MOTION_LENGTH, 1e3 * float(np.linalg.norm(motion)))

    def log_distances(self, grasp: Point, distances: Distances, floor: Mapping[str, float]) -> None:
        """Log how far a frame is from the goal as curves, and the true motion as an arrow.

        Args:
            grasp: Where the arrow begins.
            distances: Of the frame.
            floor: The least that each curve can be expected to come to, drawn beside it.
        """
        for name, value in distances.figures.items():
            # Two curves of one entity cost half of what two entities would.
            values = [value, floor[name]] if name in floor else [value]
            self._log(DISTANCES[name], rr.Scalars(values))
        if distances.motion is not None:
            self._log(TRUE_MOTION, rr.Arrows3D(origins=[grasp], vectors=[distances.motion]))

    def log_tip_path(self, path: Float64[np.ndarray, "_ 3"] | None) -> None:
        """Log where the tip of the moving arm is planned to go."""
        if path is None or len(path) < 2:
            self._log(TIP_PATH, rr.Clear(recursive=False))
            return
        self._log(TIP_PATH, rr.LineStrips3D([path]))

    def log_links(self, links: LinkWay) -> None:
        """Log where every link of both arms stands."""
        (seconds, count), size = self._now, len(links.names)
        indexes = [time_column(TIME_TIMELINE, np.full(size, seconds))]
        if count is not None:
            indexes.append(rr.TimeColumn(self._counter, sequence=np.full(size, count)))
        self._links.send_way(links, indexes)

    def log_way(self, times: Float64[np.ndarray, "_"], path: JointPath, links: LinkWay) -> None:
        """Log the moving arm on its way, at each of `times`, on the time line alone.

        Args:
            times: In seconds, (n,).
            path: Its joint positions at those times.
            links: Those of its links that move.
        """
        indexes = [time_column(TIME_TIMELINE, np.repeat(times, len(links.names)))]
        self._links.send_way(links, indexes)
        self.recording.send_columns(
            placed(self.place, f"{JOINTS}/{ARMS[1]}"),
            indexes=[time_column(TIME_TIMELINE, times)],
            columns=rr.Scalars.columns(scalars=path),
        )

    def log_joints(self, joints: tuple[Joints, Joints]) -> None:
        """Log the joint positions of both arms as curves."""
        for arm, positions in zip(ARMS, joints, strict=True):
            self._log(f"{JOINTS}/{arm}", rr.Scalars(positions))

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

    def _log_looks(self) -> None:
        # What never changes is said once, not with every value.
        looks = {
            CURRENT: rr.Points3D.from_fields(radii=POINT_RADIUS),
            MANIPULATION_POINT: rr.Points3D.from_fields(colors=POINT_COLOR, radii=0.003),
            MOTION: rr.Arrows3D.from_fields(colors=MOTION_COLOR, radii=0.0012),
            TRUE_MOTION: rr.Arrows3D.from_fields(colors=TRUE_COLOR, radii=0.0007),
            TIP_PATH: rr.LineStrips3D.from_fields(colors=PATH_COLOR, radii=0.0008),
        }
        for entity, look in looks.items():
            self._static(entity, look)

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
        motion = rr.SeriesLines(names="motion (mm)", colors=MOTION_COLOR, widths=2)
        self._static(MOTION_LENGTH, motion)
        for entity, name, color in (
            (CHAMFER, "Chamfer (mm)", CURRENT_COLOR),
            (LEGACY, "legacy norm", CURRENT_COLOR),
            (NODES, "nodes (mm)", POINT_COLOR),
        ):
            series = rr.SeriesLines(
                names=[name, "floor"], colors=[color, FLOOR_COLOR], widths=[2, 1]
            )
            self._static(entity, series)
        self._static(LATENCY, rr.SeriesLines(names=list(STAGES)))

    def _log(self, entity: str, value: rr.AsComponents) -> None:
        self.recording.log(placed(self.place, entity), value)

    def _static(self, entity: str, value: rr.AsComponents) -> None:
        self.recording.log(placed(self.place, entity), value, static=True)


def drawn_at(place: str, arm: str) -> str:
    """Return where an arm's shapes hang: Rerun takes no path there, but a name."""
    return f"{place}_{arm}" if place else arm


def _aligned(cloud: Cloud) -> Cloud:
    """Return `cloud`, copied if it is a view of a file at an odd address.

    Rerun ends the whole process on such an array.
    """
    return np.require(cloud, dtype=np.float32, requirements=["C", "ALIGNED"])

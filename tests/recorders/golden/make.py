"""What the golden files hold, and the writer's calls that made them.

    python -m tests.recorders.golden.make OUT

writes them anew, for a new version of the schema; those of an old version stay as they are. Every
number here is computed alike on all machines: sums of few digits, no sines and no roots.
"""

import sys
from functools import cached_property
from pathlib import Path

import numpy as np

from dnet.geometry.camera import Camera
from dnet.recorders.episode import EpisodeWriter
from dnet.types import (
    Cloud,
    EpisodeMeta,
    Frame,
    FrameKind,
    Joints,
    Look,
    Plan,
    Pose,
    Scene,
    Step,
    Tissue,
    Transform,
)

RECORDING, RUN = "episode-v1.mcap", "run-v1.mcap"

# Rows of a lattice of 4 x 4 x 2 points, each the farthest from those before it.
ORDER = [0, 31, 3, 12, 10, 21, 18, 23, 24, 29, 1, 2, 4, 5, 6, 7, 8, 9, 11, 13, 14, 15, 16, 17, 19,
         20, 22, 25, 26, 27, 28, 30]  # fmt: skip
LATTICE = np.array([(x, y, z) for z in range(2) for y in range(4) for x in range(4)])
CORNERS = [0, 3, 12, 15, 16, 19, 28, 31]
GRASP = np.array([0.0351, -0.0007, 0.0313])
"""Not a sum of powers of two: float32 would not hold it."""
MOMENTS: tuple[tuple[float, FrameKind, tuple[float, float, float]], ...] = (
    (0.25, "rest", (0.0, 0.0, 0.0)),
    (0.5, "way", (1 / 64, -1 / 128, 1 / 64)),
    (0.75, "shape", (1 / 32, -1 / 64, 1 / 32)),
    (1.5, "shape", (0.0, 1 / 32, 1 / 64)),
)
"""Time, kind and motion of each frame; the object is carried, not bent."""

SETTINGS = {
    "shapes": 2,
    "seed": 5,
    "rate": 4.0,
    "images": True,
    "tissue": {"shape": "box", "young": 1000.0, "vary": False},
    "laboratory": {"points": 32, "noise": None, "versions": {"deformernet": "0.1.0"}},
    "note": "weiches Gewebe, 软",
}
SCENE = Scene(
    position=(0.001, -0.002),
    yaw=0.125,
    hold=(-0.045, 0.0, 0.04),
    manipulation_point=(0.0351, -0.0007, 0.0313),
    tissue=Tissue("box", (0.1, 0.1, 0.04), (8, 8, 4), 1250.0, 0.3, 1000.0),
)
META = EpisodeMeta("episode-5-00007", 5, 7, SCENE, SETTINGS)
RUN_META = EpisodeMeta(
    "servo-episode-5-00007-3", 9, 0, SCENE, {"points": 32, "goal": "episode-5-00007.mcap:3"}
)
RESULT = {
    "frames": 4,
    "rejected": {"bistable": 1, "unreachable": 2},
    "deviation_mm": {"mean": 0.21, "worst": 0.83},
}
RUN_RESULT = {"outcome": "converged", "chamfer": [0.0185, 0.00125]}
ATTACHMENTS = {
    "psm.urdf": b'<robot name="psm"><link name="base_link"/></robot>\n',
    "object.vtk": b"# vtk DataFile Version 2.0\nsoft body\nASCII\n",
    "config.json": b'{"points": 32}\n',
}


class PlainCamera(Camera):
    """A camera that looks straight down."""

    @cached_property
    def pose(self) -> Pose:
        """Half a turn about x."""
        pose = np.diag([1.0, -1.0, -1.0, 1.0])
        pose[:3, 3] = self.eye
        return pose

    @cached_property
    def focal_length(self) -> float:
        """As many pixels as the image is wide."""
        return float(self.width)


CAMERA = PlainCamera(width=8, height=6, eye=(0.0, 0.0, 0.5))


class PlainArms:
    """Two arms of two links each, whose joints push them along."""

    joint_names = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")

    def transforms(self, joints: tuple[Joints, Joints]) -> list[Transform]:
        """Return the links, turned by 120 degrees about the diagonal at their base."""
        holding, moving = joints
        turned, straight = np.full(4, 0.5), np.array([0.0, 0.0, 0.0, 1.0])
        left, right = np.array([-0.125, 0.0, 0.1875]), np.array([0.125, 0.0, 0.1875])
        return [
            Transform("world", "psm_left/base_link", left, turned),
            Transform("psm_left/base_link", "psm_left/tip_link", holding[:3], straight),
            Transform("world", "psm_right/base_link", right, turned),
            Transform("psm_right/base_link", "psm_right/tip_link", moving[:3], straight),
        ]


def frames() -> list[Frame]:
    """Return the frames of the recording."""
    return [_frame(number, *moment) for number, moment in enumerate(MOMENTS)]


def goal() -> Cloud:
    """Return the goal of the servo run: the last shape."""
    return frames()[-1].cloud


def steps() -> list[Step]:
    """Return the two turns of the servo run."""
    first, _, _, last = frames()
    joints = np.stack([first.joints[1], last.joints[1]])
    plan = Plan(
        status="rrt_connect",
        path=joints,
        times=np.array([0.0, 1.25]),
        requested=np.array([0.0, 0.03125, 0.0156]),
        achieved=np.array([0.0, 0.03125, 0.015625]),
        reason="the straight line meets the other arm",
        checks=37,
        milliseconds=12.5,
    )
    return [
        Step(_without_image(first), 0.0185, np.array([0.0, 0.03125, 0.0156]), plan),
        Step(_without_image(last), 0.00125, np.array([0.0005, 0.0, -0.001])),
    ]


def write_recording(path: Path) -> Path:
    """Write what `dnet record` would."""
    with EpisodeWriter(
        path, META, arms=PlainArms(), attachments=ATTACHMENTS, camera=CAMERA
    ) as writer:
        for frame in frames():
            writer.add(frame)
        writer.finish(RESULT)
    return path


def write_run(path: Path) -> Path:
    """Write what `dnet servo` would."""
    with EpisodeWriter(
        path, RUN_META, arms=PlainArms(), attachments=ATTACHMENTS, camera=CAMERA
    ) as writer:
        writer.set_goal(goal())
        for index, step in enumerate(steps()):
            writer.add_step(step, index)
        writer.finish(RUN_RESULT)
    return path


def _frame(number: int, time: float, kind: FrameKind, motion: tuple[float, float, float]) -> Frame:
    lattice = (LATTICE / 32 - np.array([3 / 64, 3 / 64, 0.0]) + motion).astype(np.float32)
    return Frame(
        time=time,
        kind=kind,
        cloud=lattice[ORDER],
        grasp=GRASP + motion,
        joints=(np.arange(6) / 8, np.arange(6) / 16 + number / 32),
        nodes=lattice[CORNERS],
        image=_image(number),
    )


def _image(number: int) -> Look:
    pixels = np.arange(48).reshape(6, 8)
    depth = (0.5 - pixels / 256 - number / 64).astype(np.float32)
    mask = ((pixels + number) % 4).astype(np.uint8)
    return Look(np.where(mask == 0, np.float32(2.0), depth), mask)


def _without_image(frame: Frame) -> Frame:
    return Frame(frame.time, frame.kind, frame.cloud, frame.grasp, frame.joints, frame.nodes)


if __name__ == "__main__":
    out = Path(sys.argv[1])
    print(write_recording(out / RECORDING), write_run(out / RUN))

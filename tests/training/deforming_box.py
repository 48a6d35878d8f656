"""An elastic box seen from one side: grasped at one point, held at another, in numpy.

A displacement of the grasp fades with the distance from it and vanishes at the hold.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import open_index
from dnet.geometry.sampling import farthest_points
from dnet.nets.deformernet import DeformerNetConfig
from dnet.training.frames import Config, Frames
from dnet.types import Frame, FrameKind
from tests.recorders import rollout

SMALL = DeformerNetConfig(points=160)
SIZE, CENTRE = np.array([0.1, 0.1, 0.04]), np.array([0.0, 0.0, 0.02])


@dataclass(frozen=True)
class BoxEpisode:
    seed: int
    kinds: tuple[FrameKind, ...] = ("rest", "shape", "shape", "shape", "shape", "shape")
    points: int = SMALL.points

    def frame(self, index: int) -> Frame:
        rng = np.random.default_rng(self.seed)
        yaw, shift = rng.uniform(-0.2, 0.2), [*rng.uniform(-0.01, 0.01, 2), 0.0]
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        surface = rng.uniform(-0.5, 0.5, (1600, 3))
        surface[:1100, 2], surface[1100:, 1] = 0.5, -0.5
        grasp = np.array([0.04, rng.uniform(-0.03, 0.03), 0.04])
        hold = np.array([-0.04, rng.uniform(-0.03, 0.03), 0.04])
        motions = rng.uniform([-0.04, -0.04, 0], [0.04, 0.04, 0.04], (len(self.kinds), 3))
        motion = motions[index] * (self.kinds[index] != "rest")

        rest = surface * SIZE + CENTRE
        near = np.exp(-((np.linalg.norm(rest - grasp, axis=1) / 0.06) ** 2))
        held = np.exp(-((np.linalg.norm(rest - hold, axis=1) / 0.03) ** 2))
        bent = rest + (near * (1 - held))[:, None] * motion
        seen = np.random.default_rng((self.seed, index)).permutation(len(bent))[:1200]
        return Frame(
            time=float(index),
            kind=self.kinds[index],
            cloud=farthest_points((bent[seen] @ turn.T + shift).astype(np.float32), self.points),
            grasp=(grasp + motion) @ turn.T + shift,
            joints=(np.zeros(6), np.zeros(6)),
            nodes=rest.astype(np.float32),
        )

    @property
    def frames(self) -> list[Frame]:
        return [self.frame(index) for index in range(len(self.kinds))]


def write_boxes(folder: Path, boxes: Sequence[BoxEpisode]) -> Path:
    """Write episodes, each named by its place among them."""
    folder.mkdir(exist_ok=True)
    for number, box in enumerate(boxes):
        rollout.write(folder / f"box-{number}.mcap", box.frames)
    return folder


def box_frames(
    folder: Path,
    seeds: Sequence[int],
    *,
    samplings: int = 1,
    config: Config = SMALL,
) -> Frames:
    """Write a dataset of boxes and return its frames as a network takes them."""
    boxes = [BoxEpisode(seed, points=config.points) for seed in seeds]
    table = settled_frames(open_index(write_boxes(folder, boxes)))
    frames = Frames.of(table, config, samplings=samplings)
    frames.tables.build()
    return frames

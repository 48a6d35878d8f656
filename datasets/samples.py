"""Samples for training: the current and the goal cloud, and the motion of the grasp between."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float32, Int64
from torch import Tensor
from torch.utils.data import Dataset

from dnet.datasets.batch_order import Drawn
from dnet.datasets.clouds import Clouds
from dnet.datasets.pairs import Pairs


@dataclass(frozen=True, slots=True)
class SampleBatch:
    """Pairs of shapes, each of one object, and the motion that turns one into the other."""

    current: Float32[Tensor, "b n 3"]
    goal: Float32[Tensor, "b n 3"]
    motion: Float32[Tensor, "b 3"]
    """Grasp of the goal minus grasp of the current frame, in metres."""
    rows: Int64[Tensor, "b 2"]
    """Which frames of the table they are."""

    def __len__(self) -> int:
        return len(self.motion)

    def pin_memory(self) -> "SampleBatch":
        """Return the batch in memory from which a GPU reads fastest."""
        parts = (self.current, self.goal, self.motion, self.rows)
        return SampleBatch(*(part.pin_memory() for part in parts))


class Samples(Dataset[SampleBatch]):
    """The samples of a dataset, by batches that a `BatchOrder` draws.

    Args:
        clouds: Of the frames of a table.
        pairs: Which of the frames make a sample.
    """

    def __init__(self, clouds: Clouds, pairs: Pairs) -> None:
        self.clouds = clouds
        self.pairs = pairs

    def __len__(self) -> int:
        return len(self.pairs)

    def __getitem__(self, drawn: Drawn) -> SampleBatch:
        """Return a batch of samples."""
        current, goal = self.pairs.rows(drawn.numbers, epoch=drawn.epoch)
        grasps = self.clouds.table.grasps
        return SampleBatch(
            torch.from_numpy(self.clouds.stack(current)),
            torch.from_numpy(self.clouds.stack(goal)),
            torch.from_numpy((grasps[goal] - grasps[current]).astype(np.float32)),
            torch.from_numpy(np.stack([current, goal], axis=1)),
        )

    @property
    def fingerprint(self) -> str:
        """What changes when one of the files does, or other frames are taken."""
        return self.clouds.table.fingerprint

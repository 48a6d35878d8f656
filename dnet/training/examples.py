"""Examples to learn from: clouds to encode, which of them form pairs, and the motions between."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Int64
from torch import Tensor
from torch.utils.data import Dataset

from dnet.datasets.batch_order import BatchOrder, Drawn
from dnet.datasets.groups import Groups
from dnet.datasets.pairs import Pairs, any_two, from_rest
from dnet.datasets.stream import Stream
from dnet.errors import Uneven
from dnet.nets.deformernet import DeformerNetConfig
from dnet.training.augment import Augmentation, Placement, place, turn
from dnet.training.frames import Frames, Rows, Target
from dnet.training.parallel import Process
from dnet.training.settings import TrainingSettings


@dataclass(frozen=True, slots=True)
class Examples:
    """A batch."""

    clouds: Any
    """As the network takes them: a batch of neighbourhoods, or of features."""
    current: Int64[Tensor, " p"]
    """Of each pair: which of the clouds is the current one."""
    goal: Int64[Tensor, " p"]
    """Of each pair: which of the clouds is the goal."""
    motions: Float32[Tensor, "p 3"]
    """Of the grasp, from current to goal, in metres."""
    points: Float32[Tensor, "p 3"]
    """The manipulation point of the current shape of each pair, in metres."""

    def to(self, device: torch.device) -> "Examples":
        """Return the same batch on `device`."""
        current, goal, motions, points = (
            tensor.to(device, non_blocking=True)
            for tensor in (self.current, self.goal, self.motions, self.points)
        )
        return Examples(self.clouds.to(device), current, goal, motions, points)

    def pin_memory(self) -> "Examples":
        """Return the batch in memory from which a GPU reads fastest."""
        pairs = (self.current, self.goal, self.motions, self.points)
        return Examples(self.clouds.pin_memory(), *(tensor.pin_memory() for tensor in pairs))


def stream_of(
    frames: Frames,
    settings: TrainingSettings,
    *,
    process: Process,
    target: Target = "motion",
    workers: int = 0,
    pin: bool = False,
) -> Stream[Examples]:
    """Return the batches of a training, in their order.

    Args:
        frames: To learn from.
        settings: Of the training.
        process: This one among several, which share each batch.
        target: What a network should answer. `point`s are learned from groups with a rest shape,
            all of whose pairs begin with it.
        workers: Processes that read ahead.
        pin: Whether batches go into pinned memory.

    Raises:
        TooFew: If there is no pair, or a process would have nothing of a batch.
        Uneven: If the processes cannot share a batch evenly.
    """
    if settings.batch % process.world:
        raise Uneven(settings.batch, process.world)
    variation = Variation(settings.augmentation, settings.seed)
    drawable: AllPairs | SinglePairs
    if target == "point":
        drawable = AllPairs(
            frames, size=settings.frames, variation=variation, rest_share=1.0, target=target
        )
    elif settings.pairs == "all":
        drawable = AllPairs(
            frames, size=settings.frames, variation=variation, rest_share=settings.rest_share
        )
    else:
        of = any_two if settings.pairs == "any" else from_rest
        drawable = SinglePairs(frames, of(frames.table), variation=variation)
    order = BatchOrder(
        len(drawable),
        settings.batch // process.world,
        settings.seed,
        rank=process.rank,
        world=process.world,
        even=process.world > 1,
    )
    return Stream(drawable, order, workers=workers, pin=pin)


@dataclass(frozen=True)
class Variation:
    """How the same frames look different every time: a pure function of what is drawn when.

    It depends neither on which process draws nor on what it drew before.
    """

    augmentation: Augmentation | None
    """How groups are placed anew; None leaves them where they are."""
    seed: int

    def draw(self, drawn: Drawn, groups: Rows, *, samplings: int) -> tuple[Placement | None, Rows]:
        """Return how the groups of a batch are placed, and the centroids that each cloud gets.

        Args:
            drawn: The numbers of the groups.
            groups: Which of these groups each cloud is in.
            samplings: Choices of centroids of a cloud.
        """
        placements: list[Placement] = []
        choices = np.zeros(len(groups), np.int64)
        for place_in_batch, number in enumerate(drawn.numbers.tolist()):
            rng = np.random.default_rng((self.seed, drawn.epoch, number, 1))
            own = groups == place_in_batch
            choices[own] = rng.integers(samplings, size=int(own.sum()))
            if self.augmentation is not None:
                placements.append(self.augmentation.draw(rng, 1))
        if not placements:
            return None, choices
        turns = torch.cat([one.turns for one in placements])
        shifts = torch.cat([one.shifts for one in placements])
        return Placement(turns, shifts), choices


class AllPairs(Dataset[Examples]):
    """Groups of clouds of one episode: each cloud is encoded once and meets all others.

    Args:
        frames: To learn from.
        size: The least clouds of a group, except in an episode with fewer; at least two.
        variation: How they vary.
        rest_share: How many groups the rest shape of their episode joins.
        target: What a network should answer; of `point`s, only pairs from rest are taken.
    """

    def __init__(
        self,
        frames: Frames,
        *,
        size: int,
        variation: Variation,
        rest_share: float = 0.0,
        target: Target = "motion",
    ) -> None:
        self._frames, self._variation, self._target = frames, variation, target
        self._groups = Groups(frames.clouds, size=size, seed=variation.seed, rest_share=rest_share)

    def __len__(self) -> int:
        return len(self._groups)

    def __getitem__(self, drawn: Drawn) -> Examples:
        """Return a batch of groups."""
        chosen = self._groups.choose(drawn)
        current, goal = chosen.current, chosen.goal
        if self._target == "point":
            begun = self._frames.table.rest[chosen.rows[current]]
            current, goal = current[begun], goal[begun]
        return _examples(
            self._frames,
            self._variation,
            drawn,
            rows=chosen.rows,
            groups=chosen.groups,
            pairs=(current, goal),
        )

    @property
    def fingerprint(self) -> str:
        """What changes when one of the files does, or other frames are taken."""
        return self._groups.fingerprint


class SinglePairs(Dataset[Examples]):
    """Pairs of clouds drawn one by one, two encodings each.

    Args:
        frames: To learn from.
        pairs: Which of the frames make a pair.
        variation: How they vary.
    """

    def __init__(self, frames: Frames, pairs: Pairs, *, variation: Variation) -> None:
        self._frames, self._pairs, self._variation = frames, pairs, variation

    def __len__(self) -> int:
        return len(self._pairs)

    def __getitem__(self, drawn: Drawn) -> Examples:
        """Return a batch of pairs."""
        current, goal = self._pairs.rows(drawn.numbers, epoch=drawn.epoch)
        numbers = np.arange(len(current))
        return _examples(
            self._frames,
            self._variation,
            drawn,
            rows=np.concatenate([current, goal]),
            groups=np.concatenate([numbers, numbers]),
            pairs=(numbers, len(numbers) + numbers),
        )

    @property
    def fingerprint(self) -> str:
        """What changes when one of the files does, or other frames are taken."""
        return f"{self._frames.table.fingerprint}-{type(self._pairs).__name__}"


def _examples(
    frames: Frames,
    variation: Variation,
    drawn: Drawn,
    *,
    rows: Rows,
    groups: Rows,
    pairs: tuple[Rows, Rows],
) -> Examples:
    samplings = frames.tables.samplings
    placement, choices = variation.draw(drawn, groups, samplings=samplings)
    clouds = frames.prepared(rows, choices=choices)
    current, goal = pairs
    motions = torch.from_numpy(frames.motions(rows[current], rows[goal]))
    points = torch.from_numpy(frames.points(rows[current]))
    config = frames.config
    # Features of a surface are blind to how it is placed: a motion that turned would be a riddle.
    if placement is not None and isinstance(config, DeformerNetConfig):
        of_clouds, of_pairs = torch.from_numpy(groups), torch.from_numpy(groups[current])
        unit = config.coordinate_unit
        clouds = place(clouds, placement, groups=of_clouds, coordinate_unit=unit)
        motions = turn(motions, placement, groups=of_pairs)
        points = turn(points, placement, groups=of_pairs) + placement.shifts[of_pairs]
    return Examples(clouds, torch.from_numpy(current), torch.from_numpy(goal), motions, points)

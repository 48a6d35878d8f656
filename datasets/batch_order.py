"""Which things of an epoch form which batch: a pure function of the seed and the epoch."""

from dataclasses import dataclass

from dnet.datasets.permutation import Numbers, Permutation
from dnet.errors import TooFew


@dataclass(frozen=True, slots=True)
class Drawn:
    """Which samples, or groups, form a batch."""

    epoch: int
    numbers: Numbers


@dataclass(frozen=True, slots=True)
class BatchOrder:
    """The batches of every epoch.

    They are cut from one random order of all there is, and dealt to the processes in turn: process
    r of w gets batches r, r + w, r + 2 w and so on. Everything comes once an epoch, to one
    process. Where the batches do not divide evenly, some processes get one fewer, unless `even`
    leaves the last few out.
    """

    count: int
    """Samples, or groups, of an epoch."""
    batch: int
    """How many form a batch; the last batch of an epoch may have fewer."""
    seed: int = 0
    rank: int = 0
    """Which process this is, from 0."""
    world: int = 1
    """Of how many."""
    even: bool = False
    """Whether every process must have as many batches, all of them whole."""

    def __post_init__(self) -> None:
        """Refuse what has no order.

        Raises:
            TooFew: If there is nothing to draw from, or not enough for each process.
        """
        for what, got, least in (
            ("size of a batch", self.batch, 1),
            ("number of processes", self.world, 1),
            ("rank of this process", self.rank, 0),
            ("number of samples", self.count, self.batch * self.world if self.even else 1),
            ("number of processes beyond this one's rank", self.world - self.rank, 1),
        ):
            if got < least:
                raise TooFew(what, got, least)

    def __len__(self) -> int:
        """Return how many batches of an epoch this process has."""
        if self.even:
            return self.count // (self.batch * self.world)
        batches = -(-self.count // self.batch)
        return max(0, -(-(batches - self.rank) // self.world))

    def drawn(self, epoch: int, number: int) -> Drawn:
        """Return batch `number` of this process in an epoch."""
        start = (self.rank + number * self.world) * self.batch
        order = Permutation(self.count, seed=(self.seed, epoch))
        return Drawn(epoch, order.part(start, start + self.batch))

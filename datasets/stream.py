"""The streaming loader: batches in an order that can be taken up anywhere, by any workers."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import sleep
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from torch.utils.data import DataLoader, Sampler

from dnet.datasets.batch_order import BatchOrder, Drawn
from dnet.errors import OtherStream, WorkerDied

DEAD = ("is killed by signal", "exited unexpectedly")
"""What torch says of a worker that is no more, in a plain RuntimeError."""

SIGNAL = 1.0
"""Seconds in which the signal of a death comes."""

Batch_co = TypeVar("Batch_co", covariant=True)


@contextmanager
def dead_workers() -> Iterator[None]:
    """Say in our words that a process that reads ahead is no more.

    Torch tells of it where it waits for a batch, or by a signal in the midst of anything.

    Raises:
        WorkerDied: If one was killed.
    """
    try:
        yield
    except RuntimeError as error:
        if not any(words in str(error) for words in DEAD):
            raise
        raise _died() from error


def _died() -> WorkerDied:
    return WorkerDied(
        "read ahead", "what was put down is kept; fewer --workers take less memory, 0 none"
    )


@runtime_checkable
class Drawable(Protocol[Batch_co]):
    """What a stream draws from: samples or groups, by number."""

    def __len__(self) -> int:
        """Return how many there are in an epoch."""
        ...

    def __getitem__(self, drawn: Drawn) -> Batch_co:
        """Return a batch; must be able to go to other processes."""
        ...

    @property
    def fingerprint(self) -> str:
        """What changes when the data do."""
        ...


class Stream(Generic[Batch_co]):
    """Iterates over what is left of an epoch, and next time over the next one.

    The sequence of batches is the same with any number of workers, and goes on exactly where
    `state_dict` was taken, with any other number of them too. On local data no workers are
    fastest: a batch is copied from mapped files, and to send it between processes costs more.

    Args:
        source: What to draw from.
        order: In which order.
        workers: Processes that read ahead; 0 reads in this one.
        pin: Whether batches go into pinned memory, from which a GPU reads fastest.

    Raises:
        OtherStream: If the order is one of another number of things.
        WorkerDied: On the way, if a process that reads ahead is killed.
    """

    def __init__(
        self, source: Drawable[Batch_co], order: BatchOrder, *, workers: int = 0, pin: bool = False
    ) -> None:
        if order.count != len(source):
            raise OtherStream("order", order.count, len(source))
        self.order = order
        self._source = source
        self._place = _Place(order)
        self._loader: DataLoader[Any] = DataLoader(
            source,  # type: ignore[arg-type]
            sampler=self._place,
            batch_size=None,
            num_workers=workers,
            pin_memory=pin,
            persistent_workers=workers > 0,
            # A fork of a process whose libraries have threads may hang.
            multiprocessing_context="spawn" if workers else None,
        )

    @property
    def epoch(self) -> int:
        """Which epoch it is in, from 0."""
        return self._place.epoch

    @property
    def batch(self) -> int:
        """How many batches of the epoch have come."""
        return self._place.batch

    def __len__(self) -> int:
        """Return how many batches an epoch has."""
        return len(self.order)

    def __iter__(self) -> Iterator[Batch_co]:
        for batch in self._batches():
            # Counted before it is handed out: who saves the state while using a batch has had it.
            self._place.advance()
            yield batch

    def _batches(self) -> Iterator[Batch_co]:
        batches = iter(self._loader)
        while True:
            with dead_workers():
                try:
                    batch = next(batches)
                except StopIteration:
                    return
                except (ConnectionError, EOFError) as error:
                    if not self._loader.num_workers:
                        raise
                    # The batch is ready, but only its maker could hand it over. Of that one's
                    # death torch hears by a signal: better here than in the midst of other work.
                    sleep(SIGNAL)
                    raise _died() from error
            yield batch

    def state_dict(self) -> dict[str, Any]:
        """Return where the stream is, and what it depends on, as JSON would have it."""
        return {"epoch": self.epoch, "batch": self.batch, **self._identity()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on where `state` was taken.

        Raises:
            OtherStream: If it is of other data, another seed or another division.
        """
        for key, value in self._identity().items():
            if state.get(key) != value:
                raise OtherStream(key, value, state.get(key))
        self._place.epoch, self._place.batch = int(state["epoch"]), int(state["batch"])

    def _identity(self) -> dict[str, Any]:
        return {
            "seed": self.order.seed,
            "count": self.order.count,
            "batch_size": self.order.batch,
            "world": self.order.world,
            "even": self.order.even,
            "data": self._source.fingerprint,
        }


class _Place(Sampler[Drawn]):
    """Where a stream is; iterates over what is left of the epoch."""

    def __init__(self, order: BatchOrder) -> None:
        self.order = order
        self.epoch = 0
        self.batch = 0

    def advance(self) -> None:
        """Take note that one more batch has come; after the last one it is the next epoch."""
        self.batch += 1
        if self.batch >= len(self.order):
            self.epoch, self.batch = self.epoch + 1, 0

    def __len__(self) -> int:
        return len(self.order) - self.batch

    def __iter__(self) -> Iterator[Drawn]:
        # Workers read ahead of what has come, and that is counted elsewhere.
        epoch = self.epoch
        for number in range(self.batch, len(self.order)):
            yield self.order.drawn(epoch, number)

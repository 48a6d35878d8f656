"""Which episodes a network learns from and which it is judged by."""

import hashlib
from collections.abc import Sequence

import numpy as np

from dnet.datasets.frame_table import FrameTable
from dnet.errors import NotAFraction

HELD_OUT = 0.15
"""Share to validate on where none is stated; the commands that part a dataset state the same."""


def split(
    episode_ids: Sequence[str], *, fraction: float, seed: int = 0
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the ids to train on and the ids to validate on, each in the given order.

    An id's side depends on its hash alone, so episodes recorded later leave the earlier ones on
    their sides. The frames of one episode never meet across the split. With two or more
    different ids each side has at least one.

    Args:
        episode_ids: The ids; repeated ones land on one side.
        fraction: How much to validate on, from 0 to 1.
        seed: Another seed, another split.

    Raises:
        NotAFraction: If `fraction` is not between 0 and 1.
    """
    if not 0 <= fraction <= 1:
        raise NotAFraction("validation fraction", fraction)
    places = {name: _place(name, seed) for name in episode_ids}
    held_out = {name for name, place in places.items() if place < fraction}
    if len(places) > 1:
        # The lowest hash is the first to be held out, the highest the last.
        held_out.add(min(places, key=lambda name: places[name]))
        held_out.discard(max(places, key=lambda name: places[name]))
    train = tuple(name for name in episode_ids if name not in held_out)
    return train, tuple(name for name in episode_ids if name in held_out)


def split_frames(
    table: FrameTable, *, fraction: float, seed: int = 0
) -> tuple[FrameTable, FrameTable]:
    """Return the frames to train on and those to validate on, parted shape by shape.

    This is how the paper parts its samples: a network is judged by unseen shapes of objects and
    grasps that it has seen. A shape's side depends on the hash of its episode and number alone;
    rest frames, with which every sample of the paper begins, are on both sides.

    Args:
        table: All frames.
        fraction: How many of the shapes to validate on, from 0 to 1.
        seed: Another seed, another split.

    Raises:
        NotAFraction: If `fraction` is not between 0 and 1.
    """
    if not 0 <= fraction <= 1:
        raise NotAFraction("validation fraction", fraction)
    places = np.array(
        [
            _place(f"{table.episodes[file]}:{frame}", seed)
            for file, frame in zip(table.file.tolist(), table.frame.tolist(), strict=True)
        ]
    )
    held_out = places < fraction
    return table.where(table.rest | ~held_out), table.where(table.rest | held_out)


def _place(name: str, seed: int) -> float:
    """Return a number from 0 to 1, even over names."""
    digest = hashlib.sha256(f"{seed}:{name}".encode()).digest()
    return int.from_bytes(digest[:8], "big") / 2**64

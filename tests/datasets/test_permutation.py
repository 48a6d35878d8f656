from collections import Counter
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dnet.datasets.permutation import Permutation


@given(count=st.integers(0, 3000), seed=st.integers(0, 10**6))
def test_every_number_comes_exactly_once(count: int, seed: int) -> None:
    order = Permutation(count, seed=(seed,)).part(0, count)
    np.testing.assert_array_equal(np.sort(order), np.arange(count))


@given(count=st.integers(1, 500), cuts=st.lists(st.integers(0, 600), max_size=6))
def test_parts_make_up_the_whole(count: int, cuts: list[int]) -> None:
    order = Permutation(count, seed=(3, 4))
    ends = sorted([0, *cuts, count])
    parts = [order.part(start, stop) for start, stop in pairwise(ends)]
    np.testing.assert_array_equal(np.concatenate(parts), order.part(0, count))


def test_billions_take_no_longer_than_a_few() -> None:
    part = Permutation(10**12, seed=(0,)).part(10**11, 10**11 + 100)
    assert len(set(part.tolist())) == 100
    assert part.min() >= 0
    assert part.max() < 10**12


def test_all_orders_are_about_equally_likely() -> None:
    seen = Counter(
        tuple(Permutation(3, seed=(seed, 1)).part(0, 3).tolist()) for seed in range(3000)
    )
    assert len(seen) == 6
    # Of 3000 draws of six equally likely orders, 500 each, with a deviation of 20.
    assert all(400 < count < 600 for count in seen.values())


def test_neighbours_do_not_stay_together() -> None:
    order = Permutation(10_000, seed=(7,)).part(0, 10_000)
    steps = np.abs(np.diff(order))
    # Two numbers drawn at random are a third of the whole apart.
    assert abs(steps.mean() / 10_000 - 1 / 3) < 0.02
    assert abs(np.corrcoef(order[:-1], order[1:])[0, 1]) < 0.05

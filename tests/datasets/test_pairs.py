import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.datasets.pairs import AnyTwo, FromRest, Mixed, Pairs
from dnet.errors import NotAFraction

lengths = st.lists(st.integers(0, 6), max_size=6)


def listed(pairs: Pairs, *, epoch: int = 0) -> list[tuple[int, int]]:
    current, goal = pairs.rows(np.arange(len(pairs)), epoch=epoch)
    return list(zip(current.tolist(), goal.tolist(), strict=True))


@given(lengths=lengths)
def test_any_two_are_all_ordered_pairs_of_an_episode(lengths: list[int]) -> None:
    starts = np.cumsum([0, *lengths])
    want = [
        (int(start) + one, int(start) + other)
        for start, length in zip(starts, lengths, strict=False)
        for one in range(length)
        for other in range(length)
        if one != other
    ]
    assert listed(AnyTwo(tuple(lengths))) == want


def test_from_rest_are_the_shapes_of_episodes_that_have_a_rest_frame() -> None:
    rest = np.array([True, False, False, False, False, False, True, False])
    assert listed(FromRest((3, 2, 0, 3), rest)) == [(0, 1), (0, 2), (6, 5), (6, 7)]


@given(share=st.floats(0, 0.9), epoch=st.integers(0, 5))
def test_a_mix_has_all_of_one_kind_and_its_share_of_the_other(share: float, epoch: int) -> None:
    rest = np.zeros(30, dtype=bool)
    rest[[0, 10, 20]] = True
    base, other = FromRest((10, 10, 10), rest), AnyTwo((10, 10, 10))
    mix = Mixed(base, other, share)
    pairs = listed(mix, epoch=epoch)
    assert pairs[: len(base)] == listed(base)
    added = pairs[len(base) :]
    assert len(set(added)) == len(added)
    assert set(added) <= set(listed(other))
    assert len(added) == round(len(base) * share / (1 - share))


def test_a_mix_adds_others_in_another_epoch() -> None:
    rest = np.zeros(30, dtype=bool)
    rest[0] = True
    mix = Mixed(FromRest((30,), rest), AnyTwo((30,)), 0.5)
    assert listed(mix, epoch=0) == listed(mix, epoch=0) != listed(mix, epoch=1)


def test_a_mix_cannot_be_of_the_second_kind_alone() -> None:
    with pytest.raises(NotAFraction, match="second kind of samples is 1"):
        Mixed(AnyTwo((3,)), AnyTwo((3,)), 1.0)

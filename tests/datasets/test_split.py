from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.datasets.split import split, split_frames
from dnet.errors import NotAFraction
from tests.datasets.dataset import table_of, write_dataset

IDS = st.lists(st.text(max_size=6), max_size=30)
FRACTIONS = st.floats(0, 1)


@given(ids=IDS, fraction=FRACTIONS, seed=st.integers(0, 99))
def test_every_id_lands_on_one_side_in_its_order(
    ids: list[str], fraction: float, seed: int
) -> None:
    train, validation = split(ids, fraction=fraction, seed=seed)
    assert not set(train) & set(validation)
    assert list(train) == [name for name in ids if name in set(train)]
    assert sorted(train + validation) == sorted(ids)


@given(ids=st.lists(st.text(max_size=6), min_size=2, max_size=30, unique=True), fraction=FRACTIONS)
def test_two_ids_give_each_side_one(ids: list[str], fraction: float) -> None:
    train, validation = split(ids, fraction=fraction)
    assert train
    assert validation


@given(ids=st.lists(st.text(max_size=6), max_size=30, unique=True), fraction=FRACTIONS)
def test_the_order_of_the_ids_does_not_matter(ids: list[str], fraction: float) -> None:
    forwards = split(ids, fraction=fraction)
    backwards = split(ids[::-1], fraction=fraction)
    assert [set(side) for side in forwards] == [set(side) for side in backwards]


def test_later_episodes_leave_earlier_ones_on_their_side() -> None:
    ids = [f"episode-{number}" for number in range(200)]
    before = split(ids[:100], fraction=0.2)
    after = split(ids, fraction=0.2)
    assert set(before[0]) <= set(after[0])
    assert set(before[1]) <= set(after[1])


def test_the_share_is_about_the_fraction_and_depends_on_the_seed() -> None:
    ids = [f"episode-{number}" for number in range(2000)]
    first, other = split(ids, fraction=0.2)[1], split(ids, fraction=0.2, seed=1)[1]
    assert abs(len(first) / 2000 - 0.2) < 0.03
    assert set(first) != set(other)


@pytest.mark.parametrize("fraction", [-0.1, 1.1, float("nan")])
def test_a_share_beyond_all_or_nothing_is_refused(fraction: float) -> None:
    with pytest.raises(NotAFraction, match="must be from 0 to 1"):
        split(["a", "b"], fraction=fraction)


def test_shapes_are_parted_by_their_hash_and_rest_frames_are_on_both_sides(tmp_path: Path) -> None:
    table = table_of(write_dataset(tmp_path, (30, 20)))
    training, validation = split_frames(table, fraction=0.3)
    again = split_frames(table, fraction=0.3)[1]
    assert again.fingerprint == validation.fingerprint != training.fingerprint
    assert split_frames(table, fraction=0.3, seed=1)[1].fingerprint != validation.fingerprint
    sides = [
        set(zip(side.file.tolist(), side.frame.tolist(), strict=True))
        for side in (training, validation)
    ]
    assert len(sides[0] | sides[1]) == len(table) == 50
    assert len(sides[0] & sides[1]) == 2
    assert all(side.rest.sum() == 2 for side in (training, validation))
    # Of 48 shapes 14.4 are expected, with a deviation of 3.2.
    assert 4 < len(validation) - 2 < 25


def test_the_share_of_shapes_must_be_one(tmp_path: Path) -> None:
    table = table_of(write_dataset(tmp_path, (3,)))
    with pytest.raises(NotAFraction):
        split_frames(table, fraction=1.1)
    assert len(split_frames(table, fraction=0.0)[1]) == 1

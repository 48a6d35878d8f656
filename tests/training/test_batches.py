import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dnet.training.batches import Batch, all_pairs, ordered_pairs

lengths_of_episodes = st.lists(st.integers(2, 40), min_size=1, max_size=8)
sizes = {"groups": st.integers(1, 5), "frames": st.integers(2, 12)}


def contents(batches: list[Batch]) -> list[list[list[int]]]:
    return [
        [part.tolist() for part in (one.frames, one.groups, one.current, one.goal)]
        for one in batches
    ]


@given(lengths=lengths_of_episodes, seed=st.integers(0, 99), epoch=st.integers(0, 99), **sizes)
def test_every_frame_is_encoded_once_an_epoch(
    lengths: list[int], seed: int, epoch: int, groups: int, frames: int
) -> None:
    batches = all_pairs(lengths, seed=seed, epoch=epoch, groups=groups, frames=frames)
    encoded = np.concatenate([batch.frames.numpy() for batch in batches])
    np.testing.assert_array_equal(np.sort(encoded), np.arange(sum(lengths)))


@given(lengths=lengths_of_episodes, seed=st.integers(0, 99), **sizes)
def test_pairs_are_all_ordered_pairs_within_a_group_and_a_group_is_of_one_episode(
    lengths: list[int], seed: int, groups: int, frames: int
) -> None:
    episode_of = np.repeat(np.arange(len(lengths)), lengths)
    for batch in all_pairs(lengths, seed=seed, epoch=0, groups=groups, frames=frames):
        group = batch.groups.numpy()
        for number in range(batch.group_count):
            assert len(set(episode_of[batch.frames.numpy()[group == number]])) == 1
        got = set(zip(batch.current.tolist(), batch.goal.tolist(), strict=True))
        places = range(len(group))
        assert got == {(a, b) for a in places for b in places if a != b and group[a] == group[b]}
        assert len(batch.current) == len(got) > 0


@given(lengths=lengths_of_episodes, seed=st.integers(0, 99), **sizes)
def test_groups_and_batches_are_about_as_large_as_asked(
    lengths: list[int], seed: int, groups: int, frames: int
) -> None:
    for batch in all_pairs(lengths, seed=seed, epoch=3, groups=groups, frames=frames):
        assert batch.group_count <= groups
        sizes_of_groups = np.bincount(batch.groups.numpy())
        assert sizes_of_groups.min() >= min(frames, *lengths)
        assert sizes_of_groups.max() < 2 * frames


@given(lengths=lengths_of_episodes, seed=st.integers(0, 99), epoch=st.integers(0, 99))
def test_the_order_is_a_pure_function_of_seed_and_epoch(
    lengths: list[int], seed: int, epoch: int
) -> None:
    first = contents(all_pairs(lengths, seed=seed, epoch=epoch))
    assert contents(all_pairs(lengths, seed=seed, epoch=epoch)) == first


def test_epochs_and_seeds_differ() -> None:
    orders = {
        str(contents(all_pairs([20, 20], seed=seed, epoch=epoch)))
        for seed in range(4)
        for epoch in range(4)
    }
    assert len(orders) == 16


@given(count=st.integers(0, 12))
def test_ordered_pairs_leave_out_only_the_pair_of_a_thing_with_itself(count: int) -> None:
    one, other = ordered_pairs(count)
    pairs = set(zip(one.tolist(), other.tolist(), strict=True))
    assert len(one) == len(pairs) == count * (count - 1)
    assert all(a != b for a, b in pairs)

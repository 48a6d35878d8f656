import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import torch

from dnet.datasets.batch_order import BatchOrder
from dnet.datasets.clouds import Clouds
from dnet.datasets.groups import Dealt, Groups
from dnet.datasets.pairs import any_two, from_rest, mixed
from dnet.datasets.samples import SampleBatch, Samples
from dnet.datasets.stream import Stream
from dnet.errors import NotAFraction, OtherStream, TooFew
from tests.datasets.dataset import LENGTHS, table_of, write_dataset

PAIRS = sum(length * (length - 1) for length in LENGTHS)
BATCH = 5


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("data"))


def stream(folder: Path, *, workers: int = 0, seed: int = 0) -> Stream[SampleBatch]:
    clouds = Clouds(table_of(folder))
    samples = Samples(clouds, any_two(clouds.table))
    return Stream(samples, BatchOrder(len(samples), BATCH, seed=seed), workers=workers)


def shown(batches: Sequence[SampleBatch]) -> list[list[list[int]]]:
    return [batch.rows.tolist() for batch in batches]


def test_a_sample_is_two_clouds_of_an_episode_and_the_motion_between(folder: Path) -> None:
    clouds = Clouds(table_of(folder))
    table = clouds.table
    seen = 0
    for batch in stream(folder):
        for number, (current, goal) in enumerate(batch.rows.tolist()):
            np.testing.assert_array_equal(batch.current[number], clouds[current])
            np.testing.assert_array_equal(batch.goal[number], clouds[goal])
            motion = (table.grasps[goal] - table.grasps[current]).astype(np.float32)
            np.testing.assert_array_equal(batch.motion[number], motion)
            assert table.file[current] == table.file[goal]
            seen += 1
    assert seen == PAIRS


def test_workers_and_a_resume_do_not_change_the_sequence(folder: Path) -> None:
    """The same sequence with no worker and with two, and with a change between in the middle."""
    alone = stream(folder)
    epochs = [list(alone), list(alone)]
    together = stream(folder, workers=2)
    found = list(together)
    assert shown(found) == shown(epochs[0])
    assert all(
        torch.equal(one.current, other.current) for one, other in zip(found, epochs[0], strict=True)
    )
    for first, second in ((0, together), (2, stream(folder))):
        begun = stream(folder) if first == 0 else together
        begun.load_state_dict(stream(folder).state_dict())
        before = []
        for batch in begun:
            before.append(batch)
            if len(before) == 3:
                break
        state = json.loads(json.dumps(begun.state_dict()))
        second.load_state_dict(state)
        assert shown([*before, *second]) == shown(epochs[0])
        assert (second.epoch, second.batch) == (1, 0)
    assert shown(list(second)) == shown(epochs[1]) != shown(epochs[0])


def test_a_state_after_the_last_batch_goes_on_with_the_next_epoch(folder: Path) -> None:
    one = stream(folder)
    state = {}
    for _ in one:
        state = one.state_dict()
    other = stream(folder)
    other.load_state_dict(state)
    assert (other.epoch, other.batch) == (1, 0)
    assert shown(list(other)) == shown(list(one))


def test_a_state_of_another_stream_is_refused(folder: Path, tmp_path: Path) -> None:
    state = stream(folder).state_dict()
    with pytest.raises(OtherStream, match="seed is 1, that of the state to go on from is 0"):
        stream(folder, seed=1).load_state_dict(state)
    with pytest.raises(OtherStream, match="data"):
        stream(write_dataset(tmp_path, LENGTHS[::-1])).load_state_dict(state)
    clouds = Clouds(table_of(folder))
    with pytest.raises(OtherStream, match="order is 3"):
        Stream(Samples(clouds, any_two(clouds.table)), BatchOrder(3, 1))


def test_samples_from_rest_begin_at_rest_and_a_mix_has_both(folder: Path) -> None:
    clouds = Clouds(table_of(folder))
    rest = from_rest(clouds.table)
    assert len(rest) == sum(length - 1 for length in LENGTHS)
    for pairs in (rest, mixed(clouds.table, share=0.4)):
        samples = Samples(clouds, pairs)
        rows = torch.cat([batch.rows for batch in Stream(samples, BatchOrder(len(samples), 4))])
        begun = clouds.table.rest[rows[:, 0]].sum()
        assert begun >= len(rest)
        assert len({tuple(row) for row in rows.tolist()}) >= len(rest)


def test_groups_are_dealt_anew_every_epoch_and_hold_every_frame_once(folder: Path) -> None:
    clouds = Clouds(table_of(folder))
    groups = Groups(clouds, size=2)
    batches = Stream(groups, BatchOrder(len(groups), 2))
    paired = [row for row in range(len(clouds)) if LENGTHS[clouds.table.file[row]] > 1]
    epochs = [list(batches), list(batches)]
    for epoch in epochs:
        assert sorted(row for batch in epoch for row in batch.rows.tolist()) == paired
        for batch in epoch:
            files = clouds.table.file[batch.rows.numpy()]
            np.testing.assert_array_equal(batch.clouds, clouds.stack(batch.rows.numpy()))
            pairs = set(zip(batch.current.tolist(), batch.goal.tolist(), strict=True))
            together = batch.groups.tolist()
            assert pairs == {
                (one, other)
                for one in range(len(batch))
                for other in range(len(batch))
                if one != other and together[one] == together[other]
            }
            assert all(files[one] == files[other] for one, other in pairs)
    first, second = ([batch.rows.tolist() for batch in epoch] for epoch in epochs)
    assert first != second


def test_groups_are_of_two_or_more() -> None:
    assert [len(Dealt((7, 1, 4), 3).rows(number, epoch=0)) for number in range(3)] == [4, 3, 4]
    with pytest.raises(TooFew, match="frames in a group is 1, must be at least 2"):
        Dealt((3,), 1)
    with pytest.raises(TooFew, match="two settled frames is 0"):
        Dealt((1, 1), 2)


def test_the_rest_shape_joins_a_share_of_the_groups(folder: Path) -> None:
    clouds = Clouds(table_of(folder))
    rest = clouds.table.rest

    def joined(share: float) -> list[list[bool]]:
        groups = Groups(clouds, size=2, rest_share=share)
        return [
            rest[batch.rows.numpy()].tolist()
            for epoch in range(40)
            for batch in Stream(groups, BatchOrder(len(groups), 1, seed=epoch))
        ]

    every, some, none = (joined(share) for share in (1.0, 0.5, 0.0))
    assert all(sum(group) == 1 for group in every)
    share = [sum(any(group) for group in groups) / len(groups) for groups in (some, none)]
    # It is dealt to some groups anyway, and joins half of the others.
    assert share[0] == pytest.approx(share[1] + (1 - share[1]) / 2, abs=0.1)
    assert joined(0.5) == some
    with pytest.raises(NotAFraction, match=r"rest shape joins is 1\.5, must be"):
        Groups(clouds, rest_share=1.5)

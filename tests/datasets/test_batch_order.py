import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.datasets.batch_order import BatchOrder
from dnet.errors import TooFew

worlds = st.integers(1, 5)


def dealt(order: BatchOrder, epoch: int) -> list[list[int]]:
    return [order.drawn(epoch, number).numbers.tolist() for number in range(len(order))]


@given(count=st.integers(1, 200), batch=st.integers(1, 17), world=worlds, epoch=st.integers(0, 3))
def test_everything_comes_to_one_process_once_an_epoch(
    count: int, batch: int, world: int, epoch: int
) -> None:
    orders = [BatchOrder(count, batch, seed=5, rank=rank, world=world) for rank in range(world)]
    batches = [one for order in orders for one in dealt(order, epoch)]
    assert sorted(number for one in batches for number in one) == list(range(count))
    assert all(len(one) <= batch for one in batches)


@given(count=st.integers(1, 200), batch=st.integers(1, 17), world=worlds)
@settings(deadline=None)  # of many batches, on a busy machine
def test_processes_together_see_the_batches_that_one_would_see(
    count: int, batch: int, world: int
) -> None:
    alone = dealt(BatchOrder(count, batch), 2)
    for rank in range(world):
        assert dealt(BatchOrder(count, batch, rank=rank, world=world), 2) == alone[rank::world]


@given(spare=st.integers(0, 50), batch=st.integers(1, 9), world=worlds)
def test_an_even_order_gives_every_process_as_many_whole_batches(
    spare: int, batch: int, world: int
) -> None:
    count = batch * world + spare
    orders = [BatchOrder(count, batch, rank=rank, world=world, even=True) for rank in range(world)]
    batches = [one for order in orders for one in dealt(order, 0)]
    assert {len(one) for one in batches} == {batch}
    assert len({len(order) for order in orders}) == 1
    left_out = count - len({number for one in batches for number in one})
    assert left_out == count % (batch * world)


def test_an_epoch_is_in_another_order_than_the_one_before() -> None:
    order = BatchOrder(50, 50)
    assert dealt(order, 0) == dealt(order, 0)
    assert dealt(order, 0) != dealt(order, 1)
    assert dealt(order, 0) != dealt(BatchOrder(50, 50, seed=1), 0)
    np.testing.assert_array_equal(np.sort(dealt(order, 1)[0]), np.arange(50))


@pytest.mark.parametrize(
    ("order", "why"),
    [
        ({"count": 0, "batch": 4}, "number of samples is 0, must be at least 1"),
        ({"count": 4, "batch": 0}, "size of a batch is 0, must be at least 1"),
        ({"count": 4, "batch": 1, "world": 2, "rank": 2}, "rank is 0, must be at least 1"),
        (
            {"count": 7, "batch": 4, "world": 2, "even": True},
            "number of samples is 7, must be at least 8",
        ),
    ],
)
def test_what_has_no_order_is_refused(order: dict[str, int], why: str) -> None:
    with pytest.raises(TooFew, match=why):
        BatchOrder(**order)  # type: ignore[arg-type]

import torch
from torch import Tensor

from dnet.training.determinism import repeatable


def derivative() -> Tensor:
    generator = torch.Generator().manual_seed(1)
    values = torch.randn(64, 64, generator=generator, requires_grad=True)
    rows = torch.randint(64, (100_000,), generator=generator)
    weights = torch.randn(100_000, 64, generator=generator)
    (weights * values[rows]).sum().backward()  # type: ignore[no-untyped-call]
    assert values.grad is not None
    return values.grad


def test_rows_that_are_taken_often_have_the_same_derivative_every_time() -> None:
    threads = torch.get_num_threads()
    torch.set_num_threads(4)
    try:
        with repeatable():
            first = derivative()
            assert all(torch.equal(derivative(), first) for _ in range(5))
    finally:
        torch.set_num_threads(threads)


def test_nothing_of_it_is_left_behind() -> None:
    with repeatable():
        assert torch.are_deterministic_algorithms_enabled()
    assert not torch.are_deterministic_algorithms_enabled()
    assert torch.utils.deterministic.fill_uninitialized_memory  # type: ignore[attr-defined]

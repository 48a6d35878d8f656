"""Batch normalisation is its definition, to 1e-5, however many rows there are."""

import pytest
import torch
from torch import Tensor

from dnet.nets.pointconv import BatchNorm


def by_definition(norm: BatchNorm, x: Tensor) -> Tensor:
    mean, variance = norm.mean, norm.variance
    if norm.training:
        mean, variance = x.mean(dim=0), x.var(dim=0, correction=0)
    return (x - mean) / (variance + norm.epsilon).sqrt() * norm.weight + norm.bias


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("rows", [20, 300, 20_000])
def test_values_and_derivatives_of_many_rows_far_from_zero(rows: int, training: bool) -> None:
    torch.manual_seed(0)
    x, wish = 5 + 0.3 * torch.randn(rows, 64), torch.randn(rows, 64)
    norm = BatchNorm(64)
    with torch.no_grad():
        norm.weight.normal_()
        norm.bias.normal_()
        norm.mean.fill_(5)
        norm.variance.fill_(0.1)
    double = BatchNorm(64).double()
    double.load_state_dict(norm.state_dict())
    found = []
    for one, out_of in ((norm, norm), (double, lambda x: by_definition(double, x))):
        one.train(training)
        given = x.to(one.weight.dtype).requires_grad_()
        out = out_of(given)
        loss = (out * wish.to(out.dtype)).sum()
        found.append([out, *torch.autograd.grad(loss, [given, one.weight, one.bias])])
    for got, want in zip(*found, strict=True):
        torch.testing.assert_close(got.double(), want, rtol=0, atol=1e-5 * want.abs().max().item())

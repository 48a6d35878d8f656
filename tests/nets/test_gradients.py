"""Gradients of a training step in float32 are as near to float64 as float32 allows.

The step is that of training: each cloud is encoded once, all ordered pairs meet in the head. The
yardstick is the network written plainly from its equations: its gradients in float64 are the
truth, and what float32 does to them there is what float32 costs.
"""

import copy
from collections.abc import Callable
from contextlib import nullcontext
from functools import cache
from typing import NamedTuple

import pytest
import torch
from torch import Tensor, nn

from dnet.nets.deformernet import DeformerNet
from dnet.nets.fused import step_by_step
from dnet.nets.neighbourhoods import Size
from dnet.nets.pointconv import BatchNorm, GroupNorm, Norm
from tests.nets import reference
from tests.nets.test_deformernet import batch, clouds, in_double, network, watch_closely

COUNT = 6
CURRENT, GOAL = torch.tensor([(a, b) for a in range(COUNT) for b in range(COUNT) if a != b]).t()

Gradients = dict[str, Tensor]


class Found(NamedTuple):
    """Gradients of one step."""

    exact: Gradients
    """Of the equations in float64."""
    plain: Gradients
    """Of the equations in float32."""
    paths: dict[str, Gradients]
    """Of the network."""


@cache
def found(size: Size, norm: Norm, *, training: bool, bias: float) -> Found:
    """Gradients of the same weighted sum of motions; with a large bias, ReLU is open throughout."""
    model = network(size, norm, 192 if size == "light" else 520)
    with torch.no_grad():
        for module in model.modules():
            if isinstance(module, GroupNorm | BatchNorm):
                module.bias.add_(bias)
                module.weight.mul_(0.3 if bias else 1)
    seen = batch(clouds(COUNT, model.config.points), model)
    if norm == "batch":
        watch_closely(model)
        features = model.train().encode(seen)
        model.motion(features[CURRENT], features[GOAL])
    model.train(training)
    torch.manual_seed(3)
    wish = torch.randn(len(CURRENT), 3)

    def gradients(one: DeformerNet, encode: Callable[[], Tensor], *, plainly: bool) -> Gradients:
        features = encode()
        difference = features[GOAL] - features[CURRENT]
        motion = plain_head(one, difference) if plainly else one.head(difference)
        weights = dict(one.named_parameters())
        loss = (motion * wish.to(motion.dtype)).sum()
        return dict(zip(weights, torch.autograd.grad(loss, list(weights.values())), strict=True))

    plain, double, exact = copy.deepcopy(model), copy.deepcopy(model).double(), in_double(seen)
    paths = {}
    for name, way in (("steps", step_by_step), ("fused", nullcontext)):
        with way():
            paths[name] = gradients(model, lambda: model.encode(seen), plainly=False)
    return Found(
        gradients(double, lambda: reference.encode(double, exact.points), plainly=True),
        gradients(plain, lambda: reference.encode(plain, seen.points), plainly=True),
        paths,
    )


def plain_head(model: DeformerNet, hidden: Tensor) -> Tensor:
    children = list(model.head.hidden.children())
    for linear, norm in zip(children[::3], children[1::3], strict=True):
        assert isinstance(linear, nn.Linear)
        assert isinstance(norm, GroupNorm | BatchNorm)
        hidden = reference.layer(hidden, linear, norm)
    output = model.head.output
    return torch.einsum("oi,pi->po", output.weight, hidden) + output.bias


def wrong(got: Gradients, want: Gradients) -> float:
    """Length of the error of the whole gradient, as a share of its own."""
    error = sum(float((got[name].double() - one).square().sum()) for name, one in want.items())
    length = sum(float(one.square().sum()) for one in want.values())
    return float((error / length) ** 0.5)


@pytest.mark.parametrize("path", ["steps", "fused"])
def test_with_group_norm_every_gradient_is_the_one_of_the_equations_to_1e_5(path: str) -> None:
    """As long as no rounding opens or closes a ReLU: here all are open."""
    _, plain, paths = one = found("light", "group", training=True, bias=2.5)
    largest = max(float(gradient.abs().max()) for gradient in one.exact.values())
    for name, want in one.exact.items():
        for got in (paths[path][name], plain[name]):
            # A bias before a norm has a gradient of almost nothing, of which rounding is a part.
            atol = 1e-5 * (float(want.abs().max()) + 0.1 * largest)
            torch.testing.assert_close(got.double(), want, rtol=0, atol=atol, msg=name)
    assert wrong(paths[path], one.exact) < 1e-6


@pytest.mark.parametrize("bias", [0.0, 2.5])
@pytest.mark.parametrize(("norm", "training"), [("group", True), ("batch", True), ("batch", False)])
def test_otherwise_they_are_as_exact_as_those_of_the_plain_network(
    norm: Norm, training: bool, bias: float
) -> None:
    """Or to 1e-5, where that is more.

    A ReLU that rounding opens or closes changes a gradient by a jump, in whatever order sums are
    taken; and BatchNorm makes a signal of small differences between clouds, which costs digits.
    """
    one = found("light", norm, training=training, bias=bias)
    limit = max(1e-5, 3 * wrong(one.plain, one.exact))
    for path, got in one.paths.items():
        assert wrong(got, one.exact) <= limit, path

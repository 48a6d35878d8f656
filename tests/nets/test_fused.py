"""A fused level is the function that `SetAbstraction` writes step by step."""

import copy
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

import pytest
import torch
from torch import Tensor

from dnet.nets.fused import step_by_step
from dnet.nets.neighbourhoods import Size
from dnet.nets.pointconv import GroupNorm, SetAbstraction
from tests.nets import reference
from tests.nets.test_deformernet import batch, clouds, in_double, network

SIZES: tuple[tuple[Size, int], ...] = (("light", 192), ("paper", 520))

# Points, groups, members of a group, features and channels of all levels of both networks.
LEVELS = [
    (401, 128, 16, 3, 64),
    (128, 32, 32, 64, 128),
    (32, 1, 32, 128, 256),
    (602, 512, 32, 3, 64),
    (512, 128, 64, 64, 128),
    (128, 1, 128, 128, 256),
]


@dataclass(frozen=True)
class Call:
    """A level, and what it is called with."""

    level: SetAbstraction
    points: Tensor
    features: Tensor
    centroids: Tensor
    neighbours: Tensor | None
    inverse_density: Tensor

    def __call__(self) -> Tensor:
        out: Tensor = self.level(
            self.points,
            self.features,
            centroids=self.centroids,
            neighbours=self.neighbours,
            inverse_density=self.inverse_density,
        )
        return out

    def gradients(self, wish: Tensor) -> dict[str, Tensor]:
        """With respect to every parameter, points, features and centroids."""
        inputs = {
            name: getattr(self, name).detach().clone().requires_grad_()
            for name in ("points", "features", "centroids")
        }
        out = replace(self, **inputs)()
        wanted = {**dict(self.level.named_parameters()), **inputs}
        found = torch.autograd.grad((out * wish).sum(), list(wanted.values()))
        return dict(zip(wanted, found, strict=True))

    def double(self) -> "Call":
        return Call(
            copy.deepcopy(self.level).double(),
            self.points.double(),
            self.features.double(),
            self.centroids.double(),
            self.neighbours,
            self.inverse_density.double(),
        )


def a_call(
    shape: tuple[int, int, int, int, int] = LEVELS[1], *, count: int = 3, bias: float = 0.0
) -> Call:
    """A level with random weights and the given biases of norms, and random clouds."""
    points, groups, size, features, channels = shape
    torch.manual_seed(0)
    level = SetAbstraction(features, channels, "group")
    with torch.no_grad():
        for weights in level.parameters():
            weights.add_(0.1 * torch.randn_like(weights))
        for module in level.modules():
            if isinstance(module, GroupNorm):
                module.bias.add_(bias)
                module.weight.mul_(1 if bias == 0 else 0.3)
    where = torch.rand(count, points, 3)
    near = torch.cdist(where[:, :groups], where).topk(size, largest=False).indices
    return Call(
        level,
        where,
        torch.randn(count, points, features),
        where[:, :groups] if groups > 1 else where.mean(dim=1, keepdim=True),
        near.to(torch.int16) if groups > 1 else None,
        0.5 + torch.rand(count, points),
    )


def is_fused(out: Tensor) -> bool:
    return out.grad_fn is not None and "FusedLevel" in out.grad_fn.name()


def assert_close(got: dict[str, Tensor], want: dict[str, Tensor], share: float) -> None:
    """Each gradient may be wrong by a share of its length and of a tenth of the longest."""
    longest = max(float(one.norm()) for one in want.values())
    for name, one in want.items():
        wrong = float((got[name].double() - one.double()).norm())
        assert wrong <= share * (float(one.norm()) + 0.1 * longest), name


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("shape", LEVELS)
def test_a_fused_level_is_the_one_computed_step_by_step(
    shape: tuple[int, int, int, int, int], count: int
) -> None:
    call = a_call(shape, count=count)
    got = call()
    assert is_fused(got)
    with step_by_step():
        want = call()
        exact = call.double()()
    assert not is_fused(want)
    assert want.std() > 0.1
    scale = exact.abs().max().item()
    torch.testing.assert_close(got, want, rtol=0, atol=1e-5 * scale)
    torch.testing.assert_close(got.double(), exact, rtol=0, atol=1e-5 * scale)


@pytest.mark.parametrize("shape", LEVELS)
def test_its_derivatives_are_those_of_the_steps(shape: tuple[int, int, int, int, int]) -> None:
    # With these biases ReLU lets everything through, so that no rounding opens or closes it.
    call = a_call(shape, count=2, bias=2.5)
    wish = torch.randn_like(call())
    assert call().min() > 0
    got = call.gradients(wish)
    with step_by_step():
        steps = call.gradients(wish)
    exact = call.double().gradients(wish.double())
    assert_close(got, steps, 2e-4)
    assert_close(got, exact, 1e-4)


@pytest.mark.parametrize("shape", LEVELS)
def test_its_derivatives_stop_where_relu_is_closed(shape: tuple[int, int, int, int, int]) -> None:
    call = a_call(shape, count=2)
    wish = torch.randn_like(call())
    assert (call() == 0).double().mean() > 0.2
    got = call.gradients(wish)
    with step_by_step():
        assert_close(got, call.gradients(wish), 3e-3)


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize(("size", "points"), SIZES)
def test_the_encoder_is_the_one_of_the_equations(size: Size, points: int, count: int) -> None:
    model = network(size, "group", points)
    seen = batch(clouds(count, points), model)
    exact = in_double(seen)
    got = model.encode(seen)
    want = reference.encode(copy.deepcopy(model).double(), exact.points)
    torch.testing.assert_close(got.double(), want, rtol=0, atol=1e-5 * want.abs().max().item())

    def derivatives() -> dict[str, Tensor]:
        weights = dict(model.encoder.named_parameters())
        found = torch.autograd.grad(model.encode(seen).sin().sum(), list(weights.values()))
        return dict(zip(weights, found, strict=True))

    with step_by_step():
        steps = derivatives()
    assert_close(derivatives(), steps, 1e-2)


def everything(call: Call) -> list[Tensor]:
    out = call()
    return [out, *call.gradients(torch.cos(7 * out.detach())).values()]


def with_threads(count: int, work: Callable[[], list[Tensor]]) -> list[Tensor]:
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        return work()
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("shape", LEVELS[:3])
def test_the_number_of_threads_changes_no_byte(shape: tuple[int, int, int, int, int]) -> None:
    # More clouds than are done together.
    call = a_call(shape, count=19)
    alone = with_threads(1, lambda: everything(call))
    for threads in (1, 2, 3):
        again = with_threads(threads, lambda: everything(call))
        assert all(torch.equal(a, b) for a, b in zip(alone, again, strict=True)), threads


def test_the_same_input_gives_the_same_bytes() -> None:
    call = a_call(count=5)
    assert all(torch.equal(a, b) for a, b in zip(everything(call), everything(call), strict=True))


@pytest.mark.parametrize("bias", [0.0, 2.5])
def test_points_may_coincide(bias: float) -> None:
    call = a_call(LEVELS[0], count=2, bias=bias)
    one = call.points[:, :1]
    same = replace(
        call,
        points=one.expand_as(call.points),
        features=call.features[:, :1].expand_as(call.features),
        centroids=one.expand_as(call.centroids),
        inverse_density=torch.full_like(call.inverse_density, 0.3),
        neighbours=torch.zeros_like(call.neighbours) if call.neighbours is not None else None,
    )
    with step_by_step():
        exact = same.double()()
    got = same()
    assert is_fused(got)
    torch.testing.assert_close(got.double(), exact, rtol=0, atol=1e-4 * exact.abs().max().item())
    for name, gradient in same.gradients(torch.ones_like(got)).items():
        assert gradient.isfinite().all(), name


def test_what_is_no_number_stays_so_and_stays_in_its_cloud() -> None:
    call = a_call()
    features = call.features.clone()
    features[1, 0, 0] = torch.nan
    got, want = replace(call, features=features)(), call()
    assert got[1].isnan().all()
    assert torch.equal(got[::2], want[::2])


def test_inputs_may_be_views_and_of_any_integer_type() -> None:
    call = a_call()
    assert call.neighbours is not None
    turned = replace(
        call,
        points=call.points.transpose(1, 2).contiguous().transpose(1, 2),
        features=torch.stack([call.features, call.features], dim=-1)[..., 0],
        neighbours=call.neighbours.long(),
    )
    assert torch.equal(turned(), call())


@pytest.mark.parametrize("row", [-1, 128, 2**40])
def test_a_neighbour_that_does_not_exist_is_refused(row: int) -> None:
    call = a_call()
    assert call.neighbours is not None
    neighbours = call.neighbours.long()
    neighbours[2, 5, 3] = row
    with pytest.raises(IndexError, match="no row of its cloud"):
        replace(call, neighbours=neighbours)()


class Subclass(Tensor):
    """Stands for tensors that hold no numbers of their own."""


def double_precision() -> Call:
    return a_call().double()


def batch_norm() -> Call:
    call = a_call()
    return replace(call, level=SetAbstraction(64, 128, "batch"))


def derivatives_of_densities() -> Call:
    call = a_call()
    return replace(call, inverse_density=call.inverse_density.clone().requires_grad_())


def odd_groups() -> Call:
    call = a_call()
    assert call.neighbours is not None
    return replace(call, neighbours=call.neighbours[..., :30])


def subclass() -> Call:
    call = a_call()
    return replace(call, features=call.features.as_subclass(Subclass))


@pytest.mark.parametrize(
    "other", [double_precision, batch_norm, derivatives_of_densities, odd_groups, subclass]
)
def test_what_the_kernels_do_not_take_is_computed_step_by_step(other: Callable[[], Call]) -> None:
    assert is_fused(a_call()())
    call = other()
    out = call()
    assert not is_fused(out)
    with step_by_step():
        assert torch.equal(out, call())


@pytest.mark.parametrize(
    "within", [step_by_step, lambda: torch.autocast("cpu", dtype=torch.bfloat16)]
)
def test_what_surrounds_a_call_can_keep_it_from_being_fused(
    within: Callable[[], AbstractContextManager[object]],
) -> None:
    call = a_call()
    assert is_fused(call())
    with within():
        assert not is_fused(call())
    assert is_fused(call())


def test_a_level_can_be_traced_and_exported() -> None:
    # In a process of its own: torch cannot look through the shape checks of the tests.
    code = """
import torch
from dnet.nets.pointconv import SetAbstraction

level = SetAbstraction(3, 64, "group")
points = torch.rand(2, 64, 3)
tables = {
    "centroids": points[:, :8],
    "neighbours": torch.randint(64, (2, 8, 16)),
    "inverse_density": torch.rand(2, 64),
}
want = level(points, points, **tables)
assert "FusedLevel" in want.grad_fn.name()
compiled = torch.compile(level, backend="eager", fullgraph=True)
exported = torch.export.export(level, (points, points), tables).module()
for traced in (compiled, exported):
    got = traced(points, points, **tables)
    assert "FusedLevel" not in got.grad_fn.name()
    torch.testing.assert_close(got, want)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_training_and_prediction_agree_to_the_byte() -> None:
    call = a_call()
    with torch.no_grad():
        without = call()
    assert torch.equal(call().detach(), without)

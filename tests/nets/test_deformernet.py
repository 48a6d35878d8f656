import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from dnet.errors import BadCloud, LongCloud, ShortCloud, TooFew
from dnet.geometry.sampling import farthest_points
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig, prepare
from dnet.nets.neighbourhoods import BANDWIDTHS, Neighbourhoods, Size, stack
from dnet.nets.pointconv import BatchNorm, Norm
from dnet.types import Cloud
from tests.nets import reference

SIZES: tuple[tuple[Size, int], ...] = (("light", 136), ("paper", 520))
NORMS: tuple[Norm, ...] = ("group", "batch")


def network(size: Size = "light", norm: Norm = "group", points: int = 192) -> DeformerNet:
    torch.manual_seed(0)
    model = DeformerNet(DeformerNetConfig(size=size, norm=norm, points=points))
    # First weights have norms of scale 1 and shift 0, which would hide a mistake in using them.
    with torch.no_grad():
        for weights in model.parameters():
            weights.add_(0.1 * torch.randn_like(weights))
    return model


def clouds(count: int, points: int = 192, *, seed: int = 0) -> list[Cloud]:
    """Boxes, each sheared at random."""
    rng = np.random.default_rng(seed)
    boxes = rng.uniform([-0.05, -0.05, 0], [0.05, 0.05, 0.04], (count, points, 3))
    raw = boxes @ (np.eye(3) + rng.uniform(-0.5, 0.5, (count, 3, 3)))
    return [farthest_points(one.astype(np.float32), points) for one in raw]


def batch(seen: list[Cloud], model: DeformerNet) -> Neighbourhoods:
    return stack([prepare(cloud, model.config) for cloud in seen])


def watch_closely(model: DeformerNet) -> None:
    """Let running figures become those of the next batch."""
    for module in model.modules():
        if isinstance(module, BatchNorm):
            module.momentum = 1.0


def in_double(seen: Neighbourhoods) -> Neighbourhoods:
    points = seen.points.double()
    first, second, third = (
        # In farthest-point order, the centroids of each level are the first points.
        reference.inverse_density(points[:, : densities.shape[1]], bandwidth)
        for densities, bandwidth in zip(seen.inverse_densities, BANDWIDTHS, strict=True)
    )
    return replace(seen, points=points, inverse_densities=(first, second, third))


def gradients(loss: Tensor, model: DeformerNet) -> dict[str, Tensor]:
    model.zero_grad()
    torch.autograd.backward(loss)
    found = {}
    for name, weights in model.named_parameters():
        assert weights.grad is not None, name
        found[name] = weights.grad.clone()
    return found


@pytest.mark.parametrize("training", [True, False])
@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize(("size", "points"), SIZES)
def test_the_network_is_the_one_of_the_equations(
    size: Size, points: int, norm: Norm, training: bool
) -> None:
    single = network(size, norm, points)
    seen = clouds(6, points)
    if norm == "batch":
        watch_closely(single)
        single.train()(batch(seen, single), batch(seen[::-1], single))
    single.train(training)
    model = copy.deepcopy(single).double()
    plain = copy.deepcopy(model)
    wish = torch.arange(9.0).view(3, 3).double()

    here, there = in_double(batch(seen[:3], model)), in_double(batch(seen[3:], model))
    got = model(here, there) / model.config.motion_unit
    want = reference.motion(plain, here.points, there.points) / plain.config.motion_unit
    torch.testing.assert_close(got, want, rtol=1e-8, atol=1e-8)
    assert want.std(dim=0).max().item() > 1e-3
    got_gradients = gradients((got - wish).square().sum(), model)
    want_gradients = gradients((want - wish).square().sum(), plain)
    largest = max(float(gradient.abs().max()) for gradient in want_gradients.values())
    for name, gradient in want_gradients.items():
        torch.testing.assert_close(
            got_gradients[name], gradient, rtol=1e-6, atol=1e-7 * largest, msg=name
        )

    exact = reference.encode(plain, torch.cat([here.points, there.points])).float()
    rounded = single.encode(batch(seen, single))
    torch.testing.assert_close(rounded, exact, rtol=0, atol=1e-5 * exact.max().item())


def test_without_density_crowded_points_count_like_all_others() -> None:
    torch.manual_seed(0)
    model = DeformerNet(DeformerNetConfig(points=192, density=False)).double()
    assert not any("density" in name for name in model.state_dict())
    seen = batch(clouds(3), model)
    here = replace(seen, points=seen.points.double())
    got = model.encode(here)
    torch.testing.assert_close(got, reference.encode(model, here.points), rtol=1e-8, atol=1e-8)
    below, middle, above = (2 * x for x in seen.inverse_densities)
    crowded = replace(here, inverse_densities=(below, middle, above))
    assert torch.equal(model.encode(crowded), got)


def test_running_figures_are_kept_as_batch_normalisation_defines_them() -> None:
    model = network(norm="batch")
    seen, turned = batch(clouds(4), model), batch(clouds(4)[::-1], model)
    torch_norm = torch.nn.BatchNorm1d(128)
    norm = model.head.hidden[1]
    caught: list[Tensor] = []
    model.head.hidden[0].register_forward_hook(lambda *call: caught.append(call[2].detach()))
    for _ in range(3):
        model(seen, turned)
    for x in caught:
        torch_norm(x)
    torch.testing.assert_close(norm.mean, torch_norm.running_mean)
    # torch keeps the unbiased variance, as the definition of the running figure has it.
    torch.testing.assert_close(norm.variance, torch_norm.running_var)


def test_the_paper_network_has_the_size_of_the_paper() -> None:
    model = DeformerNet(DeformerNetConfig(size="paper"))
    assert sum(weights.numel() for weights in model.parameters()) == 1_466_836


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_the_order_in_which_points_were_seen_does_not_matter(seed: int) -> None:
    model = network().eval()
    rng = np.random.default_rng(seed)
    raw = rng.uniform(-0.05, 0.05, (400, 3)).astype(np.float32)
    goal = clouds(1)[0]
    order = rng.permutation(len(raw))
    start = int(np.flatnonzero(order == 0)[0])
    here = model.predict(farthest_points(raw, 192), goal)
    there = model.predict(farthest_points(raw[order], 192, start=start), goal)
    np.testing.assert_allclose(there, here, atol=1e-6)


@pytest.mark.parametrize("norm", NORMS)
def test_encoding_once_for_many_pairs_is_the_same_as_encoding_each_pair(norm: Norm) -> None:
    model = network(norm=norm).eval()
    seen = clouds(4)
    features = model.encode(batch(seen, model))
    current, goal = torch.tensor([0, 1, 3, 2]), torch.tensor([1, 3, 0, 0])
    together = model.motion(features[current], features[goal])
    apart = torch.cat(
        [
            model(batch([seen[a]], model), batch([seen[b]], model))
            for a, b in zip(current.tolist(), goal.tolist(), strict=True)
        ]
    )
    torch.testing.assert_close(together, apart, rtol=1e-3, atol=2e-5)


def test_a_cloud_in_a_batch_does_not_change_the_motion_of_another() -> None:
    model = network(norm="group").train()
    seen = clouds(4)
    alone = model(batch(seen[:1], model), batch(seen[1:2], model))
    among = model(batch(seen[::2], model), batch(seen[1::2], model))[:1]
    torch.testing.assert_close(among, alone, rtol=1e-3, atol=2e-5)


@pytest.mark.parametrize("norm", NORMS)
@pytest.mark.parametrize("training", [True, False])
def test_prediction_is_the_evaluated_network_and_leaves_it_as_it_was(
    norm: Norm, training: bool
) -> None:
    model = network(norm=norm).train(training)
    before = copy.deepcopy(model.state_dict())
    current, goal = clouds(2)
    motion = model.predict(current, goal)
    assert motion.dtype == np.float64
    assert model.training is training
    for name, weights in model.state_dict().items():
        assert torch.equal(weights, before[name]), name
    with torch.no_grad():
        want = model.eval()(batch([current], model), batch([goal], model))[0]
    np.testing.assert_allclose(motion, want.numpy(), rtol=1e-4, atol=1e-7)


def test_units_scale_what_goes_in_and_what_comes_out() -> None:
    model = network()
    twin = DeformerNet(DeformerNetConfig(points=192, coordinates="world", motion_unit=0.03))
    twin.load_state_dict(model.state_dict())
    current, goal = clouds(2)
    np.testing.assert_allclose(
        twin.predict(current * 10, goal * 10), 3 * model.predict(current, goal), rtol=1e-5
    )


@given(bad=st.integers(1, 5), value=st.sampled_from([np.nan, np.inf, -np.inf]))
@settings(max_examples=10, deadline=None)
def test_coordinates_that_are_not_numbers_are_counted_and_refused(bad: int, value: float) -> None:
    current, goal = clouds(2)
    goal[:bad, 1] = value
    with pytest.raises(BadCloud, match=f"goal cloud has {bad} of 192 points with NaN"):
        network().predict(current, goal)


def test_a_cloud_with_too_few_points_is_refused() -> None:
    current, goal = clouds(2)
    with pytest.raises(ShortCloud, match="191 points, need at least 192"):
        network().predict(current[:-1], goal)


def test_of_a_larger_cloud_the_farthest_points_are_taken() -> None:
    current, goal = clouds(2, 500)
    model = network()
    few = [farthest_points(cloud, 192) for cloud in (current, goal)]
    np.testing.assert_array_equal(model.predict(current, goal), model.predict(*few))


def test_a_goal_is_encoded_once_until_it_or_the_weights_change() -> None:
    current, other, goal = clouds(3)
    model = network()
    encoded: list[int] = []
    model.encoder.register_forward_hook(lambda *call: encoded.append(1))
    first = model.predict(current, goal)
    model.predict(other, goal.copy())
    np.testing.assert_array_equal(model.predict(current, goal), first)
    assert len(encoded) == 4
    goal[3] += 0.01
    assert not np.array_equal(model.predict(current, goal), first)
    assert len(encoded) == 6
    with torch.no_grad():
        model.encoder.first.output_linear.weight.mul_(1.5)
    changed = model.predict(current, goal)
    fresh = DeformerNet(model.config)
    fresh.load_state_dict(model.state_dict())
    np.testing.assert_array_equal(fresh.predict(current, goal), changed)


def test_centred_coordinates_do_not_care_where_both_clouds_are() -> None:
    model = DeformerNet(DeformerNetConfig(points=192, coordinates="centred"))
    current, goal = clouds(2)
    shift = np.array([0.3, -0.2, 0.1], np.float32)
    np.testing.assert_allclose(
        model.predict(current + shift, goal + shift),
        model.predict(current, goal),
        rtol=1e-3,
        atol=1e-6,
    )


@pytest.mark.parametrize(("size", "least"), [("light", 128), ("paper", 512)])
def test_a_network_needs_as_many_points_as_its_first_level_has_centroids(
    size: Size, least: int
) -> None:
    assert DeformerNetConfig(size=size, points=least).points == least
    with pytest.raises(TooFew, match=f"{size} network is {least - 1}, must be at least {least}"):
        DeformerNetConfig(size=size, points=least - 1)


def test_a_network_takes_no_more_points_than_its_tables_can_number() -> None:
    with pytest.raises(LongCloud, match="32768 points, the network takes 32767"):
        DeformerNetConfig(points=32768)

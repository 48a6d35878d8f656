import numpy as np
import pytest
import torch

from dnet.errors import BadCloud, ShortCloud
from dnet.geometry.hidden_sides import SIDE_POINTS
from dnet.nets.deformernet import DeformerNetConfig, prepare
from dnet.nets.manipulation_point import (
    DensePredictor,
    PointRegressor,
    expected,
    middle,
    propagate,
    surface,
)
from dnet.nets.neighbourhoods import Neighbourhoods, stack
from dnet.nets.pointconv import Norm
from dnet.types import Cloud

CONFIG = DeformerNetConfig(points=160)
KINDS = (PointRegressor, DensePredictor)
Kind = type[PointRegressor | DensePredictor]


def cloud(seed: int) -> Cloud:
    return np.random.default_rng(seed).uniform(-0.05, 0.05, (160, 3)).astype(np.float32)


def batch(*seeds: int) -> Neighbourhoods:
    return stack([prepare(cloud(seed), CONFIG) for seed in seeds])


def network(kind: Kind, norm: Norm = "group") -> PointRegressor | DensePredictor:
    torch.manual_seed(0)
    return kind(DeformerNetConfig(points=160, norm=norm)).eval()


def answer(
    model: PointRegressor | DensePredictor,
    initial: Neighbourhoods,
    goal: Neighbourhoods,
    of: list[int],
) -> torch.Tensor:
    if isinstance(model, PointRegressor):
        found: torch.Tensor = model(initial, goal, torch.tensor(of))
        return found
    scored = model(initial, goal, torch.tensor(of), candidates=surface(initial, 50))
    scores: torch.Tensor = scored.scores
    return scores


@pytest.mark.parametrize("norm", ["group", "batch"])
@pytest.mark.parametrize("kind", KINDS)
def test_goals_of_one_batch_are_answered_as_if_alone(kind: Kind, norm: Norm) -> None:
    model = network(kind, norm)
    together = answer(model, batch(0, 1), batch(2, 3, 4), [0, 1, 0])
    for row, (initial, goal) in enumerate([(0, 2), (1, 3), (0, 4)]):
        alone = answer(model, batch(initial), batch(goal), [0])
        torch.testing.assert_close(together[row], alone[0], rtol=1e-4, atol=1e-5)


def test_scores_are_logarithms_of_probabilities() -> None:
    scores = answer(network(DensePredictor), batch(0), batch(1, 2), [0, 0])
    assert scores.shape == (2, 50 + SIDE_POINTS)
    torch.testing.assert_close(scores.exp().sum(dim=1), torch.ones(2))


def test_the_choice_of_a_dense_predictor_is_a_candidate() -> None:
    chosen = DensePredictor(CONFIG).eval().choose(cloud(0), cloud(1))
    assert chosen.candidates is not None
    assert chosen.probabilities is not None
    np.testing.assert_array_equal(chosen.candidates[:160], cloud(0))
    assert np.linalg.norm(chosen.candidates - chosen.point, axis=1).min() < 1e-7
    assert len(chosen.candidates) == len(chosen.probabilities) == 160 + SIDE_POINTS
    assert chosen.probabilities.sum() == pytest.approx(1, abs=1e-5)


def test_a_regressor_without_a_head_chooses_the_middle() -> None:
    model = PointRegressor(CONFIG).eval()
    torch.nn.init.zeros_(model.head.output.weight)
    torch.nn.init.zeros_(model.head.output.bias)
    chosen = model.choose(cloud(0), cloud(1))
    np.testing.assert_allclose(chosen.point, cloud(0).mean(axis=0), atol=1e-6)
    torch.testing.assert_close(
        middle(batch(0, 1), CONFIG)[1], torch.from_numpy(cloud(1).mean(axis=0)), atol=1e-6, rtol=0
    )


def test_the_candidate_nearest_to_the_mean_of_the_heat_map_is_expected() -> None:
    candidates = torch.tensor([[0.0, 0, 0], [0.01, 0, 0], [0.02, 0, 0], [0.1, 0, 0]])
    scores = torch.tensor([[0.4, 0.0, 0.6, 0.0], [0.0, 0.0, 0.1, 0.9]]).log()
    torch.testing.assert_close(expected(scores, candidates), candidates[[1, 3]])


def test_values_are_propagated_exactly_to_the_places_and_evenly_between() -> None:
    places = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [0, 5, 0], [0, -6, 0]]])
    values = torch.tensor([[[1.0], [3.0], [7.0], [9.0]]])
    points = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0]]])
    found = propagate(points, places, values)[0, :, 0]
    torch.testing.assert_close(found[:2], torch.tensor([1.0, 3.0]), atol=1e-4, rtol=0)
    near = 1 / 0.5
    far = 1 / (0.25 + 25) ** 0.5
    want = (near * 1 + near * 3 + far * 7) / (2 * near + far)
    torch.testing.assert_close(found[2], torch.tensor(want), atol=1e-4, rtol=0)


@pytest.mark.parametrize("kind", KINDS)
def test_bad_clouds_are_refused(kind: Kind) -> None:
    model = kind(CONFIG).eval()
    with pytest.raises(ShortCloud, match="has 20 points, need at least 160"):
        model.choose(cloud(0), cloud(1)[:20])
    bad = cloud(0)
    bad[3] = np.nan
    with pytest.raises(BadCloud, match="initial cloud has 1 of 160"):
        model.choose(bad, cloud(1))


def test_the_scores_of_a_dense_predictor_leave_the_motion_that_guides_them_alone() -> None:
    model = DensePredictor(CONFIG).train()
    torch.autograd.backward(answer(model, batch(0), batch(1), [0])[0, 0])
    for name, weights in model.named_parameters():
        assert (weights.grad is None) == name.startswith("guide.head."), name


def test_points_that_the_motion_carries_onto_the_goal_are_at_no_distance_from_it() -> None:
    model = DensePredictor(CONFIG)
    points = batch(0).points
    motion = torch.tensor([[0.3, -0.1, 0.2]])
    on_it = model._distances(points, points + motion[:, None], torch.tensor([0]), motion)
    assert on_it.abs().max() < 1e-4
    off = model._distances(points, points + motion[:, None], torch.tensor([0]), 0 * motion)
    assert off[..., 3].min() > 0
    offset, length = off[..., :3].norm(dim=2), off[..., 3]
    torch.testing.assert_close(offset, length)

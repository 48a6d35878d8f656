from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from dnet.nets.keypoints import KeypointNet
from dnet.nets.manipulation_point import DensePredictor, PointRegressor, surface
from dnet.training.examples import Examples, stream_of
from dnet.training.frames import Frames
from dnet.training.objectives import CarryingError, HeatMap, MotionError, Objective, PointError
from dnet.training.parallel import Process
from dnet.training.settings import TrainingSettings
from dnet.training.tasks import TASKS, Model, new_network, task_of
from dnet.training.training import Training
from tests.training.deforming_box import SMALL, box_frames

SETTINGS = TrainingSettings(groups=2, frames=3, augmentation=None, epochs=18)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1, 2, 3])


def batch(frames: Frames, model: Model) -> Examples:
    task = TASKS[model]
    return next(iter(stream_of(frames, SETTINGS, process=Process(), target=task.target)))


def losses(objective: Objective[Any], batch: Examples) -> torch.Tensor:
    return objective(batch.clouds, batch.current, batch.goal, batch.motions, batch.points)


def test_a_motions_loss_is_its_squared_error(frames: Frames) -> None:
    network = new_network(SMALL, seed=0).eval()
    examples, objective = batch(frames, "deformernet"), MotionError(network)
    features = network.encode(examples.clouds)
    motions = network.motion(features[examples.current], features[examples.goal])
    squares = (1000 * (motions - examples.motions)).square().mean(dim=1)
    torch.testing.assert_close(losses(objective, examples) * objective.shown, squares)


def test_points_are_learned_from_rest_to_every_other_shape_of_a_group(frames: Frames) -> None:
    seen = 0
    for examples in stream_of(frames, SETTINGS, process=Process(), target="point"):
        rests = torch.unique(examples.current)
        assert len(rests) == 2
        assert not set(rests.tolist()) & set(examples.goal.tolist())
        for rest in rests.tolist():
            targets = examples.points[examples.current == rest]
            assert (targets == targets[0]).all()
            true = frames.table.grasps[frames.table.rest].astype(np.float32)
            assert (np.abs(true - targets[0].numpy()).max(axis=1) == 0).any()
        seen += len(examples.goal)
    assert seen == int((~frames.table.rest).sum())


def test_a_placed_point_moves_with_its_object(frames: Frames) -> None:
    settings = TrainingSettings(groups=2, frames=3)
    examples = next(iter(stream_of(frames, settings, process=Process(), target="point")))
    unit = SMALL.coordinate_unit
    plain = frames.table
    for pair, rest in enumerate(examples.current.tolist()):
        distances = (examples.clouds.points[rest] * unit - examples.points[pair]).norm(dim=1)
        # How far the manipulation point is from each point of its cloud does not change.
        found = [
            np.linalg.norm(frames.clouds[row] - plain.grasps[row], axis=1)
            for row in np.flatnonzero(plain.rest).tolist()
        ]
        assert min(np.abs(one - distances.numpy()).max() for one in found) < 1e-5


def test_a_heat_map_is_right_where_it_is_the_gaussian_about_the_truth(frames: Frames) -> None:
    network = DensePredictor(SMALL)
    examples, objective = batch(frames, "dense"), HeatMap(network)
    found = losses(objective, examples)
    assert (found > 0).all()
    rests, of = torch.unique(examples.current, return_inverse=True)
    candidates = surface(examples.clouds.take(rests), 100)
    labels = objective._labels(candidates, of, examples.points)
    torch.testing.assert_close(labels.exp().sum(dim=1), torch.ones(len(labels)))
    unit = SMALL.coordinate_unit
    places = candidates[of] * unit
    nearest = (places - examples.points[:, None]).norm(dim=2).argmin(dim=1)
    assert torch.equal(labels.argmax(dim=1), nearest)


@pytest.mark.parametrize(("model", "share"), [("grasp", 0.3), ("dense", 0.5)])
def test_where_to_grasp_is_learned(frames: Frames, model: Model, share: float) -> None:
    task = TASKS[model]
    network = task.new(frames.config, seed=0)
    assert isinstance(network, PointRegressor | DensePredictor)
    assert task_of(network) is task
    stream = stream_of(frames, SETTINGS, process=Process(), target=task.target)
    training = Training(task.objective(network), stream, SETTINGS)
    before = task.judge(training.average, frames)
    told = []
    while training.progress < 1:
        told += [step.loss for step in training.epoch()]
        training.close_epoch()
    after = task.judge(training.average, frames)
    assert before is not None
    assert after is not None
    assert after.any_pair is None
    assert after.main.pairs == int((~frames.table.rest).sum())
    assert np.mean(told[-8:]) < share * np.mean(told[:8])
    assert after.main.mean_mm < before.main.mean_mm


def test_a_regressors_loss_is_its_squared_error(frames: Frames) -> None:
    network = PointRegressor(SMALL).eval()
    examples, objective = batch(frames, "grasp"), PointError(network)
    rests, of = torch.unique(examples.current, return_inverse=True)
    points = network(examples.clouds.take(rests), examples.clouds.take(examples.goal), of)
    squares = (1000 * (points - examples.points)).square().mean(dim=1)
    torch.testing.assert_close(losses(objective, examples) * objective.shown, squares)


def test_carrying_is_learned_from_clouds_alone(frames: Frames) -> None:
    network = TASKS["keypoints"].new(frames.config, seed=0)
    assert isinstance(network, KeypointNet)
    examples, objective = batch(frames, "keypoints"), CarryingError(network)
    told_nothing = replace(examples, motions=0 * examples.motions, points=0 * examples.points)
    torch.testing.assert_close(losses(objective, examples), losses(objective, told_nothing))
    stream = stream_of(frames, SETTINGS, process=Process())
    training = Training(objective, stream, SETTINGS)
    before, told = TASKS["keypoints"].judge(network, frames), []
    assert before is not None
    while training.progress < 1:
        told += [step.loss for step in training.epoch()]
        training.close_epoch()
    after = TASKS["keypoints"].judge(training.average, frames)
    assert after is not None
    assert np.mean(told[-8:]) < 0.7 * np.mean(told[:8])
    assert after.main.mse_mm2 < 0.7 * before.main.zero_mse_mm2

"""The controllers and the ways to choose a grasp by their names on the command line."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np

import dnet
from dnet.errors import BadCheckpoint, UnknownTruth
from dnet.laboratory import Laboratory
from dnet.nets.deformernet import DeformerNet
from dnet.nets.hu import HuNet
from dnet.nets.keypoints import KeypointNet
from dnet.nets.manipulation_point import DensePredictor, PointRegressor
from dnet.nets.onnx_network import OnnxDeformerNet
from dnet.perception.cloud import POINTS
from dnet.servo.controllers import Controller, Nothing, Oracle
from dnet.servo.displacement_heuristic import DisplacementHeuristic
from dnet.servo.grasp_pickers import FarthestPoint, MostDisplaced, NetworkPicker
from dnet.servo.online import OnlineHu
from dnet.servo.pickers import Picker, TruePoint
from dnet.servo.random_trials import RandomTree
from dnet.training.checkpoints import load_kind, weights_file
from dnet.trials.goals import Task
from dnet.trials.request import ControllerName, Trial
from dnet.weights import DEFORMERNET, DENSE, HU, KEYPOINTS, REGRESSOR

N = TypeVar("N", DeformerNet | OnnxDeformerNet, HuNet)


@dataclass(frozen=True, slots=True)
class Setting:
    """What a method may be made from."""

    trial: Trial
    task: Task
    lab: Laboratory


def _deformernet(setting: Setting) -> Controller:
    model = _network(setting.trial.checkpoint)
    _check_points(setting, model.config.points, shipped=DEFORMERNET)
    # The goal is encoded, and kernels are loaded, before the run: no step waits for it.
    model.predict(setting.task.goal.cloud, setting.task.goal.cloud)
    return model


def _hu(setting: Setting) -> HuNet:
    model = _hu_network(setting.trial.checkpoint)
    _check_points(setting, model.config.points, shipped=HU)
    return model


def _hu_online(setting: Setting) -> Controller:
    return OnlineHu(_hu(setting), lambda: setting.lab.world.tip)


def _check_points(setting: Setting, want: int, *, shipped: Path) -> None:
    points = len(setting.task.goal.cloud)
    if points != want:
        raise BadCheckpoint(
            setting.trial.checkpoint or shipped,
            f"takes clouds of {want} points, the goal has {points}",
            "use a network trained on clouds like the goal's",
        )


def _oracle(setting: Setting) -> Controller:
    goal, world = setting.task.goal, setting.lab.world
    if goal.grasp is None:
        raise UnknownTruth("--controller oracle", goal.source)
    return Oracle(lambda: world.tip, goal.grasp)


def _none(setting: Setting) -> Controller:
    del setting
    return Nothing()


def _rrt(setting: Setting) -> Controller:
    trial, workspace = setting.trial, setting.lab.settings.workspace
    return RandomTree(
        lambda: setting.lab.world.tip,
        low=np.array(workspace.displacement_low),
        high=np.array(workspace.displacement_high),
        # The last motion goes back to the best.
        trials=max(trial.settings.steps - 1, 1),
        seed=trial.seed,
    )


CONTROLLERS: Mapping[str, Callable[[Setting], Controller]] = {
    "deformernet": _deformernet,
    "hu": _hu,
    "hu-online": _hu_online,
    "oracle": _oracle,
    "none": _none,
    "rrt": _rrt,
}
"""By `ControllerName`."""


def _truth(setting: Setting) -> Picker:
    return TruePoint(np.array(setting.task.scene.manipulation_point))


def _regressor(setting: Setting) -> Picker:
    return NetworkPicker(load_kind(setting.trial.grasp_checkpoint or REGRESSOR, PointRegressor))


def _dense(setting: Setting) -> Picker:
    return NetworkPicker(load_kind(setting.trial.grasp_checkpoint or DENSE, DensePredictor))


def _keypoints(setting: Setting) -> Picker:
    network = load_kind(setting.trial.grasp_checkpoint or KEYPOINTS, KeypointNet)
    return DisplacementHeuristic(network.keypoints, workspace=setting.lab.settings.workspace)


def _displaced(setting: Setting) -> Picker:
    del setting
    return MostDisplaced()


def _farthest(setting: Setting) -> Picker:
    return FarthestPoint(np.array(setting.task.scene.manipulation_point))


PICKERS: Mapping[str, Callable[[Setting], Picker]] = {
    "truth": _truth,
    "keypoints": _keypoints,
    "regressor": _regressor,
    "dense": _dense,
    "displaced": _displaced,
    "farthest": _farthest,
}
"""By `GraspName`."""


def _network(checkpoint: Path | None) -> DeformerNet | OnnxDeformerNet:
    return _as_it_is(dnet.load, checkpoint or DEFORMERNET)


def _hu_network(checkpoint: Path | None) -> HuNet:
    return _as_it_is(_load_hu, checkpoint or HU)


def _load_hu(path: Path) -> HuNet:
    return load_kind(path, HuNet)


def _as_it_is(load: Callable[[Path], N], path: Path) -> N:
    """Load a network, but not twice, unless its file is another one meanwhile."""
    state = weights_file(path).stat()
    return _kept(load, path, state.st_ino, state.st_mtime_ns)


@lru_cache(maxsize=4)
def _kept(load: Callable[[Path], N], path: Path, *_: int) -> N:
    return load(path)


def points_of(controller: ControllerName, checkpoint: Path | None) -> int:
    """Return how many points the clouds have that a controller sees.

    Raises:
        BadCheckpoint: If there is no such network.
    """
    if controller == "deformernet":
        return _network(checkpoint).config.points
    if controller in ("hu", "hu-online"):
        return _hu_network(checkpoint).config.points
    return POINTS

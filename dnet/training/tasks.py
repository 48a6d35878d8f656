"""What can be trained: each network with its loss, its targets and its judge."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, cast

import torch

from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.nets.hu import HuNet
from dnet.nets.keypoints import KeypointNet
from dnet.nets.manipulation_point import DensePredictor, PointRegressor
from dnet.training.components import find_components
from dnet.training.feature_scale import scale_features
from dnet.training.frames import Config, Frames, Target
from dnet.training.objectives import (
    CarryingError,
    HeatMap,
    MotionError,
    Network,
    Objective,
    PointError,
)
from dnet.training.point_scores import point_errors
from dnet.training.scores import Errors, errors_of
from dnet.training.settings import TrainingSettings

Model = Literal["deformernet", "hu", "grasp", "dense", "keypoints"]
"""`deformernet`: the motion from one cloud to another; `hu`: the same from features made by hand;
`grasp`: where to grasp, as a position; `dense`: where to grasp, as a score for each point;
`keypoints`: which point is which, from clouds alone."""


def _nothing(network: Network, frames: Frames) -> None:
    del network, frames


@dataclass(frozen=True)
class Task:
    """A network and how it is trained and judged."""

    network: type[Network]
    objective: Callable[[Any], Objective[Any]]
    target: Target
    judge: Callable[..., Errors | None]
    """`errors_of`, or what takes its place."""
    does: str
    """What the network does, for its card."""
    zero: str
    """What predicting zero stands for."""
    settings: TrainingSettings = field(default_factory=TrainingSettings)
    """What it is trained with unless told otherwise."""
    fit: Callable[[Any, Frames], None] = _nothing
    """Fits a network that is to be trained, its weights to begin with in place, to the frames
    that it is to learn from; the same frames, the same network."""

    def new(self, config: Config, *, seed: int) -> Network:
        """Return an untrained network whose first weights are a function of `seed`."""
        network = cast(Callable[[Any], Network], self.network)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return network(config)


TASKS: dict[Model, Task] = {
    "deformernet": Task(
        DeformerNet,
        MotionError,
        "motion",
        errors_of,
        "Maps the current and the goal cloud of a deformable object to the motion of the gripper "
        "that holds it (Thach, Kuntz, Hermans 2021; PointConv: Wu, Qi, Fuxin 2019).",
        "no motion",
    ),
    "hu": Task(
        HuNet,
        MotionError,
        "motion",
        errors_of,
        "Maps how the surfaces of the current and the goal cloud of a deformable object are turned "
        "(extended FPFH: Rusu et al. 2010) to the motion of the gripper that holds it, after Hu, "
        "Han, Sun, Pan and Manocha 2019: made to compare DeformerNet with.",
        "no motion",
        # It has 731 weights, and was tried with these. No turns: its features are blind to them.
        TrainingSettings(learning_rate=0.01, groups=4, augmentation=None),
        find_components,
    ),
    "grasp": Task(
        PointRegressor,
        PointError,
        "point",
        point_errors,
        "Maps the initial and the goal cloud of a deformable object to the point at which to "
        "grasp it (Thach, Kuntz, Hermans 2021; PointConv: Wu, Qi, Fuxin 2019).",
        "the middle",
    ),
    "dense": Task(
        DensePredictor,
        HeatMap,
        "point",
        point_errors,
        "Maps the initial and the goal cloud of a deformable object to a probability for each "
        "point of the initial cloud that it is the one to grasp (PointConv: Wu, Qi, Fuxin 2019).",
        "the middle",
    ),
    "keypoints": Task(
        KeypointNet,
        CarryingError,
        "motion",
        errors_of,
        "Finds keypoints of a deformable object that are the same points of it in two clouds, "
        "after the Transporter (Kulkarni et al. 2019) and KeypointDeformer (Jakab et al. 2021). "
        "Its carrier learns from clouds alone. The errors are those of carrying the manipulation "
        "point, of which it is told nothing; an encoder that was a DeformerNet's has seen motions.",
        "no motion",
        # Many small batches from where its encoder has been, half of them with the rest shape,
        # from which every choice of a grasp begins.
        TrainingSettings(learning_rate=3e-3, groups=3, frames=4, rest_share=0.5, augmentation=None),
        scale_features,
    ),
}


def task_of(network: Network) -> Task:
    """Return the task that `network` is for."""
    return next(task for task in TASKS.values() if task.network is type(network))


def new_network(config: DeformerNetConfig, *, seed: int) -> DeformerNet:
    """Return an untrained DeformerNet whose first weights are a function of `seed`."""
    return cast(DeformerNet, TASKS["deformernet"].new(config, seed=seed))

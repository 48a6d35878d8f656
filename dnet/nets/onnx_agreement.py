"""Whether an exported network computes what the original does, and how fast both predict."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
import torch
from jaxtyping import Float32

from dnet.nets.deformernet import DeformerNet, centroid, prepare
from dnet.nets.neighbourhoods import stack
from dnet.nets.onnx_network import OnnxDeformerNet

LIMIT = 1e-5
"""Share of the largest output by which an exported network may be wrong."""

_CLOUDS = 4
_PREDICTIONS = 5


@dataclass(frozen=True, slots=True)
class Agreement:
    """How far two networks are from each other on the same clouds."""

    features: float
    """Largest difference of the features, as a share of the largest of them."""
    motion: float
    """Likewise of the motions."""
    pairs: int
    """Of clouds that were compared."""

    @property
    def worst(self) -> float:
        """The larger of both differences; NaN if either is."""
        return float(np.maximum(self.features, self.motion))


@torch.no_grad()
def agreement(model: DeformerNet, exported: OnnxDeformerNet) -> Agreement:
    """Compare two networks on a few random clouds: as one batch in all pairs, and one by one.

    Args:
        model: Ready to predict.
        exported: What was made of it.
    """
    clouds = random_clouds(_CLOUDS, model.config.points)
    batch = stack([prepare(one, model.config, centre=centroid(one)) for one in clouds])
    features = model.encode(batch)
    found, _ = exported.run(batch, np.zeros_like(features.numpy()))
    motions, found_motions = [], []
    for shift in range(1, _CLOUDS):
        goals = features.roll(shift, dims=0)
        motions.append(model.motion(features, goals).numpy())
        found_motions.append(exported.run(batch, goals.numpy())[1])
    one, other = clouds[:2]
    motions.append(model.predict(one, other)[None])
    found_motions.append(exported.predict(one, other)[None])
    return Agreement(
        _difference(found, features.numpy()),
        _difference(np.concatenate(found_motions), np.concatenate(motions)),
        _CLOUDS * (_CLOUDS - 1),
    )


def seconds_a_prediction(network: DeformerNet | OnnxDeformerNet) -> float:
    """Return how long a prediction takes for a known goal, the median of a few."""
    goal, *clouds = random_clouds(1 + _PREDICTIONS, network.config.points)
    network.predict(clouds[0], goal)
    seconds = []
    for cloud in clouds:
        begin = perf_counter()
        network.predict(cloud, goal)
        seconds.append(perf_counter() - begin)
    return float(np.median(seconds))


def random_clouds(count: int, points: int) -> Float32[np.ndarray, "{count} {points} 3"]:
    """Return the same boxes of an object's size at every call, each sheared otherwise."""
    rng = np.random.default_rng(0)
    boxes = rng.uniform([-0.05, -0.05, 0], [0.05, 0.05, 0.04], (count, points, 3))
    shears = np.eye(3) + rng.uniform(-0.5, 0.5, (count, 3, 3))
    return (boxes @ shears).astype(np.float32)


def _difference(got: np.ndarray, want: np.ndarray) -> float:
    return float(np.abs(got - want).max() / np.abs(want).max())

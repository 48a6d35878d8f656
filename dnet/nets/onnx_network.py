"""DeformerNet run by ONNX Runtime, from a file that `dnet export` wrote."""

from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float32

from dnet.errors import MissingExtra
from dnet.nets.deformernet import DeformerNetConfig, Encoder, prepare_seen
from dnet.nets.neighbourhoods import Neighbourhoods
from dnet.types import Cloud, Point

TABLES = (
    "points",
    "centroids",
    "neighbours_1",
    "neighbours_2",
    "inverse_density_1",
    "inverse_density_2",
    "inverse_density_3",
)
"""Inputs of the graph that describe a batch of clouds: the fields of `Neighbourhoods`."""
GOAL = "goal_features"
"""Input: the features of each cloud's goal."""
FEATURES, MOTION = "features", "motion"
"""Outputs: the features of each cloud, and its motion to the goal in metres."""


class OnnxDeformerNet:
    """A network that predicts as `DeformerNet` does, without PyTorch's layers.

    Args:
        session: Of the graph, from `open_session`.
        config: Of the network.
    """

    def __init__(self, session: Any, config: DeformerNetConfig) -> None:
        self.config = config
        self._session = session
        self._remembered: _Remembered | None = None

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the motion of the grasp that would turn `current` into `goal`, in metres.

        Of a cloud with more points than the network takes, the farthest from each other are
        taken. The goal is encoded once, as long as the next call has the same one.

        Args:
            current: What is seen, in metres in the world frame.
            goal: What should be seen, likewise.

        Raises:
            ShortCloud: If a cloud has fewer points than the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        there = self._goal_features(goal)
        here = prepare_seen(current, self.config, what="current cloud", about=goal)
        _, motion = self.run(here, there)
        return motion[0].astype(np.float64)

    def run(
        self, clouds: Neighbourhoods, goals: Float32[np.ndarray, "b 256"]
    ) -> tuple[Float32[np.ndarray, "b 256"], Float32[np.ndarray, "b 3"]]:
        """Return the features of each cloud of a batch, and its motion to its goal in metres.

        Args:
            clouds: A batch, from `prepare`.
            goals: Features of each one's goal; zeros, if only features are wanted.
        """
        features, motion = self._session.run([FEATURES, MOTION], {**_tables(clouds), GOAL: goals})
        return features, motion

    def _goal_features(self, goal: Cloud) -> Float32[np.ndarray, "1 256"]:
        kept = self._remembered
        if kept is None or not np.array_equal(kept.goal, goal):
            clouds = prepare_seen(goal, self.config, what="goal cloud", about=goal)
            features, _ = self.run(clouds, np.zeros((1, Encoder.features), np.float32))
            kept = self._remembered = _Remembered(goal.copy(), features)
        return kept.features


class _Remembered(NamedTuple):
    goal: Cloud
    features: Float32[np.ndarray, "1 256"]


def _tables(clouds: Neighbourhoods) -> dict[str, np.ndarray]:
    """Return a batch of clouds as the graph takes it; rows are int64, as ONNX indexes."""
    rows = (clouds.centroids, *clouds.neighbours)
    tables = (clouds.points, *(one.long() for one in rows), *clouds.inverse_densities)
    return {name: table.numpy() for name, table in zip(TABLES, tables, strict=True)}


def open_session(graph: bytes) -> Any:
    """Return the `InferenceSession` of an ONNX model, on the processor's cores as PyTorch is.

    Raises:
        MissingExtra: If onnxruntime is not installed.
    """
    try:
        import onnxruntime  # noqa: PLC0415
    except ImportError as error:
        raise MissingExtra("onnxruntime", "onnx", "an ONNX network") from error
    options = onnxruntime.SessionOptions()  # pyright: ignore[reportAttributeAccessIssue]
    options.intra_op_num_threads = torch.get_num_threads()
    return onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])

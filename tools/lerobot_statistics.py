"""The statistics that LeRobot normalizes with: of each feature, by episode and all together."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from jaxtyping import Float64

Figures = dict[str, np.ndarray]
"""Of one feature: `min`, `max`, `mean`, `std`, `count` (of frames) and the `QUANTILES`."""
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}


def episode_figures(features: Mapping[str, np.ndarray]) -> dict[str, Figures]:
    """Return the figures of each feature of an episode, one number for each of its last axis.

    Those of a cloud are over all its points, as LeRobot's own: no point is normalized by itself.

    Args:
        features: Arrays whose first axis is the frame, by name.
    """
    return {name: _figures(np.asarray(values, np.float64)) for name, values in features.items()}


def combined_figures(episodes: Sequence[Mapping[str, Figures]]) -> dict[str, Figures]:
    """Return the figures of all episodes together, of which there is at least one.

    Exact but for the quantiles: those are means of the episodes', weighted by frames, which is
    how LeRobot itself combines them.
    """
    return {name: _combined([one[name] for one in episodes]) for name in episodes[0]}


def _figures(values: Float64[np.ndarray, "f *rest"]) -> Figures:
    rows = values.reshape(-1, values.shape[-1] if values.ndim > 1 else 1)
    quantiles = np.quantile(rows, list(QUANTILES.values()), axis=0)
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        **dict(zip(QUANTILES, quantiles, strict=True)),
        "count": np.array([len(values)]),
    }


def _combined(parts: Sequence[Figures]) -> Figures:
    counts = np.array([int(one["count"][0]) for one in parts])
    columns = {name: np.stack([one[name] for one in parts]) for name in parts[0]}
    average = partial(np.average, axis=0, weights=counts)
    mean = average(columns["mean"])
    variance = average(columns["std"] ** 2 + (columns["mean"] - mean) ** 2)
    return {
        "min": columns["min"].min(axis=0),
        "max": columns["max"].max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        **{name: average(columns[name]) for name in QUANTILES},
        "count": np.array([counts.sum()]),
    }

"""How the figures of a recording come from its episodes."""

from collections.abc import Sequence
from typing import get_args

import numpy as np
import polars as pl
from jaxtyping import Float64
from scipy.spatial.distance import pdist

from dnet.tools.histogram import histogram
from dnet.tools.statistics_recorded import Recorded
from dnet.tools.statistics_speed import Speed
from dnet.tools.statistics_values import (
    Deviation,
    Distribution,
    Draws,
    Files,
    Motions,
    Rejected,
    Spread,
    Statistics,
    Tissues,
)
from dnet.types import FrameKind

AXES = ["x", "y", "z"]
SCENE = "scene"
"""The one reason for which a whole scene is drawn again, not a shape."""
MOST_STIFFNESSES = 8
"""Young's moduli of one shape of object that are told apart, if they repeat."""

_Values = Float64[np.ndarray, "_"]
_Points = Float64[np.ndarray, "_ 3"]


def statistics(index: Recorded, speed: Speed | None) -> Statistics:
    """Return the figures of the episodes of `index`, recorded at `speed`."""
    episodes, frames = index.episodes, index.frames
    shapes = frames.filter(pl.col("kind") == "shape")
    moved = shapes.select(AXES).to_numpy()
    settled = frames.filter(pl.col("kind") != "way").partition_by("episode")
    kinds = frames["kind"].to_list()
    points = frames["points"].to_numpy()
    return Statistics(
        directory=str(index.directory),
        files=_files(index),
        frames={kind: kinds.count(kind) for kind in get_args(FrameKind)},
        cloud_points=(int(points.min()), int(points.max())) if len(points) else None,
        simulated_seconds=float(episodes["seconds"].sum()),
        tissues=_tissues(episodes, shapes),
        displacement_mm=_displacement(moved),
        manipulation_point_mm={axis: _spread(episodes[axis].to_numpy()) for axis in AXES},
        any_pair=_any_pair([group.select(AXES).to_numpy() for group in settled]),
        from_rest=_from_rest(moved),
        draws=_draws(index, shapes),
        deviation=_deviation(episodes, shapes),
        oddities=index.oddities,
        speed=speed,
    )


def _spread(values: _Values) -> Spread:
    """Return how `values`, of which there is at least one, are spread."""
    return Spread(
        float(values.mean()), float(values.std()), float(values.min()), float(values.max())
    )


def _files(index: Recorded) -> Files:
    sizes = index.episodes["bytes"].to_numpy()
    frames = index.frames.height
    return Files(
        finished=index.episodes.height,
        unfinished=index.unfinished,
        broken=index.broken,
        total_bytes=int(sizes.sum()),
        episode_bytes=_spread(sizes.astype(np.float64)),
        frame_bytes=float(sizes.sum() / frames) if frames else None,
    )


def _tissues(episodes: pl.DataFrame, shapes: pl.DataFrame) -> tuple[Tissues, ...]:
    counted = shapes.group_by("episode").len("shapes")
    table = episodes.join(counted, on="episode", how="left").with_columns(
        pl.col("shapes").fill_null(0)
    )
    groups: list[pl.DataFrame] = []
    for same in table.sort("shape", "young").partition_by("shape"):
        # Moduli that were drawn from a range hardly repeat: they are one group.
        alike = same["young"].n_unique() < min(same.height, MOST_STIFFNESSES + 1)
        groups += same.partition_by("young") if alike else [same]
    return tuple(
        Tissues(
            shape=group["shape"][0],
            episodes=group.height,
            shapes=int(group["shapes"].sum()),
            size_mm=(
                _spread(group["size_x"].to_numpy()),
                _spread(group["size_y"].to_numpy()),
                _spread(group["size_z"].to_numpy()),
            ),
            young_kpa=_spread(group["young"].to_numpy() / 1e3),
        )
        for group in groups
    )


def _displacement(moved: _Points) -> dict[str, Distribution]:
    if not len(moved):
        return {}
    columns = {axis: moved[:, column] for column, axis in enumerate(AXES)}
    columns["length"] = np.linalg.norm(moved, axis=1)
    return {
        name: Distribution(_spread(values), histogram(values)) for name, values in columns.items()
    }


def _any_pair(episodes: Sequence[_Points]) -> Motions | None:
    pairs, lengths, squares = 0, 0.0, 0.0
    for points in episodes:
        count = len(points)
        pairs += count * (count - 1)
        lengths += 2 * float(pdist(points).sum())
        # Over ordered pairs, the sum of |a - b|^2 is 2 n times that of |a - mean|^2.
        squares += 2 * count * float(np.square(points - points.mean(axis=0)).sum())
    if not pairs:
        return None
    # To each pair there is the opposite one: the mean motion is none.
    mse = squares / (3 * pairs)
    return Motions(pairs, lengths / pairs, zero_mse_mm2=mse, mean_mse_mm2=mse)


def _from_rest(moved: _Points) -> Motions | None:
    if not len(moved):
        return None
    return Motions(
        len(moved),
        float(np.linalg.norm(moved, axis=1).mean()),
        zero_mse_mm2=float(np.square(moved).mean()),
        mean_mse_mm2=float(moved.var(axis=0).mean()),
    )


def _draws(index: Recorded, shapes: pl.DataFrame) -> Draws | None:
    counted = index.episodes.filter("counted")
    if not counted.height:
        return None
    accepted = shapes.join(counted, on="episode", how="semi").height
    counts = {
        reason: int(count)
        for reason, count in index.rejected.group_by("reason", maintain_order=True)
        .agg(pl.col("count").sum())
        .iter_rows()
    }
    rejected = sum(count for reason, count in counts.items() if reason != SCENE)
    drawn_shapes, drawn_scenes = accepted + rejected, counted.height + counts.get(SCENE, 0)
    return Draws(
        drawn_shapes,
        drawn_scenes,
        rejected,
        tuple(
            Rejected(reason, count, count / max(1, drawn))
            for reason, count in sorted(counts.items(), key=lambda item: (-item[1], item[0]))
            for drawn in (drawn_scenes if reason == SCENE else drawn_shapes,)
        ),
    )


def _deviation(episodes: pl.DataFrame, shapes: pl.DataFrame) -> Deviation | None:
    known = episodes.drop_nulls(["deviation_mean", "deviation_worst"]).join(
        shapes.group_by("episode").len("shapes"), on="episode"
    )
    if not known.height:
        return None
    means, worst, weights = (
        known[name].to_numpy() for name in ("deviation_mean", "deviation_worst", "shapes")
    )
    return Deviation(float(np.average(means, weights=weights)), float(worst.max()))

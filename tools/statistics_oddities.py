"""What is odd in a dataset: what never varies, lies far out, comes twice, or is on both sides."""

from dataclasses import dataclass

import polars as pl

from dnet.datasets.index import Index
from dnet.datasets.split import HELD_OUT, split

FENCE = 3.0
"""Interquartile ranges beyond the quartiles from which on a value is far out (Tukey 1977)."""
STILL = 1e-6
"""Metres: what varies by less never varies; a motor's noise is larger."""
SHOWN = 5
"""Examples of each oddity."""

VALUES = ("motion_x", "motion_y", "motion_z", "motion", "points")


@dataclass(frozen=True, slots=True)
class Outliers:
    """Frames of which one value is far from all others."""

    value: str
    count: int
    fence: tuple[float, float]
    """In metres, or points."""
    examples: tuple[str, ...]
    """Episode and frame."""


@dataclass(frozen=True, slots=True)
class Oddities:
    """What a person should look at before a network learns from it."""

    without_variance: tuple[str, ...]
    """Values of the motion that are the same in all shapes: normalised, they become NaN."""
    outliers: tuple[Outliers, ...]
    duplicate_clouds: int
    """Settled frames whose cloud another one has too, point for point."""
    duplicate_episodes: tuple[str, ...]
    """Files whose episode another file holds too, by id or by content."""
    leaked_clouds: int
    """Clouds that are both among the episodes to learn from and among those to judge by."""
    validation: float
    """The fraction by which the episodes were parted, as `dnet train` parts them."""


def oddities(index: Index, *, validation: float = HELD_OUT, seed: int = 0) -> Oddities:
    """Return what is odd in the finished episodes of a dataset.

    Args:
        index: Of the dataset.
        validation: Share of the episodes to judge a network by.
        seed: Of the division.
    """
    files = index.files.filter("finished")
    frames = index.frames.filter(pl.col("kind") != "way").join(
        files.select("name"), on="name", maintain_order="left"
    )
    motion = (pl.col("motion_x") ** 2 + pl.col("motion_y") ** 2 + pl.col("motion_z") ** 2).sqrt()
    shapes = frames.filter(pl.col("kind") == "shape").with_columns(motion=motion)
    twice = frames.filter(pl.col("content").is_duplicated())
    again = files.filter(pl.col("episode").is_duplicated() | pl.col("sha256").is_duplicated())
    training, _ = split(files["episode"].to_list(), fraction=validation, seed=seed)
    sides = frames.with_columns(learned=pl.col("episode").is_in(training))
    both = sides.group_by("content").agg(pl.col("learned").n_unique().alias("sides"))
    return Oddities(
        without_variance=tuple(
            name for name in VALUES[:4] if shapes.height > 1 and _spread(shapes[name]) < STILL
        ),
        outliers=tuple(found for name in VALUES if (found := _outliers(shapes, name)) is not None),
        duplicate_clouds=twice.height,
        duplicate_episodes=tuple(again["name"]),
        leaked_clouds=both.filter(pl.col("sides") > 1).height,
        validation=validation,
    )


def _spread(values: pl.Series) -> float:
    return float(values.max()) - float(values.min())  # type: ignore[arg-type]


def _outliers(shapes: pl.DataFrame, name: str) -> Outliers | None:
    """Return the shapes whose value is far out, None if there is none."""
    values = shapes[name]
    low, high = values.quantile(0.25, "linear"), values.quantile(0.75, "linear")
    if low is None or high is None:
        return None
    reach = max(FENCE * (high - low), STILL)
    fence = (low - reach, high + reach)
    found = shapes.filter((values < fence[0]) | (values > fence[1]))
    if not found.height:
        return None
    examples = found.head(SHOWN).select("episode", "frame").iter_rows()
    return Outliers(
        name, found.height, fence, tuple(f"{episode}:{frame}" for episode, frame in examples)
    )

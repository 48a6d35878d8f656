"""Frames of a dataset as a network takes them: clouds from the logs, tables from beside them."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float32, Int64

from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import FrameTable
from dnet.nets.deformernet import DeformerNetConfig
from dnet.nets.hu import HuNetConfig
from dnet.training.feature_tables import FeatureTables
from dnet.training.neighbour_tables import NeighbourTables

Config = DeformerNetConfig | HuNetConfig

Rows = Int64[np.ndarray, "_"]
"""Rows of a table of frames."""

Target = Literal["motion", "point"]
"""What a network answers to two frames of an episode: the `motion` of the grasp from the one to
the other, or the manipulation `point` of the first, which is the rest shape."""


@dataclass(frozen=True)
class Frames:
    """Frames that stay on disk until they are asked for. They can go to other processes."""

    clouds: Clouds
    tables: NeighbourTables | FeatureTables

    @classmethod
    def of(cls, table: FrameTable, config: Config, *, samplings: int = 1) -> "Frames":
        """Return the frames of a table for a network of `config`, whose tables are found."""
        if isinstance(config, HuNetConfig):
            return cls(Clouds(table), FeatureTables(table, config))
        return cls(Clouds(table), NeighbourTables(table, config, samplings))

    @property
    def table(self) -> FrameTable:
        """What is known of each frame without reading its cloud."""
        return self.clouds.table

    @property
    def config(self) -> Config:
        """Of the network that they are for."""
        return self.tables.config

    def prepared(self, rows: Rows, *, choices: Rows | None = None) -> Any:
        """Return some frames as a batch, as the network takes it: its neighbourhoods or features.

        Args:
            rows: Which.
            choices: Which choice of centroids to take of each; None for the usual one.

        Raises:
            ChangedEpisode: If a file is not the one that was indexed.
            BadTables: If the tables beside the data are not there any more, or damaged.
        """
        if isinstance(self.tables, FeatureTables):
            return self.tables.of(rows)
        clouds = self.clouds.stack(rows)[:, : self.config.points]
        return self.tables.of(rows, clouds, choices=choices)

    def points(self, rows: Rows) -> Float32[np.ndarray, "p 3"]:
        """Return the manipulation point of some frames, in metres."""
        return self.table.grasps[rows].astype(np.float32)

    def motions(self, current: Rows, goal: Rows) -> Float32[np.ndarray, "p 3"]:
        """Return the motion of the grasp between frames, in metres."""
        grasps = self.table.grasps
        return (grasps[goal] - grasps[current]).astype(np.float32)

"""The extended FPFH of every frame of a dataset, for the network of Hu et al."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from jaxtyping import Int64

from dnet.datasets.table_cache import TableCache, cache_folder
from dnet.geometry.extended_fpfh import FEATURES
from dnet.nets.hu import Described, HuNetConfig, features_of
from dnet.training.cloud_tables import CloudTables
from dnet.types import Cloud, Point

VERSION = "1"
"""Of how they are found: a change of `dnet.geometry.extended_fpfh` that alters them raises it."""


@dataclass(frozen=True)
class FeatureTables(CloudTables):
    """The features of the frames of a table."""

    config: HuNetConfig
    """Of the network."""
    samplings: ClassVar[int] = 1
    """A cloud has one vector of features."""

    @property
    def points(self) -> int:
        """Points of a cloud that the network takes."""
        return self.config.points

    def of(self, rows: Int64[np.ndarray, " k"]) -> Described:
        """Return the features of some frames, as a batch.

        Raises:
            BadTables: If what was kept is not there any more, or damaged.
        """
        features = np.ascontiguousarray(self._records(rows)["features"])
        return Described(torch.from_numpy(features))

    def _fill(self, record: Any, cloud: Cloud, *, what: str, centre: Point) -> None:
        del centre
        record["features"] = features_of(cloud, self.config, what=what)

    @property
    def _cache(self) -> TableCache:
        version = repr((VERSION, self.config.points, self.config.eye))
        return TableCache(cache_folder(self.table.root), "extended-fpfh", version)

    @property
    def _dtype(self) -> np.dtype[Any]:
        return np.dtype([("frame", "<i4"), ("features", "<f4", (FEATURES,))])

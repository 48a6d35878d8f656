import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from dnet.errors import OccupiedOutput
from dnet.recorders.replay import replay
from dnet.recorders.rerun_run import RerunRun
from dnet.datasets.reader import EpisodeReader
from dnet.sim.urdf import psm_urdf
from dnet.types import ARMS as NAMES
from tests.recorders.rollout import ARMS, frames, step, write, write_servo


def columns(path: Path, entity: str, component: str, timeline: str | None = "sim_time") -> list[pa.Array]:
    """Return the rows of one component of an entity, in time order, read by Rerun itself."""
    rows = []
    for chunk in RrdReader(path).store().stream().to_chunks():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path) != entity or (timeline or "") not in ("", *batch.schema.names):
            continue
        if component in batch.schema.names:
            times = batch.column(timeline).to_pylist() if timeline else [0] * batch.num_rows
            rows += zip(times, batch.column(component), strict=True)
    return [value for _, value in sorted(rows, key=lambda row: row[0])]

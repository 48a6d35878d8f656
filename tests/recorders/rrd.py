"""What a Rerun recording holds, read by Rerun's own reader."""

from pathlib import Path
from typing import Any

import pyarrow as pa
from rerun.chunk import RrdReader


def rows(path: Path, entity: str, component: str, *, timeline: str | None) -> list[tuple[Any, Any]]:
    """Return time and value of every row of a component, in time order; None for static ones.

    Times of the simulation are in seconds.
    """
    found: list[tuple[Any, Any]] = []
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        if str(chunk.entity_path) != entity or component not in names:
            continue
        values = batch.column(component).to_pylist()
        if timeline is None:
            found += [(None, value) for value in values if chunk.is_static]
        elif timeline in names:
            times = batch.column(timeline).cast(pa.int64()).to_pylist()
            unit = 1e9 if timeline == "sim_time" else 1
            found += [(time / unit, value) for time, value in zip(times, values, strict=True)]
    return found if timeline is None else sorted(found, key=lambda row: row[0])


def link_rows(
    path: Path, link: str, component: str, *, timeline: str, place: str = ""
) -> list[tuple[Any, Any]]:
    """Return times and values of a component of one link of an arm, in time order."""
    entity = f"{place}/tf"
    named = rows(path, entity, "Transform3D:child_frame", timeline=timeline)
    values = rows(path, entity, component, timeline=timeline)
    return [value for (_, (child,)), value in zip(named, values, strict=True) if child == link]


def entities(path: Path) -> set[str]:
    """Return the paths of all entities."""
    return {str(chunk.entity_path) for chunk in RrdReader(path).stream().to_chunks()}

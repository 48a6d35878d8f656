"""One pair: a rollout in the laboratory, written as an episode and kept in a store."""

import hashlib
import os
import platform
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
import psutil

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadEpisode, OtherRequest
from dnet.laboratory import Laboratory
from dnet.recorders.episode import EpisodeWriter
from dnet.recording.request import RecordingRequest, differences
from dnet.recording.store import Store
from dnet.sim.observe import observe
from dnet.sim.rollout import Rollout
from dnet.types import EpisodeMeta


@dataclass(frozen=True, slots=True)
class PairReport:
    """What became of one pair."""

    episode: str
    entry: dict[str, Any]
    """What the manifest says of it; the same on every run."""
    seconds: float
    """Wall time that it took."""
    cpu_seconds: float
    """Processor time that it took."""
    host: str
    """Machine that recorded it."""
    worker: int
    """Number of the process that recorded it."""
    memory: int
    """Resident bytes of that process at the end."""


def record_pair(
    lab: Laboratory,
    request: RecordingRequest,
    index: int,
    store: Store,
    *,
    shape_done: Callable[[], None],
) -> PairReport:
    """Record pair `index` of a request, as `EPISODE.mcap` of a store.

    Args:
        lab: Where it happens.
        request: What to record.
        index: Which pair, from 0; pairs do not depend on each other.
        store: For the file, which is called `.mcap.part` until it is whole.
        shape_done: Called after each shape; may raise to stop, which leaves the `.part` readable.

    Raises:
        NoValidShape: If nothing of what is drawn will do.
        BadNumber: If the simulation diverges.
        NoSpace, StoreFailed: If there is no room for it, or the store does not take it.
    """
    wall, cpu = perf_counter(), process_time()
    seed = (request.seed, index)
    look = partial(observe, lab.world, lab.see, image=request.images)
    if request.laboratory.noise is not None:
        # A stream of its own: the scenes and shapes are those of a perfect camera.
        random = np.random.default_rng((*seed, 1))
        look.keywords["noise"] = partial(request.laboratory.noise.apply, random=random)
    rollout = Rollout(
        lab.world,
        lab.planner,
        look,
        workspace=request.laboratory.workspace,
        draw_tissue=request.tissue.draw,
        seed=seed,
        rate=request.rate,
    )
    name = request.episode_id(index)
    meta = EpisodeMeta(name, request.seed, index, rollout.scene, request.settings)
    with store.scratch(request.episode_bytes()) as scratch:
        path = scratch / f"{name}.mcap"
        with EpisodeWriter(
            path,
            meta,
            arms=lab.arms,
            attachments=lab.attachments(rollout.scene.tissue),
            camera=request.laboratory.bullet.camera,
        ) as writer:
            for frame in rollout.frames(request.shapes):
                writer.add(frame)
                if frame.kind == "shape":
                    shape_done()
            writer.finish(_result(rollout, len(writer)))
        entry = manifest_entry(path, request)
        store.keep(path)
    return PairReport(
        episode=name,
        entry=entry,
        seconds=perf_counter() - wall,
        cpu_seconds=process_time() - cpu,
        host=platform.node(),
        worker=os.getpid(),
        memory=psutil.Process().memory_info().rss,
    )


def _result(rollout: Rollout, frames: int) -> dict[str, Any]:
    deviations = 1e3 * np.array(rollout.deviations)
    return {
        "frames": frames,
        "rejected": dict(sorted(rollout.rejected.items())),
        "deviation_mm": {
            "mean": round(float(deviations.mean()), 2),
            "worst": round(float(deviations.max()), 2),
        },
    }


def manifest_entry(path: Path, request: RecordingRequest) -> dict[str, Any]:
    """Return what a manifest says of a finished episode: read from the file itself.

    Raises:
        BadEpisode: If it is not a whole episode.
        OtherRequest: If it was recorded for another request.
    """
    with EpisodeReader(path) as episode:
        result, settings = episode.result, episode.meta.settings
    if result is None:
        raise BadEpisode(path, "is not finished", "remove it, and the same call records it again")
    others = differences(settings, request.settings)
    if others:
        raise OtherRequest(path, others)
    content = path.read_bytes()
    return {
        "bytes": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
        "frames": result["frames"],
        "rejected": result["rejected"],
    }

"""Requests that cost little, and episodes as if they had been recorded for one."""

from dataclasses import replace
from pathlib import Path

from dnet.laboratory import LaboratorySettings
from dnet.recorders.episode import EpisodeWriter
from dnet.recording.pair import PairReport, manifest_entry
from dnet.recording.request import RecordingRequest
from tests.recorders import rollout

REQUEST = RecordingRequest(
    pairs=3, shapes=1, seed=5, laboratory=LaboratorySettings(points=64, world="quasistatic")
)


def request(pairs: int, *, shapes: int = 1) -> RecordingRequest:
    """A request that few seconds of simulation fulfil."""
    return replace(REQUEST, pairs=pairs, shapes=shapes)


def write_episode(folder: Path, asked: RecordingRequest, index: int) -> Path:
    """Write the finished episode of a pair, made up instead of simulated."""
    name = asked.episode_id(index)
    path = folder / f"{name}.mcap"
    meta = replace(rollout.meta(name), settings=asked.settings, seed=asked.seed, index=index)
    with EpisodeWriter(path, meta, arms=rollout.ARMS, attachments={}) as writer:
        for frame in rollout.frames(2, seed=index):
            writer.add(frame)
        writer.finish({"frames": len(writer), "rejected": {"inverted": index}})
    return path


def report(path: Path, asked: RecordingRequest) -> PairReport:
    """What the worker that recorded `path` would say of it."""
    return PairReport(
        episode=path.stem,
        entry=manifest_entry(path, asked),
        seconds=2.0,
        cpu_seconds=1.0,
        host="here",
        worker=1,
        memory=10**8,
    )


def contents(folder: Path) -> dict[str, bytes]:
    """What a recording leaves, by name, but for the time that it took."""
    left = (path for path in folder.iterdir() if path.is_file())
    return {
        path.name: path.read_bytes()
        for path in left
        if path.name not in ("timings.jsonl", ".recording.lock")
    }

"""A dataset to export, and what its logs say of it."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.types import Frame
from tests.recorders import rollout

LENGTHS = (4, 1, 6)
"""Settled frames of each episode; between two of them there is one on the way."""


def write_exportable(folder: Path) -> Path:
    """Write episodes of several lengths and meshes, with odd numbers, and a file that is none."""
    folder.mkdir()
    for number, length in enumerate(LENGTHS):
        seen = [
            replace(one, nodes=one.nodes[: 20 + number], time=one.time + 1 / 3)
            for one in rollout.frames(length, seed=number)
        ]
        seen[0].cloud[0] = [-0.0, 1e-42, 1 / 3]
        rollout.write(folder / f"episode-{number}.mcap", seen)
    (folder / "broken.mcap").write_bytes(b"no log")
    return folder


def logged(path: Path) -> list[Frame]:
    """The frames of a log."""
    with EpisodeReader(path) as episode:
        return [episode.frame(number) for number in range(len(episode))]


def logged_meta(path: Path) -> dict[str, Any]:
    """What a log says of itself."""
    with EpisodeReader(path) as episode:
        return asdict(episode.meta) | {"result": episode.result, "schema_version": "1"}


def assert_frames(arrays: dict[str, Any], frames: list[Frame]) -> None:
    """Hold arrays by name, all of one frame at each place, against frames: bit for bit."""
    assert [str(kind) for kind in arrays["kinds"]] == [one.kind for one in frames]
    assert_bits(arrays["times"], [one.time for one in frames], np.float64)
    assert_bits(arrays["grasps"], [one.grasp for one in frames], np.float64)
    assert_bits(arrays["joints"], [one.joints for one in frames], np.float64)
    for name in ("cloud", "nodes"):
        found = arrays["clouds" if name == "cloud" else "nodes"]
        assert len(found) == len(frames)
        for one, frame in zip(found, frames, strict=True):
            assert_bits(one, getattr(frame, name), np.float32)


def assert_bits(found: Any, wanted: Any, dtype: type[np.floating]) -> None:
    found, wanted = np.asarray(found), np.asarray(wanted)
    assert found.dtype == wanted.dtype == dtype
    assert found.shape == wanted.shape
    assert np.ascontiguousarray(found).tobytes() == np.ascontiguousarray(wanted).tobytes()


def plain(meta: dict[str, Any]) -> dict[str, Any]:
    """The same as JSON gives it back: no tuples."""
    return dict(json.loads(json.dumps(meta)))

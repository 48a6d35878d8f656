"""The manifest of a dataset: what was asked for and what is there, so that a second call goes on.

`manifest.json` is the same for the same request, however often the recording was stopped, and on
however many processes or machines it ran. How long it took is another matter: a line of
`timings.jsonl` for each episode. Both belong to the process that leads the recording.
"""

import json
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from dnet.errors import BadManifest, DamagedEpisode, OccupiedOutput, OtherRequest
from dnet.files.sizes import parse_json
from dnet.recording.pair import PairReport, manifest_entry
from dnet.recording.request import RecordingRequest, differences
from dnet.recording.store import Store

MANIFEST, TIMINGS = "manifest.json", "timings.jsonl"
VERSION = 1


@dataclass
class Manifest:
    """What a store holds of a recording, by episode."""

    store: Store
    request: RecordingRequest
    pairs: int
    """Pairs asked for so far: a later call may ask for more."""
    episodes: dict[str, dict[str, Any]] = field(default_factory=dict)

    def missing(self) -> list[int]:
        """Return which pairs of the request have no finished episode yet."""
        wanted = range(self.request.pairs)
        return [index for index in wanted if self.request.episode_id(index) not in self.episodes]

    def add(self, report: PairReport) -> None:
        """Take up a finished episode, and how long it took."""
        self.episodes[report.episode] = report.entry
        line = {
            "episode": report.episode,
            "shapes": self.request.shapes,
            "seconds": round(report.seconds, 3),
            "cpu_seconds": round(report.cpu_seconds, 3),
            "host": report.host,
            "worker": report.worker,
            "memory": report.memory,
            "ended": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        self.store.append(TIMINGS, json.dumps(line))
        self.write()

    def rejected(self) -> Counter[str]:
        """Return the rejected draws of all episodes by reason."""
        total: Counter[str] = Counter()
        for entry in self.episodes.values():
            total.update(entry["rejected"])
        return total

    def write(self) -> None:
        """Write `manifest.json`."""
        content = {
            "version": VERSION,
            "pairs": self.pairs,
            "settings": self.request.settings,
            "finished": len(self.episodes) == self.pairs,
            "bytes": sum(entry["bytes"] for entry in self.episodes.values()),
            "frames": sum(entry["frames"] for entry in self.episodes.values()),
            "rejected": dict(sorted(self.rejected().items())),
            "episodes": dict(sorted(self.episodes.items())),
        }
        self.store.write(MANIFEST, json.dumps(content, indent=1).encode())


def open_manifest(store: Store, request: RecordingRequest) -> Manifest:
    """Return the manifest of a store, made anew or taken up where a recording stopped.

    Episodes that were finished but not yet entered, because the process was killed in between,
    are entered where they can be read. Nothing is written yet.

    Raises:
        OccupiedOutput: If the store holds episodes without a manifest.
        OtherRequest: If another recording began there.
        BadManifest: If the manifest cannot be read.
        DamagedEpisode, BadEpisode: If an episode has changed since it was finished.
    """
    sizes = store.sizes()
    if MANIFEST not in sizes:
        held = sorted(name for name in sizes if ".mcap" in name)
        if held:
            raise OccupiedOutput(store.name, f"{len(held)} recordings, such as {held[0]}")
        return Manifest(store, request, request.pairs)
    content = read_manifest(store)
    others = differences(content["settings"], request.settings)
    if others:
        raise OtherRequest(store.name, others)
    episodes = {}
    for name, entry in content["episodes"].items():
        size, written = sizes.get(f"{name}.mcap"), entry["bytes"]
        # A file that was removed is recorded again.
        if size is not None:
            if size != written:
                raise DamagedEpisode(f"{store.name}/{name}.mcap", size, written)
            episodes[name] = entry
    manifest = Manifest(store, request, max(request.pairs, content["pairs"]), episodes)
    if store.folder is not None:
        for index in manifest.missing():
            name = request.episode_id(index)
            if f"{name}.mcap" in sizes:
                manifest.episodes[name] = manifest_entry(store.folder / f"{name}.mcap", request)
    return manifest


def read_manifest(store: Store) -> dict[str, Any]:
    """Return the content of `manifest.json`.

    Raises:
        BadManifest: If it does not say what was recorded.
        StoreFailed: If there is none.
        TooLarge: If it is larger than that of any recording.
    """
    try:
        content: dict[str, Any] = parse_json(store.read(MANIFEST))
        version = content["version"]
        if version != VERSION:
            raise ValueError(f"it has version {version}, this dnet writes {VERSION}")
        if not isinstance(content["pairs"], int) or not isinstance(content["settings"], dict):
            raise TypeError("its pairs or settings are none")
        for name, entry in content["episodes"].items():
            if not _is_entry(entry):
                raise TypeError(f"it says no bytes, hash, frames and rejections of {name}")
    except KeyError as error:
        raise BadManifest(f"{store.name}/{MANIFEST}", f"it lacks {error}") from error
    except (ValueError, TypeError, AttributeError) as error:
        raise BadManifest(f"{store.name}/{MANIFEST}", str(error)) from error
    return content


def _is_entry(entry: Any) -> bool:
    return (
        isinstance(entry["bytes"], int)
        and isinstance(entry["sha256"], str)
        and isinstance(entry["frames"], int)
        and all(isinstance(count, int) for count in entry["rejected"].values())
    )

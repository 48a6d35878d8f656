"""The manifest of a dataset: what was asked for and what is there, so that a second call goes on.

`manifest.json` is the same for the same request, however often the recording was stopped, and on
however many processes it ran. How long it took is another matter: a line of `timings.jsonl` for
each episode.
"""

import json
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dnet.errors import BadManifest, DamagedEpisode, OccupiedOutput, OtherRequest
from dnet.recording.pair import PairReport, manifest_entry
from dnet.recording.request import RecordingRequest

MANIFEST, TIMINGS = "manifest.json", "timings.jsonl"
VERSION = 1


@dataclass
class Manifest:
    """What a recording directory holds, by episode."""

    folder: Path
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
            "worker": report.worker,
            "memory": report.memory,
            "ended": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        with (self.folder / TIMINGS).open("a") as timings:
            timings.write(json.dumps(line) + "\n")
        self.write()

    def rejected(self) -> Counter[str]:
        """Return the rejected draws of all episodes by reason."""
        total: Counter[str] = Counter()
        for entry in self.episodes.values():
            total.update(entry["rejected"])
        return total

    def write(self) -> None:
        """Write `manifest.json` beside itself and give it its name."""
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
        part = self.folder / f"{MANIFEST}.part"
        with part.open("w") as file:
            json.dump(content, file, indent=1)
            file.flush()
            os.fsync(file.fileno())
        part.replace(self.folder / MANIFEST)


def open_manifest(folder: Path, request: RecordingRequest) -> Manifest:
    """Return the manifest of `folder`, made anew or taken up where a recording stopped.

    Episodes that were finished but not yet entered, because the process was killed in between,
    are entered.

    Raises:
        OccupiedOutput: If the folder holds episodes without a manifest.
        OtherRequest: If another recording began there.
        BadManifest: If the manifest cannot be read.
        DamagedEpisode: If an episode has changed since it was entered.
    """
    path = folder / MANIFEST
    if not path.exists():
        held = sorted(folder.glob("*.mcap*"))
        if held:
            raise OccupiedOutput(folder, f"{len(held)} recordings, such as {held[0].name}")
        manifest = Manifest(folder, request, request.pairs)
    else:
        content = _read(path)
        differences = _differences(content["settings"], request.settings)
        if differences:
            raise OtherRequest(folder, differences)
        pairs = max(request.pairs, content["pairs"])
        manifest = Manifest(folder, request, pairs, _checked(folder, content["episodes"]))
        for index in manifest.missing():
            episode = folder / f"{request.episode_id(index)}.mcap"
            if episode.exists():
                manifest.episodes[episode.stem] = manifest_entry(episode)
    manifest.write()
    return manifest


def _read(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(path.read_text())
        version = content["version"]
        if version != VERSION:
            raise ValueError(f"it has version {version}, this dnet writes {VERSION}")
        if not {"settings", "pairs", "episodes"} <= set(content):
            raise ValueError("it lacks settings, pairs or episodes")
    except (ValueError, KeyError, TypeError) as error:
        raise BadManifest(path, str(error)) from error
    return content


def _checked(folder: Path, episodes: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the entries whose file is there; a file that was removed is recorded again."""
    found = {}
    for name, entry in episodes.items():
        path = folder / f"{name}.mcap"
        if path.exists():
            if path.stat().st_size != entry["bytes"]:
                raise DamagedEpisode(path, path.stat().st_size, entry["bytes"])
            found[name] = entry
    return found


def _differences(old: Any, new: Any, name: str = "") -> list[str]:
    """Return what differs between two settings, one line each."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = sorted(old.keys() | new.keys())
        return [
            line
            for key in keys
            for line in _differences(old.get(key), new.get(key), f"{name}.{key}".lstrip("."))
        ]
    return [] if old == new else [f"{name} {old} there, {new} now"]

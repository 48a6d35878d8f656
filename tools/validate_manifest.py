"""The manifest of a recording: whether the episodes beside it are those that it names."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dnet.files.sizes import read_json
from dnet.tools.validate_episode import CheckedEpisode
from dnet.tools.validate_findings import Finding, Findings

MANIFEST = "manifest.json"


def check_manifest(directory: Path, episodes: Sequence[CheckedEpisode]) -> list[Finding]:
    """Compare `manifest.json` with the episodes of its directory; without one there is no fault.

    Args:
        directory: Where they are.
        episodes: Its finished files, checked. Only these are opened, whatever the manifest names.
    """
    path = directory / MANIFEST
    findings = Findings(str(path))
    if not path.is_file():
        return []
    try:
        entries = _entries(path)
    except (OSError, ValueError, RecursionError, TypeError, KeyError) as error:
        findings.error("manifest", f"it is unreadable: {error}")
        return findings.all()
    found = {one.path.name: one for one in episodes}
    for name, entry in entries.items():
        one = found.get(f"{name}.mcap")
        if one is None:
            findings.warn("manifest", f"{name}.mcap is not there; dnet record makes it again")
        elif isinstance(entry, dict):
            _compare(name, entry, one=one, findings=findings)
        else:
            findings.error("manifest", f"it says nothing of {name}")
    for name in found:
        if name.removesuffix(".mcap") not in entries:
            findings.warn("manifest", f"{name} is not in it")
    return findings.all()


def _entries(path: Path) -> dict[str, Any]:
    entries = read_json(path, what="manifest")["episodes"]
    if not isinstance(entries, dict):
        raise TypeError("its episodes are none")
    return entries


def _compare(name: str, entry: dict[str, Any], *, one: CheckedEpisode, findings: Findings) -> None:
    size, said = one.path.stat().st_size, entry.get("bytes")
    if said is not None and size != said:
        findings.error("manifest", f"{name}.mcap has {size} bytes, not the {said} it had")
        return
    wanted = entry.get("sha256")
    if wanted is not None:
        with one.path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        if digest != wanted:
            findings.error("manifest", f"{name}.mcap has SHA-256 {digest}, not {wanted}")
    frames = entry.get("frames")
    if frames is not None and frames != one.frames:
        findings.error("manifest", f"{name}.mcap has {one.frames} frames, not {frames}")

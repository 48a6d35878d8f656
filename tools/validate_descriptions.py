"""What an episode says of itself: its metadata and its attachments."""

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from mcap.records import Metadata

from dnet.datasets import messages
from dnet.datasets.reader import SCHEMA_VERSION
from dnet.recorders.robot_description import read_urdf
from dnet.tools.validate_findings import Findings
from dnet.types import EpisodeMeta

META_KEYS = ("schema_version", "episode_id", "seed", "index", "scene", "settings")
LARGEST_DOCUMENT = 16 * 2**20
"""Bytes of an attached document that are still parsed; dnet writes 10 KiB."""


@dataclass(frozen=True, slots=True)
class Description:
    """What the metadata of an episode say, as far as they can be read."""

    meta: EpisodeMeta | None = None
    result: dict[str, Any] | None = None
    finished: bool = False
    """Whether there is a result, readable or not."""

    @property
    def points(self) -> int | None:
        """Points of each cloud, if the settings say so."""
        settings = {} if self.meta is None else self.meta.settings
        # A recording has the laboratory under its name, a servo run among the others.
        inner = settings.get("laboratory", settings)
        points = inner.get("points") if isinstance(inner, dict) else None
        return points if isinstance(points, int) else None


def check_metadata(records: Sequence[Metadata], findings: Findings) -> Description:
    """Check the metadata of an episode and return what they say."""
    for name, count in Counter(record.name for record in records).items():
        if count > 1:
            findings.error("metadata", f"there are {count} records {name}, must be one")
    known = {record.name: record.metadata for record in records}
    meta, result = None, None
    if "dnet.episode" not in known:
        findings.error("metadata", "there is no dnet.episode: it is no episode of dnet")
    else:
        meta = _meta(known["dnet.episode"], findings)
    if "dnet.result" in known:
        try:
            result = messages.read_result(known["dnet.result"])
        except messages.UNREADABLE as error:
            findings.error("metadata", f"dnet.result is unreadable: {error}")
    return Description(meta, result, "dnet.result" in known)


def _meta(record: dict[str, str], findings: Findings) -> EpisodeMeta | None:
    missing = [key for key in META_KEYS if key not in record]
    if missing:
        findings.error("metadata", f"dnet.episode lacks {', '.join(missing)}")
        return None
    if record["schema_version"] != SCHEMA_VERSION:
        findings.error(
            "schema-version", f"it is {record['schema_version']!r}, must be {SCHEMA_VERSION!r}"
        )
        return None
    try:
        return messages.read_meta(record)
    except messages.UNREADABLE as error:
        findings.error("metadata", f"dnet.episode is unreadable: {error!r}")
        return None


def check_attachments(attachments: Sequence[tuple[str, memoryview]], findings: Findings) -> None:
    """Check that the attached documents are what their names say."""
    for name, count in Counter(name for name, _ in attachments).items():
        if count > 1:
            findings.warn("attachment", f"there are {count} of name {name}, readers take the last")
    parsers: dict[str, Callable[[bytes], object]] = {
        "psm.urdf": read_urdf,
        "config.json": json.loads,
    }
    for name, content in attachments:
        if name not in parsers:
            continue
        if len(content) > LARGEST_DOCUMENT:
            findings.warn(
                "attachment",
                f"{name} has {len(content)} bytes, more than {LARGEST_DOCUMENT} are not parsed",
            )
            continue
        try:
            parsers[name](bytes(content))
        except (ValueError, RecursionError) as error:
            findings.error("attachment", f"{name} cannot be parsed: {error}")

"""What a process that records for another keeps from one pair to the next."""

import platform
from contextlib import ExitStack
from dataclasses import replace

from dnet.errors import OtherWorker, StoreFailed
from dnet.laboratory import Laboratory, laboratory
from dnet.recording.manifest import MANIFEST, read_manifest
from dnet.recording.request import RecordingRequest, differences
from dnet.recording.store import Store


class _Kept:
    life = ExitStack()
    """Holds the laboratory until another is asked for, or the process ends."""
    lab: Laboratory
    whose: tuple[RecordingRequest, Store] | None = None


def kept_laboratory(request: RecordingRequest, store: Store) -> Laboratory:
    """Return the laboratory of a request, the same one for all of its pairs.

    Raises:
        OtherWorker: If this process would record something else, or in another place.
    """
    if _Kept.whose != (request, store):
        _check(request, store)
        _Kept.whose = None
        _Kept.life.close()
        _Kept.lab = _Kept.life.enter_context(laboratory(request.laboratory))
        _Kept.whose = request, store
    return _Kept.lab


def _check(request: RecordingRequest, store: Store) -> None:
    """Compare what was begun with what this machine sees and would do with its own versions."""
    host = platform.node()
    try:
        begun = read_manifest(store)
    except StoreFailed as error:
        raise OtherWorker(host, store.name, f"it cannot read {MANIFEST} there") from error
    # A copy: the settings of the request itself came with it from the process that leads.
    others = differences(begun["settings"], replace(request).settings)
    if others:
        raise OtherWorker(host, store.name, ", ".join(others))

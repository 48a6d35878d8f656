"""A whole dataset in one place: begun, gone on with, and safe from a second writer."""

import errno
from collections.abc import Iterator
from contextlib import closing, contextmanager

from dnet.recording.manifest import Manifest, open_manifest
from dnet.recording.processes import Progress, record_here, record_in_processes
from dnet.recording.ray_cluster import record_on_ray
from dnet.recording.request import RecordingRequest
from dnet.recording.store import Store


@contextmanager
def recording(store: Store, request: RecordingRequest) -> Iterator[Manifest]:
    """Open a store for a recording, alone; say what is still missing of it.

    Raises:
        OutputInUse: If another process records there.
        NoSpace: If what is missing does not fit.
        StoreFailed: If it cannot be written to.
        OccupiedOutput, OtherRequest, BadManifest, DamagedEpisode, BadEpisode: As `open_manifest`.
    """
    with store.alone():
        manifest = open_manifest(store, request)
        _check_room(manifest)
        manifest.write()
        yield manifest


def record_missing(
    manifest: Manifest, *, workers: int = 1, ray: str | None = None, progress: Progress
) -> int:
    """Record the pairs that a manifest lacks; return how many.

    Args:
        manifest: Of an open recording.
        workers: Processes; 1 stays in this one.
        ray: Address of a Ray cluster that records instead.
        progress: Told how many shapes were done since the last time.
    """
    request, store, indices = manifest.request, manifest.store, manifest.missing()
    workers = min(workers, len(indices))
    if not indices:
        return 0
    if ray is not None:
        reports = record_on_ray(request, indices, store, progress, address=ray)
    elif workers == 1:
        reports = record_here(request, indices, store, progress)
    else:
        reports = record_in_processes(request, indices, store, progress, workers=workers)
    try:
        with closing(reports):
            for report in reports:
                manifest.add(report)
    except OSError as error:
        if error.errno == errno.ENOSPC:
            _check_room(manifest)
        raise
    return len(indices)


def _check_room(manifest: Manifest) -> None:
    missing = len(manifest.missing())
    manifest.store.check_room(missing, episode_bytes=manifest.request.episode_bytes())

"""A whole dataset in a directory: begun, gone on with, and safe from a second writer."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from dnet.errors import NoSpace, OccupiedOutput, OutputInUse
from dnet.recording.manifest import Manifest, open_manifest
from dnet.recording.processes import record_here, record_in_processes
from dnet.recording.request import RecordingRequest

LOCK = ".recording.lock"


@contextmanager
def recording(folder: Path, request: RecordingRequest) -> Iterator[Manifest]:
    """Open `folder` for a recording, alone; say what is still missing of it.

    Raises:
        OutputInUse: If another process records there.
        NoSpace: If what is missing does not fit on the disk.
        OccupiedOutput, OtherRequest, BadManifest, DamagedEpisode: As `open_manifest`.
    """
    if folder.exists() and not folder.is_dir():
        raise OccupiedOutput(folder, "a file")
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / LOCK, blocking=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise OutputInUse(folder) from error
    try:
        manifest = open_manifest(folder, request)
        _check_space(folder, request, len(manifest.missing()))
        yield manifest
    finally:
        lock.release()


def record_missing(manifest: Manifest, *, workers: int, progress: Callable[[int], None]) -> int:
    """Record the pairs that a manifest lacks; return how many.

    Args:
        manifest: Of an open recording.
        workers: Processes; 1 stays in this one.
        progress: Told how many shapes were done since the last time.
    """
    request, indices = manifest.request, manifest.missing()
    workers = min(workers, len(indices))
    reports = (
        record_here(request, indices, manifest.folder, progress)
        if workers <= 1
        else record_in_processes(request, indices, manifest.folder, progress, workers=workers)
    )
    with closing(reports):
        for report in reports:
            manifest.add(report)
    return len(indices)


def _check_space(folder: Path, request: RecordingRequest, missing: int) -> None:
    need = missing * request.episode_bytes()
    free = shutil.disk_usage(folder).free
    if need > free:
        raise NoSpace(folder, need, free)

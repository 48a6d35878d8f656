"""What dnet can have of a machine: processors, memory, disk, open files."""

import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from dnet.packages import is_installed

LEAST_MEMORY, LEAST_DISK, LEAST_FILES = 2 * 10**9, 2 * 10**9, 1024
"""Bytes and files below which there is a warning. The paper's 150 x 200 shapes are 1.2 GB; each
process keeps the episodes open that it streams from."""


@dataclass(frozen=True, slots=True)
class Fact:
    """One thing about the machine."""

    name: str
    value: str
    warning: str = ""
    """What is wrong with it, and what mends that; empty if nothing is."""


def facts(folder: Path) -> list[Fact]:
    """Return what this process may use; `folder` is where it would write."""
    found = [_cores(), _memory(), _open_files()]
    places = {"here": folder, "temporary files": Path(tempfile.gettempdir()), "cache": _cache()}
    return found + [_disk(name, place) for name, place in places.items()]


def cores() -> int:
    """Return how many processors this process may use."""
    here = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota, _, period = _control_group("cpu.max").partition(" ")
    if quota.isdigit() and period.isdigit():
        here = min(here, max(1, int(quota) // int(period)))
    return here


def _control_group(name: str) -> str:
    """Return what a container's limits say; empty where there are none."""
    try:
        return Path("/sys/fs/cgroup", name).read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def _cores() -> Fact:
    return Fact("processors", str(cores()))


def _memory() -> Fact:
    if not is_installed("psutil"):
        return Fact("memory", "unknown", "psutil is not installed")
    import psutil  # noqa: PLC0415

    seen = psutil.virtual_memory()
    free, total = seen.available, seen.total
    limit = _control_group("memory.max")
    if limit.isdigit() and int(limit) < total:
        total = int(limit)
        free = min(free, total - int(_control_group("memory.current") or 0))
    value = f"{free / 1e9:.1f} of {total / 1e9:.1f} GB free"
    scarce = "a training may not fit: fewer --workers and smaller --groups take less"
    return Fact("memory", value, scarce if free < LEAST_MEMORY else "")


def _open_files() -> Fact:
    try:
        import resource  # noqa: PLC0415  # POSIX alone
    except ImportError:
        return Fact("open files", "unknown")
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    limited = soft != resource.RLIM_INFINITY
    few = limited and soft < LEAST_FILES
    wanted = f"few for many episodes; ulimit -n {4 * LEAST_FILES}"
    return Fact("open files", f"{soft} at once" if limited else "unlimited", wanted if few else "")


def _cache() -> Path:
    if is_installed("platformdirs"):
        from platformdirs import user_cache_path  # noqa: PLC0415

        return user_cache_path("dnet")
    return Path.home() / ".cache"


def _disk(name: str, place: Path) -> Fact:
    there = next(folder for folder in (place, *place.parents) if folder.is_dir())
    free = shutil.disk_usage(there).free
    warning = ""
    if free < LEAST_DISK:
        warning = "little space: the paper's 150 x 200 shapes are 1.2 GB"
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        warning = f"cannot be written: {error.strerror}"
    return Fact(f"disk, {name}", f"{free / 1e9:.1f} GB free in {place}", warning)

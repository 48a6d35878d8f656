"""Feeds a target with mutated files for a time: `python -m tests.fuzz.run episode --seconds 600`.

Atheris does the mutating and follows which lines of dnet, and of the Python packages that read for
it, a file leads through. What it must not find: anything but a DnetError, an input that takes more
than 10 seconds, or more than 1 GiB of memory. Each new kind of failure is told with its traceback,
its input is written into the folder `--failures`, and the run goes on; too slow or too large a one
ends it. Put such an input into `tests/fuzz/corpus` beside the repair: the tests replay all of it.
"""

import argparse
import hashlib
import resource
import sys
import traceback
from pathlib import Path
from tempfile import TemporaryDirectory

import atheris

SECONDS = 10
"""That one input may take."""
MEMORY = 2**30
"""Bytes that all of them may take, beyond what the process has when it starts."""
FOLLOWED = ["dnet", "mcap"]


class Once:
    """Gives one input to a target, and keeps it if it fails in a new way."""

    def __init__(
        self, read: object, folder: Path, failures: Path, allowed: type[Exception]
    ) -> None:
        self._read: object = read
        self._folder = folder
        self._failures = failures
        self._allowed = allowed
        self._known = set[tuple[str, ...]]()

    def __call__(self, content: bytes) -> None:
        """Read `content`."""
        try:
            self._read(content, self._folder)  # type: ignore[operator]
        except self._allowed:
            pass
        # A panic of a library in Rust is no Exception.
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            frames = traceback.extract_tb(error.__traceback__)
            kind = (type(error).__name__, *(f"{one.filename}:{one.lineno}" for one in frames[-3:]))
            if kind not in self._known:
                self._known.add(kind)
                self._failures.mkdir(parents=True, exist_ok=True)
                name = f"{type(error).__name__}-{hashlib.sha256(content).hexdigest()[:12]}"
                (self._failures / name).write_bytes(content)
                print(f"FAILURE {name}", flush=True)
                traceback.print_exception(error, limit=-6)


def main() -> None:
    """Run one target."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--found", type=Path, help="folder that keeps what leads to new lines")
    parser.add_argument("--failures", type=Path, default=Path("failures"))
    asked = parser.parse_args()
    # What numba compiles is not to be followed: it would be no Python that numba knows.
    import dnet.geometry.sampling  # noqa: PLC0415
    import dnet.nets.hu  # noqa: PLC0415
    import dnet.nets.keypoints  # noqa: PLC0415
    import dnet.nets.manipulation_point  # noqa: F401, PLC0415

    with atheris.instrument_imports(include=FOLLOWED):
        from tests.fuzz import targets  # noqa: PLC0415
    from dnet.errors import DnetError  # noqa: PLC0415

    read = targets.TARGETS[asked.target]
    limit_memory(MEMORY)
    with TemporaryDirectory(dir="/dev/shm") as place:  # in memory: many small files
        folder, found = Path(place) / "scratch", asked.found or Path(place) / "found"
        folder.mkdir()
        found.mkdir(parents=True, exist_ok=True)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
        flags = [
            f"-max_total_time={asked.seconds}",
            f"-timeout={SECONDS}",
            f"-rss_limit_mb={peak + MEMORY // 2**20}",
            f"-artifact_prefix={asked.failures}/",
            "-max_len=65536",
            "-print_final_stats=1",
        ]
        asked.failures.mkdir(parents=True, exist_ok=True)
        once = Once(read, folder, asked.failures, DnetError)
        atheris.Setup([sys.argv[0], *flags, str(found), str(targets.seeds_of(asked.target))], once)
        atheris.Fuzz()


def limit_memory(more: int) -> None:
    """Let this process have so many more bytes than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more, hard))


if __name__ == "__main__":
    main()

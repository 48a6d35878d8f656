"""Other processes, machines and stores."""

from pathlib import Path

from dnet.errors.root import DnetError


class WorkerDied(DnetError, RuntimeError):
    """A process that was to do a part of the work and is no more."""

    def __init__(self, did: str, way_out: str) -> None:
        super().__init__(f"a process that {did} was killed, perhaps for want of memory; {way_out}")


class OtherWorker(DnetError, RuntimeError):
    """A process that would not record what was asked for, or not where."""

    def __init__(self, host: str, name: str, why: str) -> None:
        super().__init__(
            f"a worker on {host} cannot record into {name}: {why}; all of them must see the same "
            "files there, and have the same versions of dnet and of what it builds on"
        )


class NoCluster(DnetError, ConnectionError):
    """A Ray cluster that is not there, or does not answer."""

    def __init__(self, address: str, why: str) -> None:
        super().__init__(
            f"no Ray cluster at {address}: {why}; `ray start --head` begins one, "
            "`--ray local` makes one for this recording alone"
        )


class ClusterFailed(DnetError, RuntimeError):
    """A Ray cluster that does not do what is asked of it."""

    def __init__(self, address: str, why: str) -> None:
        super().__init__(
            f"the Ray cluster at {address} failed: {why}; every node needs the same dnet; "
            "finished episodes are kept, the same call goes on"
        )


class UnknownStore(DnetError, ValueError):
    """A URL of which nobody knows how to write to it."""

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"{url} is no store that can be written to: {why}; "
            "give a folder, or a URL such as s3://bucket/data"
        )


class StoreFailed(DnetError, OSError):
    """A folder or object store that does not do what is asked of it."""

    def __init__(self, name: str, why: str) -> None:
        super().__init__(
            f"{name} fails: {why}; see that it is there and that you may write to it; "
            "finished episodes are kept, the same call goes on"
        )


class Unfetched(DnetError, OSError):
    """A file in a store that cannot be read."""

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"{url} cannot be read: {why}; see that the store answers, that the file is there, "
            "and that you may read it"
        )


class ChangedEpisode(DnetError, RuntimeError):
    """A file that is not the one that was indexed."""

    def __init__(self, path: Path | str) -> None:
        super().__init__(
            f"{path} has changed since it was indexed; run the same call again, which brings the "
            "index up to date"
        )

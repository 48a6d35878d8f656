"""The bytes of one log: mapped from a disk, or fetched by ranges from a store."""

import mmap
from collections import OrderedDict
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Protocol, runtime_checkable

from dnet.datasets.stores import file_system, is_url
from dnet.errors import BadEpisode, MissingPath, Unfetched
from dnet.types import Place

BLOCK = 256 * 1024
"""Bytes that are fetched together: about as many as a writer puts into one chunk."""
CACHED = 256 * 2**20
"""Bytes of all remote logs together that a process keeps."""


@runtime_checkable
class Source(Protocol):
    """Bytes that can be read at random."""

    def __len__(self) -> int:
        """Return how many there are."""
        ...

    def view(self, start: int, stop: int) -> memoryview:
        """Return the bytes from `start` to `stop`, both within the source."""
        ...

    def close(self) -> None:
        """Let go of them; views that were handed out stay valid as long as they live."""
        ...


class MappedFile:
    """A file of this machine: views of it are the system's pages, nothing is copied.

    Args:
        path: The file.

    Raises:
        MissingPath: If there is no such file.
        BadEpisode: If it cannot be opened, or is empty, for then nothing can be mapped.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise MissingPath(path, "episode", "`dnet inspect ls DIRECTORY` lists what is there")
        try:
            with path.open("rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except OSError as error:
            raise BadEpisode(
                path, f"cannot be opened ({error.strerror})", "see that you may read it"
            ) from error
        except ValueError as error:
            raise BadEpisode(
                path, "is not an MCAP file: it is empty", "give an .mcap of `dnet record`"
            ) from error
        self._bytes = memoryview(self._map)

    def __len__(self) -> int:
        return len(self._map)

    def view(self, start: int, stop: int) -> memoryview:
        """Return a part of the map."""
        return self._bytes[start:stop]

    def close(self) -> None:
        """Let go of the map; the system unmaps it with the last array that looks at it."""
        with suppress(BufferError):
            self._bytes.release()
            self._map.close()


class BlockCache:
    """The blocks of remote files that were read last, together no more than `capacity` bytes."""

    def __init__(self, capacity: int = CACHED) -> None:
        self.capacity = capacity
        self.bytes = 0
        """How many it holds."""
        self._blocks: OrderedDict[tuple[str, int], bytes] = OrderedDict()

    def get(self, name: str, number: int) -> bytes | None:
        """Return block `number` of the file called `name`, or None."""
        block = self._blocks.get((name, number))
        if block is not None:
            self._blocks.move_to_end((name, number))
        return block

    def put(self, name: str, number: int, block: bytes) -> None:
        """Keep a block, and drop those that were not read for longest."""
        self.bytes += len(block) - len(self._blocks.pop((name, number), b""))
        self._blocks[name, number] = block
        while self.bytes > self.capacity and len(self._blocks) > 1:
            _, dropped = self._blocks.popitem(last=False)
            self.bytes -= len(dropped)


SHARED = BlockCache()
"""What all remote logs of a process share unless they are given another."""


class RemoteFile:
    """A file in a store, read by ranges of whole blocks.

    Args:
        url: The file.
        cache: Where its blocks are kept.

    Raises:
        MissingPath: If there is no such file.
        Unfetched: If the store does not answer.
    """

    def __init__(self, url: str, *, cache: BlockCache = SHARED) -> None:
        self._url = url
        self._cache = cache
        self._files, self._path = file_system(url, doing="reading")
        try:
            info = self._files.info(self._path)
        except FileNotFoundError as error:
            raise MissingPath(url, "episode", "see what the folder above it holds") from error
        # Stores raise what they like: botocore's errors are not even OSErrors.
        except Exception as error:
            raise Unfetched(url, said(error)) from error
        self._size = int(info["size"])
        self.version = version_of(info)
        """Changes when the file does."""
        # Another file of the same name must not be read from the blocks of this one.
        self._key = f"{url}@{self.version}"

    def __len__(self) -> int:
        return self._size

    def view(self, start: int, stop: int) -> memoryview:
        """Return a part of the file, of one block without a copy.

        Raises:
            Unfetched: If the store does not answer, or returns less.
        """
        first, last = start // BLOCK, max(start, stop - 1) // BLOCK
        if first == last:
            return memoryview(self._block(first))[start - first * BLOCK : stop - first * BLOCK]
        whole = b"".join(self._block(number) for number in range(first, last + 1))
        return memoryview(whole)[start - first * BLOCK : stop - first * BLOCK]

    def close(self) -> None:
        """Nothing is held but blocks, which others may still read."""

    def _block(self, number: int) -> bytes:
        block = self._cache.get(self._key, number)
        if block is None:
            start, stop = number * BLOCK, min((number + 1) * BLOCK, self._size)
            block = fetch(self._files, self._path, name=self._url, start=start, stop=stop)
            self._cache.put(self._key, number, block)
        return block


class Fetched:
    """The whole of a remote file, in memory."""

    def __init__(self, content: bytes) -> None:
        self._bytes = memoryview(content)

    def __len__(self) -> int:
        return len(self._bytes)

    def view(self, start: int, stop: int) -> memoryview:
        """Return a part of it."""
        return self._bytes[start:stop]

    def close(self) -> None:
        """Nothing is open."""


def open_source(place: Place, *, cache: BlockCache = SHARED) -> Source:
    """Return the bytes of the file at `place`, a path or a URL.

    Raises:
        MissingPath: If there is no such file.
        BadEpisode: If it is empty.
        Unfetched: If a store does not answer.
        UnknownStore: If fsspec knows no such store.
    """
    if is_url(place):
        return RemoteFile(str(place), cache=cache)
    return MappedFile(Path(place))


def fetch(files: object, path: str, *, name: str, start: int, stop: int) -> bytes:
    """Return a range of a file of an fsspec file system.

    Raises:
        Unfetched: If the store does not answer, or returns another number of bytes.
    """
    try:
        content: bytes = files.cat_file(path, start=start, end=stop)  # type: ignore[attr-defined]
    except Exception as error:
        raise Unfetched(name, said(error)) from error
    if len(content) != stop - start:
        raise Unfetched(name, f"{len(content)} bytes came where {stop - start} were asked for")
    return content


def version_of(info: dict[str, object]) -> str:
    """Return what changes when a file does, from what fsspec knows of it."""
    stamps = ("ETag", "etag", "mtime", "LastModified", "last_modified", "created")
    values = [info[stamp] for stamp in stamps if info.get(stamp) is not None]
    # Some stores tell a time in one way when asked for a file and in another for a folder.
    known = [str(one.timestamp() if isinstance(one, datetime) else one) for one in values]
    return "-".join([str(info["size"]), *known[:1]])


def said(error: Exception) -> str:
    """Return what an error of a store says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__

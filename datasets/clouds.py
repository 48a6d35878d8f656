"""Clouds by number, read at random from wherever the logs lie, at the speed of memory."""

from collections import OrderedDict
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int64

from dnet.datasets.chunk import decompress
from dnet.datasets.frame_table import COMPRESSED, FrameTable
from dnet.datasets.listing import local_version
from dnet.datasets.mcap_file import message_at
from dnet.datasets.point_cloud import read_point_cloud
from dnet.datasets.refusals import damaged
from dnet.datasets.sources import SHARED, BlockCache, MappedFile, RemoteFile, Source
from dnet.datasets.stores import is_url, join
from dnet.errors import ChangedEpisode
from dnet.types import Cloud, Place

OPEN_FILES = 1024
"""Files that stay mapped; a system allows some tens of thousands."""
CACHED_CHUNKS = 8
"""Decompressed ones."""

_BYTES_A_POINT = 12


class Clouds:
    """The clouds of the frames of a table. It can be sent to other processes, which open anew.

    Neither checksums nor coordinates are looked at again: the index was made from bytes that had
    passed, and a file that has changed since is refused when it is opened.

    Args:
        table: The frames.
        cache: Where blocks of remote files are kept.
    """

    def __init__(self, table: FrameTable, *, cache: BlockCache = SHARED) -> None:
        self.table = table
        self._cache = cache
        self._sources: OrderedDict[int, Source] = OrderedDict()
        self._chunks: OrderedDict[tuple[int, int], memoryview] = OrderedDict()

    def __len__(self) -> int:
        return len(self.table)

    def __reduce__(self) -> "tuple[type[Clouds], tuple[FrameTable]]":
        # Mapped files do not travel between processes; where they are does.
        return type(self), (self.table,)

    def __getitem__(self, row: int) -> Cloud:
        """Return the cloud of a frame, (n, 3), read-only; of a file of this machine, a view.

        Raises:
            ChangedEpisode: If its file is not the one that was indexed.
            BadEpisode: If a compressed chunk cannot be read.
            Unfetched: If a store does not answer.
        """
        table = self.table
        file, data = int(table.file[row]), int(table.data[row])
        source = self._sources.get(file) or self._open(file)
        if data == COMPRESSED:
            return self._compressed(row, source)
        size = table.points * _BYTES_A_POINT
        points: Cloud = np.frombuffer(source.view(data, data + size), "<f4").reshape(-1, 3)
        return points

    def stack(self, rows: Int64[np.ndarray, " b"]) -> Float32[np.ndarray, "b n 3"]:
        """Return the clouds of some frames, copied into one array."""
        clouds = np.empty((len(rows), self.table.points, 3), np.float32)
        for place, row in enumerate(rows.tolist()):
            clouds[place] = self[row]
        return clouds

    def close(self) -> None:
        """Let go of all files; clouds that were read stay valid."""
        for source in self._sources.values():
            source.close()
        self._sources.clear()
        self._chunks.clear()

    def _open(self, file: int) -> Source:
        place = join(self.table.root, self.table.names[file])
        source = self._source(place, self.table.versions[file])
        self._sources[file] = source
        if len(self._sources) > OPEN_FILES:
            self._sources.popitem(last=False)[1].close()
        return source

    def _source(self, place: Place, version: str) -> Source:
        if is_url(place):
            remote = RemoteFile(str(place), cache=self._cache)
            if remote.version != version:
                raise ChangedEpisode(place)
            return remote
        mapped = MappedFile(Path(place))
        if local_version(Path(place).stat()) != version:
            mapped.close()
            raise ChangedEpisode(place)
        return mapped

    def _compressed(self, row: int, source: Source) -> Cloud:
        file = int(self.table.file[row])
        chunk, length, message = self.table.places[row].tolist()
        name = join(self.table.root, self.table.names[file])
        records = self._chunks.get((file, chunk))
        try:
            if records is None:
                records, _ = decompress(source.view(chunk, chunk + length))
                self._chunks[file, chunk] = records
                if len(self._chunks) > CACHED_CHUNKS:
                    self._chunks.popitem(last=False)
            content = message_at(records, message)
            if content is None:
                raise ValueError("no message where its cloud was")
            points = read_point_cloud(content)
        except ValueError as error:
            raise damaged(name, f"the chunk at byte {chunk} is unreadable ({error})") from error
        return points

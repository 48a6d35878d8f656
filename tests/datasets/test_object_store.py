import numpy as np
import pytest

from dnet.datasets.clouds import Clouds
from dnet.datasets.index import INDEX
from dnet.datasets.reader import EpisodeReader
from dnet.datasets.sources import BLOCK, BlockCache
from tests.datasets.dataset import LENGTHS, table_of, write_dataset
from tests.recording.cloud import S3FileSystem, object_store


def test_a_dataset_in_an_object_store_is_indexed_and_read_by_ranges(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    folder = write_dataset(tmp_path_factory.mktemp("data"))
    near = Clouds(table_of(folder))
    with object_store() as bucket:
        files = S3FileSystem()
        for path in folder.glob("*.mcap"):
            files.put_file(str(path), f"{bucket}/data/{path.name}")
        cache = BlockCache(capacity=2 * BLOCK)
        far = Clouds(table_of(f"{bucket}/data"), cache=cache)
        assert len(far) == sum(LENGTHS)
        for row in range(len(far)):
            np.testing.assert_array_equal(far[row], near[row])
        assert cache.bytes <= 2 * BLOCK
        names = {entry.rsplit("/", 1)[-1] for entry in files.ls(f"{bucket}/data", refresh=True)}
        assert INDEX in names
        with EpisodeReader(f"{bucket}/data/episode-2.mcap") as episode:
            assert episode.meta.episode_id == "episode-2"

import pickle
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import open_index
from dnet.datasets.reader import EpisodeReader
from dnet.datasets.sources import BLOCK, BlockCache
from dnet.errors import BadEpisode, ChangedEpisode, TooFew
from tests.datasets.dataset import LENGTHS, table_of, upload, write_dataset
from tests.datasets.test_reader import rewrite
from tests.recorders import rollout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("data"))


def assert_same_clouds(clouds: Clouds, folder: Path) -> None:
    table = clouds.table
    assert len(clouds) == len(table) == sum(LENGTHS)
    for row in np.random.default_rng(0).permutation(len(table)).tolist():
        with EpisodeReader(folder / table.names[table.file[row]]) as episode:
            np.testing.assert_array_equal(clouds[row], episode.cloud(int(table.frame[row])))
            np.testing.assert_array_equal(table.grasps[row], episode.grasps[table.frame[row]])


def test_a_cloud_is_that_of_its_frame(folder: Path) -> None:
    assert_same_clouds(Clouds(table_of(folder)), folder)


def test_a_cloud_of_a_file_is_a_view_and_cannot_be_written_to(folder: Path) -> None:
    clouds = Clouds(table_of(folder))
    cloud = clouds[3]
    assert not cloud.flags.owndata
    assert not cloud.flags.writeable
    clouds.close()
    assert np.isfinite(cloud).all()


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_compressed_clouds_are_the_same(
    folder: Path, tmp_path: Path, compression: CompressionType
) -> None:
    for path in folder.glob("*.mcap"):
        rewrite(path, tmp_path / path.name, compression=compression)
    assert_same_clouds(Clouds(table_of(tmp_path)), folder)


def test_clouds_behind_a_url_are_the_same_and_take_bounded_memory(folder: Path) -> None:
    cache = BlockCache(capacity=BLOCK)
    clouds = Clouds(table_of(upload(folder, "clouds")), cache=cache)
    assert_same_clouds(clouds, folder)
    assert 0 < cache.bytes <= BLOCK


def test_clouds_can_be_sent_to_another_process(folder: Path) -> None:
    clouds = Clouds(table_of(folder))
    first = clouds[0]
    sent = pickle.loads(pickle.dumps(clouds))  # noqa: S301
    np.testing.assert_array_equal(sent[0], first)


def test_a_file_that_has_changed_is_refused(tmp_path: Path) -> None:
    table = table_of(write_dataset(tmp_path, (2, 2)))
    (tmp_path / "episode-0.mcap").unlink()
    rollout.write(tmp_path / "episode-0.mcap", rollout.frames(3, seed=5))
    with pytest.raises(ChangedEpisode, match=r"episode-0\.mcap has changed since it was indexed"):
        Clouds(table)[0]
    assert len(Clouds(table)[2])


def test_clouds_of_different_lengths_are_refused(tmp_path: Path) -> None:
    write_dataset(tmp_path, (2,))
    rollout.write(tmp_path / "other.mcap", rollout.frames(2, points=65))
    with pytest.raises(BadEpisode, match=r"other\.mcap has a cloud of 65 points at frame 0.* 64"):
        table_of(tmp_path)


def test_two_files_of_one_episode_are_refused(tmp_path: Path) -> None:
    write_dataset(tmp_path, (2,))
    (tmp_path / "copy.mcap").write_bytes((tmp_path / "episode-0.mcap").read_bytes())
    with pytest.raises(BadEpisode, match=r"holds the same episode as copy\.mcap: episode-0"):
        table_of(tmp_path)


def test_frames_on_the_way_are_left_out(tmp_path: Path) -> None:
    seen = rollout.frames(5)
    rollout.write(tmp_path / "a.mcap", seen)
    table = settled_frames(open_index(tmp_path))
    assert table.frame.tolist() == [n for n, one in enumerate(seen) if one.kind != "way"]
    assert table.rest.tolist() == [one.kind == "rest" for one in seen if one.kind != "way"]
    rollout.write(tmp_path / "b.mcap", [])
    (tmp_path / "a.mcap").unlink()
    with pytest.raises(TooFew, match="settled frames"):
        settled_frames(open_index(tmp_path))

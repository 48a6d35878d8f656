import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from dnet.datasets.index import INDEX, open_index
from dnet.datasets.index_file import pack_index
from dnet.datasets.reader import EpisodeReader
from dnet.errors import MissingPath, NoEpisodes
from tests.datasets.dataset import LENGTHS, upload, write_dataset
from tests.datasets.surgery import rewrite
from tests.recorders import rollout

FRAMES_EACH = [2 * length - 1 for length in LENGTHS]
"""With those on the way."""


class Counted:
    """Counts the files that are read."""

    def __init__(self) -> None:
        self.read = 0

    def __call__(self, done: int, total: int) -> None:
        assert done <= total
        self.read += 1


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "data")


def test_a_row_a_frame_says_what_the_episode_says(folder: Path) -> None:
    index = open_index(folder)
    assert index.frames.height == sum(FRAMES_EACH)
    for name in index.files["name"]:
        rows = index.frames.filter(pl.col("name") == name)
        content = (folder / name).read_bytes()
        with EpisodeReader(folder / name) as episode:
            assert rows["kind"].to_list() == list(episode.kinds)
            assert rows["frame"].to_list() == list(range(len(episode)))
            np.testing.assert_array_equal(rows["time"], episode.times)
            grasps = rows.select("grasp_x", "grasp_y", "grasp_z").to_numpy()
            np.testing.assert_array_equal(grasps, episode.grasps)
            motions = rows.select("motion_x", "motion_y", "motion_z").to_numpy()
            np.testing.assert_array_equal(motions, episode.grasps - episode.grasps[0])
            for row, data in enumerate(rows["data"].to_list()):
                cloud = episode.cloud(row)
                assert rows["points"][row] == len(cloud)
                assert content[data : data + cloud.nbytes] == cloud.tobytes()


def test_a_row_a_file_says_what_it_is_of(folder: Path) -> None:
    files = open_index(folder).files
    assert files["name"].to_list() == [f"episode-{number}.mcap" for number in range(3)]
    assert files["frames"].to_list() == FRAMES_EACH
    assert files["shapes"].to_list() == [length - 1 for length in LENGTHS]
    assert files["finished"].all()
    assert (files["note"] == "").all()
    assert files["bytes"].to_list() == [path.stat().st_size for path in sorted(folder.glob("*p"))]
    scene = rollout.meta("one").scene
    assert files["young"].to_list() == [scene.tissue.young] * 3
    assert json.loads(files["result"][0])["rejected"] == {"folded": 2}


def test_what_is_indexed_is_not_read_again(folder: Path) -> None:
    first, again = Counted(), Counted()
    before = open_index(folder, on_file=first)
    stamp = (folder / INDEX).stat().st_mtime_ns
    after = open_index(folder, on_file=again)
    assert (first.read, again.read) == (3, 0)
    assert after.frames.equals(before.frames)
    assert after.files.equals(before.files)
    assert stamp == (folder / INDEX).stat().st_mtime_ns


def test_new_changed_and_lost_files_are_noticed_and_no_other_is_read(folder: Path) -> None:
    open_index(folder)
    rollout.write(folder / "episode-9.mcap", rollout.frames(2, seed=9))
    (folder / "episode-0.mcap").unlink()
    (folder / "episode-1.mcap").unlink()
    rollout.write(folder / "episode-1.mcap", rollout.frames(3, seed=8))
    counted = Counted()
    index = open_index(folder, on_file=counted)
    assert counted.read == 2
    assert index.files["name"].to_list() == ["episode-1.mcap", "episode-2.mcap", "episode-9.mcap"]
    assert index.files["frames"].to_list() == [5, 11, 3]
    (folder / INDEX).unlink()
    anew = open_index(folder)
    assert anew.frames.equals(index.frames)
    assert anew.files.equals(index.files)


def test_a_file_that_cannot_be_read_has_a_row_and_a_note(folder: Path) -> None:
    (folder / "noise.mcap").write_bytes(b"noise")
    (folder / "empty.mcap").write_bytes(b"")
    (folder / "running.mcap.part").write_bytes(b"half")
    index = open_index(folder)
    broken = dict(index.broken().select("name", "note").iter_rows())
    assert set(broken) == {"noise.mcap", "empty.mcap"}
    assert broken["noise.mcap"] == "is not an MCAP file"
    assert index.frames.height == sum(FRAMES_EACH)


@pytest.mark.parametrize("key", ["seed", "index"])
def test_a_number_that_no_table_can_hold_breaks_its_file_alone(folder: Path, key: str) -> None:
    rewrite(
        folder / "episode-0.mcap",
        folder / "odd.mcap",
        metadata=lambda name, old: old | ({key: str(2**63)} if name == "dnet.episode" else {}),
    )
    assert open_index(folder).broken()["name"].to_list() == ["odd.mcap"]


def test_a_folder_of_which_nothing_can_be_read_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "noise.mcap").write_bytes(b"noise")
    assert open_index(tmp_path).broken().height == 1
    assert [path.name for path in tmp_path.iterdir()] == ["noise.mcap"]


@pytest.mark.parametrize("spoil", ["lost", "cut", "noise", "changed", "version", "stale"])
def test_an_index_that_will_not_do_is_made_anew(folder: Path, spoil: str) -> None:
    index = open_index(folder)
    path = folder / INDEX
    content = path.read_bytes()
    if spoil == "lost":
        path.unlink()
    elif spoil == "cut":
        path.write_bytes(content[:100])
    elif spoil == "noise":
        path.write_bytes(b"noise")
    elif spoil == "changed":
        path.write_bytes(content[:200] + bytes([content[200] ^ 1]) + content[201:])
    elif spoil == "version":
        path.write_bytes(content.replace(b"dnet.ix2", b"dnet.ix1", 1))
    else:
        path.write_bytes(pack_index(index.files[:1], index.frames[: FRAMES_EACH[0]]))
    counted = Counted()
    anew = open_index(folder, on_file=counted)
    assert counted.read
    assert anew.frames.equals(index.frames)
    assert anew.files.equals(index.files)


def test_several_processes_make_the_same_index(folder: Path) -> None:
    alone = open_index(folder, workers=1)
    (folder / INDEX).unlink()
    together = open_index(folder, workers=2)
    assert together.frames.equals(alone.frames)
    assert together.files.equals(alone.files)


def test_a_url_is_indexed_like_a_folder_and_keeps_its_index(folder: Path) -> None:
    url = upload(folder, "indexed")
    near, far = open_index(folder), open_index(f"{url}/")
    assert far.frames.equals(near.frames)
    assert far.files.drop("version").equals(near.files.drop("version"))
    counted = Counted()
    assert open_index(url, on_file=counted).frames.equals(near.frames)
    assert counted.read == 0


def test_a_folder_without_logs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes):
        open_index(tmp_path)
    with pytest.raises(MissingPath, match="nowhere does not exist; record into it"):
        open_index(tmp_path / "nowhere")
    with pytest.raises(MissingPath, match="memory://nowhere"):
        open_index("memory://nowhere")

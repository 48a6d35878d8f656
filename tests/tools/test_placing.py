import os
import shutil
from pathlib import Path

import polars as pl
import pytest

from dnet.commands.inspect_split import Split
from dnet.commands.train import Train
from dnet.datasets.index import open_index
from dnet.datasets.split import HELD_OUT
from dnet.errors import (
    BadEpisode,
    ClashingEpisodes,
    NoEpisodes,
    OccupiedOutput,
    TooFew,
    Unwritten,
)
from dnet.tools.merging import merge_datasets
from dnet.tools.placing import place_episodes
from dnet.tools.splitting import split_dataset
from dnet.training.division import divide
from tests.datasets.dataset import write_dataset
from tests.recorders.rollout import frames, write


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.mcap")}


@pytest.mark.parametrize("copy", [False, True])
def test_files_get_a_second_name_or_a_copy(tmp_path: Path, copy: bool) -> None:
    source = write(tmp_path / "a.mcap", frames(2))
    place_episodes({"b.mcap": source}, tmp_path / "out", copy=copy)
    placed = tmp_path / "out" / "b.mcap"
    assert placed.read_bytes() == source.read_bytes()
    assert placed.samefile(source) != copy
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["b.mcap"]
    with pytest.raises(OccupiedOutput, match=r"1 recordings, such as b\.mcap"):
        place_episodes({"c.mcap": source}, tmp_path / "out")
    with pytest.raises(OccupiedOutput, match="a file"):
        place_episodes({"c.mcap": source}, source)


def test_the_folders_of_a_split_are_the_sides_of_a_training(tmp_path: Path) -> None:
    folder = write_dataset(tmp_path / "data", (2, 3, 4, 2, 3))
    index = open_index(folder)
    sides = split_dataset(index, tmp_path / "out", fraction=0.4, seed=3)
    division = divide(index, fraction=0.4, seed=3)
    for side, table in zip(sides, (division.training, division.unseen_episodes), strict=True):
        ids = {f"{table.episodes[file]}.mcap" for file in table.file.tolist()}
        assert set(contents(side.folder)) == ids
        assert side.episodes == len(ids)
    assert sum(side.shapes for side in sides) == int((~division.all.rest).sum())
    only = open_index(write_dataset(tmp_path / "one", (2,)))
    with pytest.raises(TooFew, match="is 1, must be at least 2"):
        split_dataset(only, tmp_path / "two", fraction=0.4, seed=3)


def test_a_merged_dataset_has_the_episodes_of_all_once(tmp_path: Path) -> None:
    one, other = write_dataset(tmp_path / "one", (2, 3)), tmp_path / "other"
    other.mkdir()
    shutil.copy(one / "episode-0.mcap", other)
    write(other / "episode-7.mcap", frames(2, seed=7))
    merged = merge_datasets([open_index(one), open_index(other)], tmp_path / "both")
    assert contents(tmp_path / "both") == contents(one) | contents(other)
    assert merged.episodes == 3
    assert merged.repeated == (str(other / "episode-0.mcap"),)


def test_different_episodes_of_one_id_are_refused(tmp_path: Path) -> None:
    one, other = write_dataset(tmp_path / "one", (2,)), tmp_path / "other"
    other.mkdir()
    write(other / "episode-0.mcap", frames(3, seed=5))
    indexes = [open_index(folder) for folder in (one, other)]
    with pytest.raises(ClashingEpisodes, match=r"one/episode-0\.mcap and .*have one episode"):
        merge_datasets(indexes, tmp_path / "both")
    assert not (tmp_path / "both").exists()


def test_files_that_cannot_be_read_are_refused_or_left_out(tmp_path: Path) -> None:
    one = write_dataset(tmp_path / "one", (2,))
    (one / "noise.mcap").write_bytes(b"noise")
    with pytest.raises(BadEpisode, match=r"noise\.mcap is not an MCAP file"):
        merge_datasets([open_index(one)], tmp_path / "both")
    merged = merge_datasets([open_index(one)], tmp_path / "both", skip_broken=True)
    assert (merged.episodes, merged.broken) == (1, (str(one / "noise.mcap"),))


def test_what_a_symbolic_link_leads_to_is_placed(tmp_path: Path) -> None:
    source = write(tmp_path / "store" / "a.mcap", frames(2))
    link = tmp_path / "links" / "a.mcap"
    link.parent.mkdir()
    link.symlink_to(os.path.relpath(source, link.parent))
    place_episodes({"a.mcap": link}, tmp_path / "far" / "away")
    placed = tmp_path / "far" / "away" / "a.mcap"
    assert not placed.is_symlink()
    assert placed.samefile(source)


@pytest.mark.parametrize("copy", [False, True])
@pytest.mark.parametrize("made", [False, True])
def test_a_failure_halfway_leaves_nothing_behind(tmp_path: Path, copy: bool, made: bool) -> None:
    source, out = write(tmp_path / "a.mcap", frames(2)), tmp_path / "out"
    if made:
        out.mkdir()
        (out / "notes.txt").write_text("precious")
    before = sorted(tmp_path.rglob("*"))
    files = {"a.mcap": source, "b.mcap": tmp_path / "gone.mcap"}
    with pytest.raises(Unwritten, match="No such file"):
        place_episodes(files, out, copy=copy)

    def interrupt(_done: int, _total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        place_episodes({"a.mcap": source}, out, copy=copy, on_file=interrupt)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("seed", range(4))
def test_episodes_without_a_pair_change_no_side(tmp_path: Path, seed: int) -> None:
    index = open_index(write_dataset(tmp_path / "data", (1, 2, 2, 1, 2)))
    sides = split_dataset(index, tmp_path / "out", fraction=0.25, seed=seed)
    division = divide(index, fraction=0.25, seed=seed)
    unseen = division.unseen_episodes
    judged = {f"{unseen.episodes[file]}.mcap" for file in unseen.file.tolist()}
    assert set(contents(sides[1].folder)) == judged
    assert set(contents(sides[0].folder)) == set(index.files["name"]) - judged


def test_a_split_writes_nothing_where_one_of_its_folders_is_occupied(tmp_path: Path) -> None:
    index = open_index(write_dataset(tmp_path / "data", (2, 2)))
    write(tmp_path / "out" / "validation" / "old.mcap", frames(2))
    with pytest.raises(OccupiedOutput, match="validation already holds"):
        split_dataset(index, tmp_path / "out", fraction=0.25, seed=0)
    assert not (tmp_path / "out" / "training").exists()


def test_a_folder_given_twice_is_taken_once_and_said(tmp_path: Path) -> None:
    index = open_index(write_dataset(tmp_path / "data", (2, 3)))
    merged = merge_datasets([index, index], tmp_path / "both")
    assert merged.episodes == 2
    assert merged.repeated == tuple(str(index.path(name)) for name in index.files["name"])


def test_files_of_one_name_are_refused_with_a_way_out(tmp_path: Path) -> None:
    one = write_dataset(tmp_path / "one", (2,))
    write(tmp_path / "other" / "episode-0.mcap", frames(2), name="another")
    indexes = [open_index(folder) for folder in (one, tmp_path / "other")]
    with pytest.raises(ClashingEpisodes, match=r"have one name: episode-0\.mcap; .* rename one"):
        merge_datasets(indexes, tmp_path / "both")


def test_a_merge_of_nothing_readable_is_refused(tmp_path: Path) -> None:
    (tmp_path / "noise.mcap").write_bytes(b"noise")
    index = open_index(tmp_path)
    assert index.files.filter(pl.col("note") == "").height == 0
    with pytest.raises(NoEpisodes, match=r"holds no \.mcap episode that can be read"):
        merge_datasets([index], tmp_path / "both", skip_broken=True)
    assert not (tmp_path / "both").exists()


def test_whoever_states_no_share_holds_out_the_same() -> None:
    assert Train(Path("data"), Path("out")).validation == HELD_OUT
    assert Split(Path("data"), Path("out")).validation == HELD_OUT

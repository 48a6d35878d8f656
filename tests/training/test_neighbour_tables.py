from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from dnet.datasets.frame_table import FrameTable, settled_frames
from dnet.datasets.index import open_index
from dnet.errors import BadTables
from dnet.nets.deformernet import DeformerNetConfig, prepare
from dnet.nets.neighbourhoods import Neighbourhoods
from dnet.training.neighbour_tables import NeighbourTables, samplings_for
from tests.training.deforming_box import SMALL, BoxEpisode, write_boxes


def table_of(folder: Path, *seeds: int, points: int = SMALL.points) -> FrameTable:
    boxes = [BoxEpisode(seed, points=points) for seed in seeds]
    return settled_frames(open_index(write_boxes(folder, boxes)))


def first(tables: NeighbourTables, box: BoxEpisode, *, choice: int = 0) -> Neighbourhoods:
    return tables.of(np.array([0]), box.frame(0).cloud[None], choices=np.array([choice]))


def files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.npy"))


def test_tables_are_found_once_and_progress_counts_every_cloud(tmp_path: Path) -> None:
    tables = NeighbourTables(table_of(tmp_path, 0, 1), SMALL)
    done: list[int] = []
    tables.build(on_clouds=done.append)
    made = {path: path.stat().st_mtime_ns for path in files(tmp_path)}
    tables.build(on_clouds=done.append)
    assert len(made) == 2
    assert made == {path: path.stat().st_mtime_ns for path in files(tmp_path)}
    assert done == [6, 6, 6, 6]


def test_several_processes_find_the_same_tables(tmp_path: Path) -> None:
    alone, together = (table_of(tmp_path / name, 0, 1, 2) for name in ("alone", "together"))
    NeighbourTables(alone, SMALL, 2).build(workers=1)
    NeighbourTables(together, SMALL, 2).build(workers=2)
    one, other = files(tmp_path / "alone"), files(tmp_path / "together")
    assert len(one) == 3
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in other]


def test_another_network_has_tables_of_its_own(tmp_path: Path) -> None:
    table, box = table_of(tmp_path, 0, points=600), BoxEpisode(0, points=600)
    for size in ("light", "paper"):
        config = DeformerNetConfig(size=size, points=600)
        tables = NeighbourTables(table, config)
        tables.build()
        want = prepare(box.frame(0).cloud, config)
        assert torch.equal(first(tables, box).neighbours[0][0], want.neighbours[0])
    assert len(files(tmp_path)) == 2


def test_other_choices_of_centroids_are_of_the_same_cloud(tmp_path: Path) -> None:
    box = BoxEpisode(0)
    tables = NeighbourTables(table_of(tmp_path, 0), SMALL, 3)
    tables.build()
    choices = [first(tables, box, choice=choice) for choice in range(3)]
    assert choices[0].centroids[0].tolist() == list(range(128))
    assert len({tuple(choice.centroids[0].tolist()) for choice in choices}) == 3
    for choice in choices:
        assert torch.equal(choice.inverse_densities[0], choices[0].inverse_densities[0])


def test_part_of_a_dataset_is_read_from_the_tables_of_the_whole(tmp_path: Path) -> None:
    table, box = table_of(tmp_path, 0), BoxEpisode(0)
    NeighbourTables(table, SMALL).build()
    part = NeighbourTables(table.where(table.frame % 2 == 1), SMALL)
    got = part.of(np.array([1]), box.frame(3).cloud[None])
    want = prepare(box.frame(3).cloud, SMALL)
    assert torch.equal(got.neighbours[0][0], want.neighbours[0])


def test_a_cut_off_table_is_found_anew(tmp_path: Path) -> None:
    tables = NeighbourTables(table_of(tmp_path, 0), SMALL)
    tables.build()
    (path,) = files(tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-7])
    with pytest.raises(BadTables, match="remove that folder"):
        first(tables, BoxEpisode(0))
    tables.build()
    assert path.read_bytes() == whole


@pytest.mark.parametrize("place", [-6, -60, -600])
def test_a_changed_table_is_found_anew(tmp_path: Path, place: int) -> None:
    tables = NeighbourTables(table_of(tmp_path, 0), SMALL)
    tables.build()
    (path,) = files(tmp_path)
    whole = path.read_bytes()
    changed = bytearray(whole)
    changed[place] ^= 1
    path.write_bytes(changed)
    tables.build()
    assert path.read_bytes() == whole


def test_a_row_beyond_the_cloud_is_refused(tmp_path: Path) -> None:
    tables = NeighbourTables(table_of(tmp_path, 0), SMALL)
    tables.build()
    (path,) = files(tmp_path)
    records = np.load(path)
    records["samplings"]["neighbours_1"][0, 0, 5, 2] = SMALL.points
    with path.open("wb") as file:
        np.save(file, records)
        file.write(bytes(4))
    with pytest.raises(BadTables, match="beyond its cloud"):
        first(tables, BoxEpisode(0))


@given(few=st.integers(1, 10**6), more=st.integers(1, 10**6))
def test_more_clouds_have_no_more_choices_each_and_at_least_one(few: int, more: int) -> None:
    few, more = sorted((few, more))
    assert 1 <= samplings_for(more) <= samplings_for(few) <= 8
    assert samplings_for(more) * more <= max(20_000, more)

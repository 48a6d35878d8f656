from pathlib import Path

import numpy as np
import pytest

from dnet.datasets.index import open_index
from dnet.datasets.loading import Division, PairKind, Share, load_groups, load_samples
from dnet.training.division import divide
from tests.datasets.dataset import table_of, write_dataset

LENGTHS = (5, 4, 6, 3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("data"), LENGTHS)


@pytest.mark.parametrize(
    ("pairs", "count"), [("any", 20 + 12 + 30 + 6), ("rest", 4 + 3 + 5 + 2), ("mixed", 28)]
)
def test_an_epoch_has_every_sample(folder: Path, pairs: PairKind, count: int) -> None:
    rows = [
        tuple(row) for batch in load_samples(folder, pairs=pairs) for row in batch.rows.tolist()
    ]
    assert len(rows) == count
    assert pairs == "mixed" or len(set(rows)) == count


def test_sides_by_episode_are_those_of_a_training(folder: Path) -> None:
    division = divide(open_index(folder), fraction=0.4, seed=3)
    unseen = len(division.unseen_episodes)
    for side, count in (("training", len(division.all) - unseen), ("validation", unseen)):
        stream = load_groups(folder, division=Division(side, fraction=0.4, seed=3))  # type: ignore[arg-type]
        assert sum(len(batch) for batch in stream) == count


def test_sides_by_shape_share_the_rest_frames_alone(folder: Path) -> None:
    table = table_of(folder)
    goals = []
    for side in ("training", "validation"):
        division = Division(side, by="shape", fraction=0.5)
        part = division.of(table)
        stream = load_samples(folder, pairs="rest", division=division)
        goals.append(
            {
                (part.file[goal], part.frame[goal])
                for batch in stream
                for goal in batch.rows[:, 1].tolist()
            }
        )
    assert not goals[0] & goals[1]
    assert len(goals[0] | goals[1]) == sum(length - 1 for length in LENGTHS)


def test_processes_have_as_many_batches_and_nothing_in_common(folder: Path) -> None:
    streams = [load_samples(folder, batch=4, share=Share(rank, world=3)) for rank in range(3)]
    assert len({len(stream) for stream in streams}) == 1
    rows = np.concatenate([batch.rows for stream in streams for batch in stream])
    assert len(np.unique(rows, axis=0)) == len(rows) == 68 // 12 * 12

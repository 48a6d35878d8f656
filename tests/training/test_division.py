import shutil
from pathlib import Path

import numpy as np
import pytest

from dnet.datasets.frame_table import FrameTable
from dnet.datasets.index import open_index
from dnet.errors import BadEpisode, NoEpisodes, NotAFraction, TooFew
from dnet.training.division import Division, divide, pairs_of, thinned
from tests.datasets.dataset import table_of, write_dataset
from tests.recorders import rollout

EVERY = {f"episode-{index}" for index in range(5)}


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("episodes"), (7,) * 5)


def episodes(table: FrameTable) -> set[str]:
    return {table.episodes[file] for file in table.file.tolist()}


def frames(table: FrameTable) -> set[tuple[str, int, bool]]:
    names = [table.episodes[file] for file in table.file.tolist()]
    return set(zip(names, table.frame.tolist(), table.rest.tolist(), strict=True))


def of(directory: Path, *, fraction: float = 0.4, seed: int = 0) -> Division:
    return divide(open_index(directory), fraction=fraction, seed=seed)


def test_every_episode_is_on_one_side_and_none_on_both(directory: Path) -> None:
    division = of(directory)
    training, unseen = episodes(division.training), episodes(division.unseen_episodes)
    assert training
    assert unseen
    assert not training & unseen
    assert training | unseen == EVERY
    assert division.skipped == 0


def test_of_seen_episodes_every_shape_is_on_one_side_and_rest_shapes_are_on_both(
    directory: Path,
) -> None:
    division = of(directory)
    training, unseen = frames(division.training), frames(division.unseen_shapes)
    assert {name for name, _, _ in unseen} == episodes(division.training)
    assert training & unseen == {one for one in training if one[2]}
    assert training | unseen | frames(division.unseen_episodes) == frames(division.all)
    assert len(training) > len(unseen) > len(episodes(division.training))


def test_few_episodes_may_be_learned_from_and_the_same_ones_are_held_out(directory: Path) -> None:
    every = of(directory)
    few = divide(open_index(directory), fraction=0.4, seed=0, episodes=1)
    assert few.training.episodes_seen == every.training.episodes_seen[:1]
    assert few.unseen_shapes.episodes_seen == few.training.episodes_seen
    assert frames(few.unseen_episodes) == frames(every.unseen_episodes)
    assert frames(few.training) <= frames(every.training)


def test_another_seed_makes_another_division(directory: Path) -> None:
    divisions = [of(directory, seed=seed) for seed in range(12)]
    assert len({frozenset(episodes(one.unseen_episodes)) for one in divisions}) > 1
    again = of(directory, seed=3)
    assert frames(again.training) == frames(divisions[3].training)


@pytest.mark.parametrize("fraction", [0.0, 1.0])
def test_each_side_has_an_episode_whatever_the_fraction(directory: Path, fraction: float) -> None:
    division = of(directory, fraction=fraction)
    sides = (division.training, division.unseen_episodes)
    assert min(len(episodes(side)) for side in sides) == 1


def test_an_episode_without_a_pair_is_counted_and_left_out(directory: Path, tmp_path: Path) -> None:
    for path in sorted(directory.glob("*.mcap"))[:2]:
        shutil.copy(path, tmp_path)
    rollout.write(tmp_path / "lonely.mcap", rollout.frames(1))
    division = of(tmp_path, fraction=0.5)
    assert division.skipped == 1
    assert episodes(division.all) == {"episode-0", "episode-1"}


def test_copies_of_one_episode_are_refused(directory: Path, tmp_path: Path) -> None:
    for index in range(2):
        shutil.copy(directory / "episode-0.mcap", tmp_path / f"copy-{index}.mcap")
    with pytest.raises(BadEpisode, match="remove one of them"):
        of(tmp_path)


def test_one_episode_cannot_be_divided(directory: Path, tmp_path: Path) -> None:
    shutil.copy(directory / "episode-0.mcap", tmp_path)
    with pytest.raises(TooFew, match="two settled frames is 1, must be at least 2"):
        of(tmp_path)


def test_what_cannot_be_read_is_refused(directory: Path, tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes):
        of(tmp_path)
    with pytest.raises(NotAFraction):
        of(directory, fraction=1.5)
    (tmp_path / "noise.mcap").write_bytes(b"noise")
    with pytest.raises(BadEpisode, match=r"noise\.mcap"):
        of(tmp_path)


def test_pairs_are_those_of_two_different_frames_of_one_episode(tmp_path: Path) -> None:
    assert pairs_of(table_of(write_dataset(tmp_path, (4, 1, 6)))) == 12 + 0 + 30


@pytest.mark.parametrize("most", [4, 10, 14, 34, 35, 1000])
def test_a_thinned_table_has_about_as_many_frames_and_always_pairs(
    directory: Path, most: int
) -> None:
    table = table_of(directory)
    few = thinned(table, most)
    assert 2 <= len(few) <= most
    assert frames(few) <= frames(table)
    assert pairs_of(few) > 0
    assert few.rest.sum() == len(episodes(few))
    assert most < len(table) or len(few) == len(table)
    lengths = few.lengths[few.lengths > 0]
    assert np.ptp(lengths) == 0

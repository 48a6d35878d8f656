import shutil
from pathlib import Path

import pytest

from dnet.datasets.index import open_index
from dnet.errors import BadEpisode, NoEpisodes, NotAFraction, TooFew
from dnet.training.episodes import divide, open_each
from tests.recorders import rollout


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("episodes")
    for index in range(5):
        rollout.write(path / f"episode-{index}.mcap", rollout.frames(3, seed=index))
    return path


def names(surveys: tuple[object, ...]) -> set[str]:
    return {survey.episode_id for survey in surveys}  # type: ignore[attr-defined]


def test_every_episode_is_on_one_side_and_none_on_both(directory: Path) -> None:
    division = divide(open_index(directory), fraction=0.4, seed=0)
    training, validation = names(division.training), names(division.validation)
    assert training
    assert validation
    assert not training & validation
    assert training | validation == {f"episode-{index}" for index in range(5)}
    assert division.skipped == 0
    assert division.points == 64
    assert all(survey.frames == 3 for survey in division.training)


def test_another_seed_makes_another_division(directory: Path) -> None:
    sides = {
        frozenset(names(divide(open_index(directory), fraction=0.4, seed=seed).validation))
        for seed in range(12)
    }
    assert len(sides) > 1


@pytest.mark.parametrize("fraction", [0.0, 1.0])
def test_each_side_has_an_episode_whatever_the_fraction(directory: Path, fraction: float) -> None:
    division = divide(open_index(directory), fraction=fraction, seed=0)
    assert min(len(division.training), len(division.validation)) == 1


def test_an_episode_without_a_pair_is_counted_and_left_out(directory: Path, tmp_path: Path) -> None:
    for path in sorted(directory.iterdir())[:2]:
        shutil.copy(path, tmp_path)
    rollout.write(tmp_path / "lonely.mcap", rollout.frames(1))
    division = divide(open_index(tmp_path), fraction=0.5, seed=0)
    assert division.skipped == 1
    assert names(division.training + division.validation) == {"episode-0", "episode-1"}


def test_copies_of_one_episode_are_on_one_side(directory: Path, tmp_path: Path) -> None:
    for index in range(3):
        shutil.copy(directory / "episode-0.mcap", tmp_path / f"copy-{index}.mcap")
    shutil.copy(directory / "episode-1.mcap", tmp_path)
    division = divide(open_index(tmp_path), fraction=0.5, seed=0)
    assert not names(division.training) & names(division.validation)
    assert sorted((len(division.training), len(division.validation))) == [1, 3]


def test_one_episode_cannot_be_divided(directory: Path, tmp_path: Path) -> None:
    shutil.copy(directory / "episode-0.mcap", tmp_path)
    with pytest.raises(TooFew, match="two settled frames is 1, must be at least 2"):
        divide(open_index(tmp_path), fraction=0.25, seed=0)


def test_what_cannot_be_read_is_refused(directory: Path, tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes):
        divide(open_index(tmp_path), fraction=0.25, seed=0)
    with pytest.raises(NotAFraction):
        divide(open_index(directory), fraction=1.5, seed=0)
    (tmp_path / "noise.mcap").write_bytes(b"noise")
    with pytest.raises(BadEpisode, match=r"noise\.mcap"):
        divide(open_index(tmp_path), fraction=0.25, seed=0)


def test_episodes_are_opened_in_order(directory: Path) -> None:
    surveys = divide(open_index(directory), fraction=0.4, seed=0).training
    opened = [episode.meta.episode_id for episode in open_each(surveys)]
    assert opened == [survey.episode_id for survey in surveys]

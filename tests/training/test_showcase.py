import numpy as np
import pytest
import torch

from dnet.training.frames import Frames
from dnet.training.scores import errors_of
from dnet.training.showcase import WORST, Showcase
from dnet.training.tasks import new_network
from tests.training.deforming_box import SMALL, box_frames


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), range(WORST + 1))


def test_the_worst_pair_of_each_episode_is_kept_the_worst_first(frames: Frames) -> None:
    network, showcase = new_network(SMALL, seed=0), Showcase(frames)
    errors_of(network, frames, watch=showcase.watch)
    worst = showcase.worst()
    assert len(worst) == WORST
    assert len({pair.title.split()[0] for pair in worst}) == WORST
    found = [pair.error_mm for pair in worst]
    assert found == sorted(found, reverse=True)
    table = frames.table
    for pair in worst:
        name, current, _, goal = pair.title.split()
        rows = np.flatnonzero(np.array([table.episodes[file] == name for file in table.file]))
        here, there = int(rows[int(current)]), int(rows[int(goal)])
        np.testing.assert_array_equal(pair.current, frames.clouds[here])
        np.testing.assert_array_equal(pair.goal, frames.clouds[there])
        np.testing.assert_allclose(pair.true, table.grasps[there] - table.grasps[here])
        predicted = network.predict(pair.current, pair.goal)
        np.testing.assert_allclose(pair.predicted, predicted, atol=1e-5)
        error = 1000 * np.linalg.norm(pair.predicted - pair.true)
        assert pair.error_mm == pytest.approx(error, rel=1e-4)


def test_of_few_pairs_all_are_kept_and_of_many_an_even_share(frames: Frames) -> None:
    showcase = Showcase(frames)
    true = torch.arange(150.0)[:, None].expand(-1, 3) / 1000
    rows = np.zeros(75, np.int64)
    for half in (true[:75], true[75:]):
        showcase.watch(rows, rows, half * 0, half)
    assert torch.equal(showcase.motions[1], true)
    assert not showcase.motions[0].any()


def test_a_set_without_a_pair_shows_nothing(frames: Frames) -> None:
    showcase = Showcase(frames)
    assert [len(motions) for motions in showcase.motions] == [0, 0]
    assert showcase.worst() == []

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from dnet.datasets.frame_table import FrameTable, settled_frames
from dnet.datasets.index import open_index
from dnet.errors import NoDisplacement, TooFew
from dnet.evaluation.grasp import Case, answers_of, cases_of, frame_of, table_of
from dnet.evaluation.grasp_figure import draw_cases
from dnet.servo.grasp_pickers import MostDisplaced, RandomPoint
from dnet.servo.pickers import Choice
from dnet.types import Cloud
from tests.training.deforming_box import BoxEpisode, write_boxes


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> FrameTable:
    boxes = [BoxEpisode(seed) for seed in range(3)]
    return settled_frames(open_index(write_boxes(tmp_path_factory.mktemp("boxes"), boxes)))


@dataclass
class Scripted:
    """Gives answers that are a known distance from the truth; to some cases, none."""

    cases: list[Case]
    turn: int = 0

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        case = self.cases[self.turn]
        self.turn += 1
        if self.turn == len(self.cases):
            raise NoDisplacement("the goal is at a Chamfer distance of", 0.0, 1.0)
        return Choice(case.truth + np.array([0.001 * self.turn, 0, 0]), 0.5)


def test_cases_are_even_over_episodes_and_each_comes_once(table: FrameTable) -> None:
    cases = cases_of(table, 7)
    names = [case.name for case in cases]
    assert len(set(names)) == 7
    counts = [sum(name.startswith(episode) for name in names) for episode in table.episodes_seen]
    assert sorted(counts) == [2, 2, 3]
    assert names == [case.name for case in cases_of(table, 7)]
    assert names != [case.name for case in cases_of(table, 7, seed=1)]
    for case in cases:
        assert np.linalg.norm(case.initial - case.truth, axis=1).min() < 0.03
    with pytest.raises(TooFew, match="--cases to choose from is 15, must be at least 16"):
        cases_of(table, 16)


def test_distances_are_from_the_truth_and_no_answer_counts_as_the_middle(
    table: FrameTable, tmp_path: Path
) -> None:
    cases = cases_of(table, 5)
    found = answers_of(Scripted(cases), cases)
    np.testing.assert_allclose(found.distances[:4], [0.001, 0.002, 0.003, 0.004], atol=1e-9)
    middle = np.linalg.norm(cases[4].initial.mean(axis=0, dtype=np.float64) - cases[4].truth)
    assert found.distances[4] == pytest.approx(middle)
    assert found.unanswered == 1
    answers = {"scripted": found, "random": answers_of(RandomPoint(), cases)}
    line = table_of(answers).splitlines()[2]
    assert line.startswith(f"| scripted | 5 | {200 * (0.01 + middle):.1f} | 3.0 |")
    assert "| 1 |" in line
    rows = frame_of(cases, answers).splitlines()
    assert len(rows) == 11
    assert rows[1].startswith(f"scripted,{cases[0].name},")
    draw_cases(cases, answers, tmp_path / "deep" / "grasp.png")
    assert (tmp_path / "deep" / "grasp.png").read_bytes()[1:4] == b"PNG"


def test_the_most_displaced_point_is_nearer_to_the_grasp_than_any_point(table: FrameTable) -> None:
    cases = cases_of(table, 15)
    near, far = (
        answers_of(one, cases).distances.mean() for one in (MostDisplaced(), RandomPoint())
    )
    assert near < far

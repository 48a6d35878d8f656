from pathlib import Path

import numpy as np
import pytest

from dnet.datasets.index import open_index
from dnet.errors import BadCondition
from dnet.tools.filtering import described_frames, episodes_of, matching_frames
from tests.datasets.dataset import LENGTHS, write_dataset


def test_a_condition_finds_the_frames_for_which_it_holds(tmp_path: Path) -> None:
    index = open_index(write_dataset(tmp_path))
    every = described_frames(index)
    motions = np.linalg.norm(every.select("motion_x", "motion_y", "motion_z"), axis=1)
    np.testing.assert_allclose(every["motion_mm"], 1e3 * motions)
    limit = float(np.median(every["motion_mm"].to_numpy()))
    found = matching_frames(index, f"kind = 'shape' and motion_mm > {limit}")
    wanted = [
        (row["episode"], row["frame"])
        for row in every.iter_rows(named=True)
        if row["kind"] == "shape" and row["motion_mm"] > limit
    ]
    assert list(found.select("episode", "frame").iter_rows()) == wanted != []
    counted = dict(episodes_of(found).select("episode", "frames").iter_rows())
    assert counted == {name: sum(one == name for one, _ in wanted) for name in counted}


def test_a_condition_may_be_on_the_object(tmp_path: Path) -> None:
    index = open_index(write_dataset(tmp_path))
    assert matching_frames(index, "young > 999 and kind = 'rest'").height == len(LENGTHS)
    assert matching_frames(index, "young > 1001").height == 0


@pytest.mark.parametrize("condition", ["motion >", "speed > 1", "", "kind = 3 and", "1; drop"])
def test_what_is_no_condition_is_refused_with_the_columns(tmp_path: Path, condition: str) -> None:
    index = open_index(write_dataset(tmp_path, (2,)))
    with pytest.raises(BadCondition, match=r"is no condition on frames: .*motion_mm"):
        matching_frames(index, condition)


def test_a_refusal_lists_the_columns_once(tmp_path: Path) -> None:
    index = open_index(write_dataset(tmp_path, (2,)))
    with pytest.raises(BadCondition) as refused:
        matching_frames(index, "speed > 1")
    assert str(refused.value).count("motion_mm") == 1

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from dnet.datasets.index import open_index
from dnet.datasets.split import HELD_OUT
from dnet.tools.statistics_oddities import Oddities, oddities
from tests.recorders.rollout import frame, frames, write


def odd(folder: Path) -> Oddities:
    return oddities(open_index(folder))


def test_nothing_is_odd_in_a_dataset_of_random_shapes(tmp_path: Path) -> None:
    for number in range(4):
        # The made-up clouds at rest are all the same: noise tells them apart.
        rng = np.random.default_rng(number)
        seen = [
            replace(
                one, cloud=one.cloud + rng.normal(scale=1e-4, size=one.cloud.shape).astype("f4")
            )
            for one in frames(9, seed=number)
        ]
        write(tmp_path / f"{number}.mcap", seen)
    found = odd(tmp_path)
    assert found == Oddities((), (), 0, (), 0, HELD_OUT)


def test_a_value_that_never_varies_is_named(tmp_path: Path) -> None:
    moved = [frame(float(n), np.array([0.01 * n, 0.02, -0.01 * n])) for n in range(1, 6)]
    write(tmp_path / "a.mcap", [frame(0.0, np.zeros(3), "rest"), *moved])
    assert odd(tmp_path).without_variance == ("motion_y",)


def test_a_shape_far_from_all_others_is_named(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    motions = rng.uniform(-0.003, 0.003, (40, 3))
    motions[17] = [0.0, 0.0, 0.05]
    shapes = [frame(float(n), motion) for n, motion in enumerate(motions, start=1)]
    write(tmp_path / "a.mcap", [frame(0.0, np.zeros(3), "rest"), *shapes])
    outliers = {one.value: one for one in odd(tmp_path).outliers}
    assert outliers.keys() == {"motion_z", "motion"}
    for one in outliers.values():
        assert (one.count, one.examples) == (1, ("a:18",))
        assert one.fence[1] < 0.05


def test_clouds_that_come_twice_and_leak_are_counted(tmp_path: Path) -> None:
    for number in range(6):
        write(tmp_path / f"{number}.mcap", frames(3, seed=number))
    found = odd(tmp_path)
    # The made-up rest shapes are all the same cloud.
    assert found.duplicate_clouds == 6
    assert found.leaked_clouds == 1
    assert found.duplicate_episodes == ()


def test_files_of_one_episode_are_named(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", frames(3))
    write(tmp_path / "b.mcap", frames(3, seed=1))
    shutil.copy(tmp_path / "a.mcap", tmp_path / "c.mcap")
    found = odd(tmp_path)
    assert found.duplicate_episodes == ("a.mcap", "c.mcap")
    assert found.duplicate_clouds == 7

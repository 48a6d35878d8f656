"""A goal is a file and perhaps a frame, or drawn at random."""

from pathlib import Path

import pytest

from dnet.trials.request import Trial, is_random, split_goal


@pytest.mark.parametrize(
    ("text", "path", "frame"),
    [
        ("a/b.mcap:7", "a/b.mcap", 7),
        ("a/b.mcap", "a/b.mcap", None),
        ("c:/b.mcap", "c:/b.mcap", None),
    ],
)
def test_a_goal_is_a_file_and_perhaps_a_frame(text: str, path: str, frame: int | None) -> None:
    assert split_goal(text) == (Path(path), frame)


@pytest.mark.parametrize(
    ("goal", "random", "name"),
    [
        ("random", True, "random"),
        ("random:12", True, "random-12"),
        ("data/episode-0-00003.mcap:7", False, "episode-0-00003-7"),
        ("clouds/liver.ply", False, "liver"),
        ("random.npy", False, "random"),
    ],
)
def test_a_goal_has_a_name_for_its_directory(goal: str, random: bool, name: str) -> None:
    assert is_random(goal) == random
    assert Trial(goal, Path("out")).goal_name == name

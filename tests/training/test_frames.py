from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from dnet.errors import BadCloud, BadEpisode, TooFew
from dnet.nets.deformernet import prepare
from dnet.training.frames import read_frames, samplings_for
from dnet.types import Frame, FrameKind
from tests.training.deforming_box import SMALL, BoxEpisode, box_frames


class SpoiltBox(BoxEpisode):
    def frame(self, index: int) -> Frame:
        frame = super().frame(index)
        frame.cloud[3:5] = np.nan
        return frame


def test_settled_frames_are_kept_in_order_and_those_on_the_way_are_not() -> None:
    kinds: tuple[FrameKind, ...] = ("rest", "way", "shape", "way", "way", "shape")
    boxes = [BoxEpisode(0, kinds), BoxEpisode(1, kinds)]
    frames = read_frames(boxes, SMALL)
    assert frames.lengths == (3, 3)
    assert frames.rest.tolist() == [True, False, False] * 2
    wanted = [box.frame(index) for box in boxes for index in (0, 2, 5)]
    np.testing.assert_array_equal(
        frames.grasps, np.stack([frame.grasp for frame in wanted]).astype(np.float32)
    )
    for row, frame in enumerate(wanted):
        (only,) = frames.clouds[row]
        assert torch.equal(only.points, prepare(frame.cloud, SMALL).points)


def test_pairs_are_all_ordered_pairs_of_different_frames_of_one_episode() -> None:
    frames = read_frames([BoxEpisode(0), BoxEpisode(1, ("rest", "shape"))], SMALL)
    current, goal = frames.all_pairs()
    pairs = set(zip(current.tolist(), goal.tolist(), strict=True))
    want = {(a, b) for rows in ((0, 1, 2, 3, 4, 5), (6, 7)) for a in rows for b in rows if a != b}
    assert pairs == want
    assert len(current) == len(pairs) == frames.pairs


def test_a_motion_is_the_grasp_of_the_goal_minus_that_of_the_current_frame() -> None:
    box = BoxEpisode(4)
    frames = box_frames([4])
    motion = frames.motions(torch.tensor([1]), torch.tensor([5]))[0]
    want = box.frame(5).grasp - box.frame(1).grasp
    np.testing.assert_allclose(motion.numpy(), want, atol=1e-7)


def test_an_episode_without_a_pair_is_left_out() -> None:
    alone = BoxEpisode(7, ("rest", "way", "way"))
    assert read_frames([alone, BoxEpisode(0), alone], SMALL).lengths == (6,)


def test_episodes_without_any_pair_are_refused() -> None:
    with pytest.raises(TooFew, match="two settled frames is 0, must be at least 1"):
        read_frames([BoxEpisode(7, ("way", "way", "shape"))], SMALL)


def test_another_number_of_points_is_refused_with_the_file_that_has_it() -> None:
    other = BoxEpisode(1, points=161, path=Path("other.mcap"))
    with pytest.raises(BadEpisode, match=r"other\.mcap has clouds of 161 points.*have 160"):
        read_frames([BoxEpisode(0), other], SMALL)


def test_a_spoilt_cloud_is_refused_with_its_frame() -> None:
    spoilt = SpoiltBox(0, path=Path("spoilt.mcap"))
    with pytest.raises(BadCloud, match=r"frame 0 of spoilt\.mcap has 2 of 160 points with NaN"):
        read_frames([spoilt], SMALL)


def test_every_cloud_is_announced() -> None:
    seen: list[int] = []
    read_frames([BoxEpisode(0), BoxEpisode(1)], SMALL, on_cloud=lambda: seen.append(1))
    assert len(seen) == 12


def test_a_cloud_is_kept_with_as_many_choices_of_centroids_as_asked() -> None:
    one, again, other = (
        read_frames([BoxEpisode(0)], SMALL, samplings=3, seed=seed) for seed in (0, 0, 1)
    )
    for choices, same, others in zip(one.clouds, again.clouds, other.clouds, strict=True):
        assert len(choices) == 3
        assert choices[0].centroids.tolist() == list(range(128))
        assert len({tuple(choice.centroids.tolist()) for choice in choices}) == 3
        for first, second in zip(choices, same, strict=True):
            assert torch.equal(first.centroids, second.centroids)
        assert not torch.equal(choices[1].centroids, others[1].centroids)


@given(few=st.integers(1, 10**6), more=st.integers(1, 10**6))
def test_more_clouds_have_no_more_choices_each_and_at_least_one(few: int, more: int) -> None:
    few, more = sorted((few, more))
    assert 1 <= samplings_for(more) <= samplings_for(few) <= 8
    assert samplings_for(more) * more <= max(20_000, more)

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import open_index
from dnet.errors import BadEpisode, ChangedEpisode
from dnet.nets.deformernet import centroid, prepare
from dnet.nets.neighbourhoods import Neighbourhoods, stack
from dnet.training.frames import Frames
from dnet.types import FrameKind
from tests.recorders import rollout
from tests.training.deforming_box import SMALL, BoxEpisode, box_frames, write_boxes


def tensors(of: Neighbourhoods) -> list[torch.Tensor]:
    return [of.points, of.centroids, *of.neighbours, *of.inverse_densities]


def same(one: Neighbourhoods, other: Neighbourhoods) -> bool:
    return all(
        a.dtype == b.dtype and torch.equal(a, b)
        for a, b in zip(tensors(one), tensors(other), strict=True)
    )


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1])


def test_frames_come_as_if_they_had_been_prepared_one_by_one(frames: Frames) -> None:
    shown = BoxEpisode(0).frames + BoxEpisode(1).frames
    for rows in ([0], [11, 2, 7, 2]):
        want = stack([prepare(shown[row].cloud, SMALL) for row in rows])
        assert same(frames.prepared(np.array(rows)), want)


def test_settled_frames_are_there_and_those_on_the_way_are_not(tmp_path: Path) -> None:
    kinds: tuple[FrameKind, ...] = ("rest", "way", "shape", "way", "way", "shape")
    box = BoxEpisode(0, kinds)
    frames = Frames.of(settled_frames(open_index(write_boxes(tmp_path, [box]))), SMALL)
    frames.tables.build()
    want = stack([prepare(box.frame(index).cloud, SMALL) for index in (0, 2, 5)])
    assert same(frames.prepared(np.arange(3)), want)


def test_centred_frames_are_about_the_rest_shape_of_their_episode(tmp_path: Path) -> None:
    config = replace(SMALL, coordinates="centred")
    frames = box_frames(tmp_path, [0, 1], config=config)
    rests = [centroid(BoxEpisode(seed).frame(0).cloud) for seed in (0, 1)]
    shapes = [
        prepare(BoxEpisode(seed).frame(4).cloud, config, centre=rests[seed]) for seed in (0, 1)
    ]
    assert same(frames.prepared(np.array([4, 10])), stack(shapes))


def test_a_network_of_fewer_points_takes_the_first_ones(tmp_path: Path) -> None:
    whole = box_frames(tmp_path, [0])
    fewer = replace(SMALL, points=140)
    few = Frames.of(whole.table, fewer)
    few.tables.build()
    want = [prepare(BoxEpisode(0).frame(index).cloud[:140], fewer) for index in (0, 3)]
    assert same(few.prepared(np.array([0, 3])), stack(want))


def test_clouds_in_another_order_have_no_first_points_to_take(tmp_path: Path) -> None:
    shuffled = [replace(one, cloud=one.cloud[::-1].copy()) for one in BoxEpisode(0).frames]
    rollout.write(tmp_path / "box.mcap", shuffled)
    frames = Frames.of(settled_frames(open_index(tmp_path)), replace(SMALL, points=140))
    with pytest.raises(BadEpisode, match=r"not in farthest-point order; train on all 160 points"):
        frames.tables.build()


def test_a_motion_is_the_grasp_of_the_goal_minus_that_of_the_current_frame(frames: Frames) -> None:
    box = BoxEpisode(1)
    (motion,) = frames.motions(np.array([7]), np.array([11]))
    np.testing.assert_allclose(motion, box.frame(5).grasp - box.frame(1).grasp, atol=1e-7)


def test_other_processes_see_the_same_frames(frames: Frames) -> None:
    rows = np.array([3, 8])
    want = frames.prepared(rows)
    content = pickle.dumps(frames)
    assert same(pickle.loads(content).prepared(rows), want)  # noqa: S301
    # Neither clouds nor tables travel.
    assert len(content) < 20_000


def test_a_file_that_has_changed_is_refused(tmp_path: Path) -> None:
    frames = box_frames(tmp_path, [0, 1])
    rollout.write(tmp_path / "new.mcap", BoxEpisode(5).frames)
    (tmp_path / "new.mcap").replace(tmp_path / "box-1.mcap")
    with pytest.raises(ChangedEpisode):
        Frames.of(frames.table, SMALL).prepared(np.array([7]))

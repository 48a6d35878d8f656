import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.nets.deformernet import prepare
from dnet.nets.neighbourhoods import stack
from dnet.training.augment import Augmentation, Placement, place, turn
from tests.training.deforming_box import SMALL, BoxEpisode

WIDE = Augmentation(yaw=np.pi, shift=0.05, mirror=True)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_a_placed_episode_is_the_episode_of_a_placed_object(seed: int) -> None:
    box = BoxEpisode(seed % 5)
    frames = [box.frame(1), box.frame(2)]
    placement = WIDE.draw(np.random.default_rng(seed), 1)
    turned, shift = placement.turns[0].numpy(), placement.shifts[0].numpy()
    groups = torch.tensor([0, 0])
    placed = place(
        stack([prepare(frame.cloud, SMALL) for frame in frames]),
        placement,
        groups=groups,
        coordinate_unit=SMALL.coordinate_unit,
    )
    for row, frame in enumerate(frames):
        again = prepare((frame.cloud @ turned.T + shift).astype(np.float32), SMALL)
        torch.testing.assert_close(placed.points[row], again.points, rtol=1e-5, atol=1e-5)
        for kept, found in zip(placed.inverse_densities, again.inverse_densities, strict=True):
            torch.testing.assert_close(kept[row], found, rtol=1e-4, atol=1e-5)
        for kept, found in zip(placed.neighbours, again.neighbours, strict=True):
            same = np.sort(kept[row].numpy(), axis=1) == np.sort(found.numpy(), axis=1)
            # Rounding may swap the last of two neighbours that are equally far.
            assert same.mean() > 0.99

    motion = torch.from_numpy((frames[1].grasp - frames[0].grasp).astype(np.float32))[None]
    grasps = [turned @ frame.grasp + shift for frame in frames]
    np.testing.assert_allclose(
        turn(motion, placement, groups=groups[:1])[0].numpy(), grasps[1] - grasps[0], atol=1e-6
    )


@given(seed=st.integers(0, 2**32 - 1), mirror=st.booleans())
def test_placements_keep_distances_and_the_vertical_and_stay_in_their_limits(
    seed: int, mirror: bool
) -> None:
    augmentation = Augmentation(yaw=0.4, shift=0.03, mirror=mirror)
    placement = augmentation.draw(np.random.default_rng(seed), 16)
    turns = placement.turns.double()
    torch.testing.assert_close(
        turns @ turns.transpose(1, 2), torch.eye(3).double().expand(16, 3, 3), rtol=0, atol=1e-6
    )
    up = torch.tensor([0.0, 0.0, 1.0]).double()
    assert torch.equal(turns @ up, up.expand(16, 3))
    assert float(turns[:, 0, 0].min()) >= np.cos(0.4) - 1e-6
    assert float(placement.shifts.abs().max()) <= 0.03 + 1e-9
    assert torch.equal(placement.shifts[:, 2], torch.zeros(16))
    if not mirror:
        assert float(torch.linalg.det(turns).min()) > 0.99


def test_a_quarter_turn_turns_points_and_motions_from_x_to_y() -> None:
    quarter = torch.tensor([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    placement, first = Placement(quarter, torch.zeros(1, 3)), torch.tensor([0])
    motion = torch.tensor([[0.02, 0.0, 0.01]])
    turned = turn(motion, placement, groups=first)
    torch.testing.assert_close(turned, torch.tensor([[0.0, 0.02, 0.01]]))
    clouds = stack([prepare(BoxEpisode(0).frame(0).cloud, SMALL)])
    placed = place(clouds, placement, groups=first, coordinate_unit=SMALL.coordinate_unit)
    torch.testing.assert_close(placed.points[..., 1], clouds.points[..., 0])


def test_mirroring_comes_up_about_every_second_time() -> None:
    turns = WIDE.draw(np.random.default_rng(0), 1000).turns
    mirrored = int((torch.linalg.det(turns) < 0).sum())
    assert 400 < mirrored < 600


def test_groups_are_placed_apart_and_frames_of_a_group_together() -> None:
    cloud = prepare(BoxEpisode(0).frame(0).cloud, SMALL)
    placement = WIDE.draw(np.random.default_rng(0), 2)
    placed = place(
        stack([cloud, cloud, cloud]),
        placement,
        groups=torch.tensor([0, 1, 0]),
        coordinate_unit=0.1,
    )
    assert torch.equal(placed.points[0], placed.points[2])
    assert not torch.allclose(placed.points[0], placed.points[1], atol=1e-2)


def test_the_same_seed_draws_the_same_placements() -> None:
    one, other = (WIDE.draw(np.random.default_rng(3), 5) for _ in range(2))
    assert torch.equal(one.turns, other.turns)
    assert torch.equal(one.shifts, other.shifts)

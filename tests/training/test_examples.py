from dataclasses import replace

import numpy as np
import pytest
import torch

from dnet.datasets.batch_order import Drawn
from dnet.errors import Uneven
from dnet.training.augment import Augmentation
from dnet.training.examples import Examples, Variation, stream_of
from dnet.training.frames import Frames
from dnet.training.parallel import Process
from dnet.training.settings import PairKind, TrainingSettings
from tests.training.deforming_box import SMALL, box_frames

SETTINGS = TrainingSettings(groups=2, frames=3, rest_share=0.0)
PLAIN = replace(SETTINGS, augmentation=None)
ALONE = Process()


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1, 2], samplings=2)


def batches(
    frames: Frames, settings: TrainingSettings = SETTINGS, *, workers: int = 0
) -> list[Examples]:
    return list(stream_of(frames, settings, process=ALONE, workers=workers))


def tensors(batch: Examples) -> list[torch.Tensor]:
    clouds = batch.clouds
    of_clouds = [clouds.points, clouds.centroids, *clouds.neighbours, *clouds.inverse_densities]
    return [*of_clouds, batch.current, batch.goal, batch.motions, batch.points]


def same(one: list[Examples], other: list[Examples]) -> bool:
    return len(one) == len(other) and all(
        torch.equal(a, b)
        for first, second in zip(one, other, strict=True)
        for a, b in zip(tensors(first), tensors(second), strict=True)
    )


def found(frames: Frames, cloud: torch.Tensor) -> int:
    """Which frame an unplaced cloud is of."""
    every = torch.from_numpy(frames.clouds.stack(np.arange(len(frames.table))))
    distances = (every - cloud * SMALL.coordinate_unit).abs().amax(dim=(1, 2))
    assert distances.min() < 1e-6
    return int(distances.argmin())


@pytest.mark.parametrize(("pairs", "count"), [("all", 36), ("any", 90), ("rest", 15)])
def test_a_pair_is_two_clouds_of_an_episode_and_the_motion_between(
    frames: Frames, pairs: PairKind, count: int
) -> None:
    seen = 0
    table = frames.table
    for batch in batches(frames, replace(PLAIN, pairs=pairs)):
        rows = [found(frames, cloud) for cloud in batch.clouds.points]
        for current, goal, motion in zip(
            batch.current.tolist(), batch.goal.tolist(), batch.motions.numpy(), strict=True
        ):
            here, there = rows[current], rows[goal]
            assert here != there
            assert table.file[here] == table.file[there]
            assert pairs != "rest" or table.rest[here]
            want = (table.grasps[there] - table.grasps[here]).astype(np.float32)
            np.testing.assert_array_equal(motion, want)
            seen += 1
    assert seen == count


def test_workers_do_not_change_the_batches(frames: Frames) -> None:
    assert same(batches(frames), batches(frames, workers=2))


def test_a_placed_group_is_turned_as_a_whole_and_its_motions_with_it(frames: Frames) -> None:
    wide = replace(SETTINGS, augmentation=Augmentation(yaw=3.0, shift=0.05))
    for plain, placed in zip(batches(frames, PLAIN), batches(frames, wide), strict=True):
        assert torch.equal(plain.current, placed.current)
        # Lengths stay, and so do distances between the clouds of a pair.
        torch.testing.assert_close(plain.motions.norm(dim=1), placed.motions.norm(dim=1))
        assert not torch.allclose(plain.motions, placed.motions, atol=1e-3)
        for batch in (plain, placed):
            assert batch.clouds.points.isfinite().all()
        apart = [
            (batch.clouds.points[batch.current] - batch.clouds.points[batch.goal]).norm(dim=2)
            for batch in (plain, placed)
        ]
        torch.testing.assert_close(apart[0], apart[1], rtol=1e-4, atol=1e-4)


def test_how_a_group_varies_depends_neither_on_its_batch_nor_on_its_process() -> None:
    variation = Variation(Augmentation(), seed=4)
    numbers, groups = np.array([7, 2, 9]), np.array([0, 0, 1, 1, 1, 2])
    together, choices = variation.draw(Drawn(3, numbers), groups, samplings=5)
    assert together is not None
    for place, number in enumerate(numbers):
        size = int((groups == place).sum())
        one, alone = variation.draw(
            Drawn(3, np.array([number])), np.zeros(size, np.int64), samplings=5
        )
        assert one is not None
        assert torch.equal(one.turns[0], together.turns[place])
        assert torch.equal(one.shifts[0], together.shifts[place])
        np.testing.assert_array_equal(choices[groups == place], alone)
    other, _ = variation.draw(Drawn(4, numbers), groups, samplings=5)
    assert other is not None
    assert not torch.equal(other.turns, together.turns)


def test_processes_share_the_batches_of_one(frames: Frames) -> None:
    alone = batches(frames)
    shares = [list(stream_of(frames, SETTINGS, process=Process(rank, 2))) for rank in range(2)]
    for whole, *parts in zip(alone, *shares, strict=True):
        points = torch.cat([part.clouds.points for part in parts])
        assert torch.equal(points, whole.clouds.points)
        assert torch.equal(torch.cat([part.motions for part in parts]), whole.motions)


def test_a_batch_that_cannot_be_shared_is_refused(frames: Frames) -> None:
    with pytest.raises(Uneven, match="a batch of 2 cannot be shared evenly by 3 processes"):
        stream_of(frames, SETTINGS, process=Process(0, 3))

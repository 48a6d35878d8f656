from pathlib import Path

import numpy as np
import pytest
import torch

from dnet.errors import BadCloud
from dnet.nets.deformernet import DeformerNetConfig
from dnet.nets.neighbourhoods import Neighbourhoods
from dnet.training.frames import read_frames
from dnet.training.neighbour_tables import KeptNeighbourhoods, find_each
from tests.training.deforming_box import SMALL, BoxEpisode

PATH = Path("box.mcap")


def tensors(one: Neighbourhoods) -> list[torch.Tensor]:
    return [one.points, one.centroids, *one.neighbours, *one.inverse_densities]


def test_kept_neighbourhoods_are_those_that_are_found(tmp_path: Path) -> None:
    kept = KeptNeighbourhoods(tmp_path, {PATH: "digest"})
    clouds = {index: BoxEpisode(0).frame(index).cloud for index in (0, 1, 4)}
    want = find_each(PATH, clouds, SMALL)
    for _ in range(2):
        for found, one in zip(kept(PATH, clouds, SMALL), want, strict=True):
            for got, other in zip(tensors(found), tensors(one), strict=True):
                assert got.dtype == other.dtype
                assert torch.equal(got, other)
    assert len(list(tmp_path.rglob("*.safetensors"))) == 1


def test_another_network_has_tables_of_its_own(tmp_path: Path) -> None:
    kept = KeptNeighbourhoods(tmp_path, {PATH: "digest"})
    clouds = {0: BoxEpisode(0, points=600).frame(0).cloud}
    for size in ("light", "paper"):
        config = DeformerNetConfig(size=size, points=600)
        (found,) = kept(PATH, clouds, config)
        (want,) = find_each(PATH, clouds, config)
        assert torch.equal(found.neighbours[0], want.neighbours[0])
    assert len(list(tmp_path.rglob("*.safetensors"))) == 2


def test_a_training_takes_what_is_kept(tmp_path: Path) -> None:
    box = BoxEpisode(0)
    kept = KeptNeighbourhoods(tmp_path, {box.path: "digest"})
    plain = read_frames([box], SMALL, samplings=2)
    for _ in range(2):
        frames = read_frames([box], SMALL, samplings=2, find=kept)
        for one, other in zip(frames.clouds, plain.clouds, strict=True):
            for first, second in zip(one, other, strict=True):
                for got, want in zip(tensors(first), tensors(second), strict=True):
                    assert torch.equal(got, want)


def test_a_spoilt_cloud_is_refused_and_nothing_is_kept(tmp_path: Path) -> None:
    cloud = BoxEpisode(0).frame(0).cloud.copy()
    cloud[3] = np.nan
    with pytest.raises(BadCloud, match=r"frame 0 of box\.mcap"):
        KeptNeighbourhoods(tmp_path, {PATH: "digest"})(PATH, {0: cloud}, SMALL)
    assert not list(tmp_path.rglob("*.safetensors"))

import json
import os
import pickle
import stat
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.torch import save_file

from dnet.errors import BadCheckpoint
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.nets.hu import HuNet, HuNetConfig
from dnet.nets.manipulation_point import DensePredictor, PointRegressor
from dnet.nets.neighbourhoods import Size
from dnet.nets.pointconv import Norm
from dnet.training.checkpoints import (
    begin_with,
    load,
    load_any,
    read_metrics,
    save,
    write_json,
)
from dnet.training.tasks import new_network
from tests.training.deforming_box import SMALL, BoxEpisode

SOUND = {
    "size": "light",
    "norm": "group",
    "points": SMALL.points,
    "coordinates": "scaled",
    "density": True,
    "motion_unit": 0.01,
}


@pytest.fixture(scope="module")
def model() -> DeformerNet:
    return new_network(SMALL, seed=0).eval()


@pytest.fixture(scope="module")
def saved(model: DeformerNet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "best.safetensors"
    save(path, model, metrics={"mse_mm2": 1.5})
    return path


def header(**other: object) -> dict[str, str]:
    return {"dnet": json.dumps({"network": "DeformerNet", "config": SOUND} | other)}


@pytest.mark.parametrize("norm", ["group", "batch"])
@pytest.mark.parametrize("size", ["light", "paper"])
def test_what_was_saved_is_what_is_loaded(tmp_path: Path, size: Size, norm: Norm) -> None:
    config = DeformerNetConfig(
        size=size, norm=norm, points=600, coordinates="world", motion_unit=0.02
    )
    model = new_network(config, seed=3)
    save(tmp_path / "deep" / "best.safetensors", model)
    for path in (tmp_path / "deep", tmp_path / "deep" / "best.safetensors"):
        loaded = load(path)
        assert loaded.config == config
        assert not loaded.training
        assert loaded.state_dict().keys() == model.state_dict().keys()
        for name, weights in loaded.state_dict().items():
            assert torch.equal(weights, model.state_dict()[name]), name


def test_a_loaded_network_predicts_the_same(saved: Path, model: DeformerNet) -> None:
    current, goal = (BoxEpisode(0).frame(index).cloud for index in (0, 1))
    np.testing.assert_array_equal(load(saved).predict(current, goal), model.predict(current, goal))


def test_metrics_come_back(saved: Path) -> None:
    assert read_metrics(saved) == read_metrics(saved.parent) == {"mse_mm2": 1.5}


def test_the_same_network_writes_the_same_bytes(
    saved: Path, model: DeformerNet, tmp_path: Path
) -> None:
    again = tmp_path / "again.safetensors"
    save(again, model, metrics={"mse_mm2": 1.5})
    assert again.read_bytes() == saved.read_bytes()


def test_a_checkpoint_is_readable_by_whom_the_umask_allows(saved: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.write_text("")
    assert stat.S_IMODE(saved.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


@given(share=st.floats(0, 1, exclude_max=True))
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_a_file_cut_off_anywhere_is_refused(saved: Path, tmp_path: Path, share: float) -> None:
    content = saved.read_bytes()
    cut = tmp_path / "cut.safetensors"
    cut.write_bytes(content[: int(share * len(content))])
    with pytest.raises(BadCheckpoint, match=r"cut\.safetensors is not a whole safetensors file"):
        load(cut)


class Trap:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.path),)


def test_a_pickle_is_refused_and_not_run(tmp_path: Path) -> None:
    sprung = tmp_path / "sprung"
    file = tmp_path / "trap.safetensors"
    file.write_bytes(pickle.dumps(Trap(sprung)))
    with pytest.raises(BadCheckpoint, match="not a whole safetensors file"):
        load(file)
    torch.save({"weights": Trap(sprung)}, file)
    with pytest.raises(BadCheckpoint, match="not a whole safetensors file"):
        load(file)
    assert not sprung.exists()


def test_a_missing_file_and_an_empty_directory_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadCheckpoint, match=r"none\.safetensors does not exist; give a run"):
        load(tmp_path / "none.safetensors")
    with pytest.raises(BadCheckpoint, match=r"best\.safetensors does not exist"):
        load(tmp_path)


def test_another_network_is_refused(tmp_path: Path, model: DeformerNet) -> None:
    file = tmp_path / "other.safetensors"
    save_file(model.state_dict(), file, metadata=header(network="NextNet"))
    with pytest.raises(BadCheckpoint, match="holds NextNet, not one of DeformerNet, "):
        load(file)
    save_file(model.state_dict(), file)
    with pytest.raises(BadCheckpoint, match="holds an unnamed network, not one of"):
        load(file)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"head.output.bias": None}, "lacks the weights head.output.bias"),
        ({"spare": torch.zeros(1)}, "has unknown weights spare"),
        ({"head.output.bias": torch.zeros(4)}, r"head.output.bias of shape \(4,\), not \(3,\)"),
        ({"head.output.bias": torch.full((3,), torch.nan)}, "head.output.bias that are not numb"),
    ],
)
def test_weights_that_do_not_fit_are_named(
    tmp_path: Path, model: DeformerNet, change: dict[str, torch.Tensor | None], complaint: str
) -> None:
    weights = {**model.state_dict(), **change}
    file = tmp_path / "changed.safetensors"
    kept = {name: tensor for name, tensor in weights.items() if tensor is not None}
    save_file(kept, file, metadata=header())
    with pytest.raises(BadCheckpoint, match=complaint):
        load(file)


@pytest.mark.parametrize(
    "config",
    [
        None,
        [],
        {},
        {"size": "light"},
        SOUND | {"points": "many"},
        SOUND | {"points": 3},
        SOUND | {"points": float("inf")},
        SOUND | {"size": "huge"},
        SOUND | {"size": []},
        SOUND | {"norm": "?"},
    ],
)
def test_a_config_that_makes_no_network_is_refused(
    tmp_path: Path, model: DeformerNet, config: object
) -> None:
    file = tmp_path / "odd.safetensors"
    save_file(model.state_dict(), file, metadata=header(config=config))
    with pytest.raises(BadCheckpoint, match=r"odd\.safetensors"):
        load(file)


def test_a_save_that_fails_leaves_the_old_file_and_nothing_beside_it(
    tmp_path: Path, model: DeformerNet
) -> None:
    file = tmp_path / "best.safetensors"
    save(file, model, metrics={"epoch": 1})
    before = file.read_bytes()
    with pytest.raises(TypeError):
        save(file, model, metrics={"epoch": object()})
    file.rename(tmp_path / "kept")
    file.mkdir()
    with pytest.raises(OSError, match="directory"):
        save(file, model)
    assert (tmp_path / "kept").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["best.safetensors", "kept"]


@pytest.mark.parametrize("text", ["", "{", "[]", "[" * 100_000])
def test_a_header_that_is_no_header_is_refused(
    tmp_path: Path, model: DeformerNet, text: str
) -> None:
    file = tmp_path / "odd.safetensors"
    save_file(model.state_dict(), file, metadata={"dnet": text})
    with pytest.raises(BadCheckpoint, match=r"odd\.safetensors (has|holds) an un"):
        load(file)


@given(content=st.dictionaries(st.text(), st.integers() | st.text() | st.none()))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_json_that_was_written_reads_back(tmp_path: Path, content: dict[str, Any]) -> None:
    write_json(tmp_path / "a" / "config.json", content)
    assert json.loads((tmp_path / "a" / "config.json").read_text(encoding="utf-8")) == content
    assert len(list((tmp_path / "a").iterdir())) == 1


def test_a_training_begins_with_the_weights_of_a_network_like_it(
    model: DeformerNet, saved: Path
) -> None:
    for points in (SMALL.points, 2 * SMALL.points):
        other = new_network(replace(SMALL, points=points), seed=1)
        begin_with(other, saved.parent)
        for name, weights in other.state_dict().items():
            assert torch.equal(weights, model.state_dict()[name])
    unlike = new_network(replace(SMALL, norm="batch"), seed=1)
    with pytest.raises(BadCheckpoint, match="with norm group, not batch; give the options"):
        begin_with(unlike, saved)


def test_networks_that_choose_where_to_grasp_begin_with_what_a_deformernet_knows(
    model: DeformerNet, saved: Path, tmp_path: Path
) -> None:
    more = replace(SMALL, points=200)
    regressor, dense = PointRegressor(more), DensePredictor(more)
    for network, part in ((regressor, regressor.encoder), (dense, dense.guide)):
        begin_with(network, saved)
        known = (model.encoder if part is regressor.encoder else model).state_dict()
        assert all(torch.equal(known[name], value) for name, value in part.state_dict().items())
    save(tmp_path / "dense.safetensors", dense)
    again = DensePredictor(more)
    begin_with(again, tmp_path / "dense.safetensors")
    assert all(
        torch.equal(dense.state_dict()[name], value) for name, value in again.state_dict().items()
    )
    with pytest.raises(BadCheckpoint, match="holds DensePredictor, not PointRegressor or Deform"):
        begin_with(regressor, tmp_path / "dense.safetensors")


def test_a_network_of_hu_keeps_its_components_and_begins_with_nothing_else(
    saved: Path, tmp_path: Path
) -> None:
    network = HuNet(HuNetConfig(points=160, components=5, relu=False, eye=(0.1, -0.2, 0.3)))
    network.fit(
        np.random.default_rng(0).normal(size=(40, 135)).astype(np.float32), np.arange(40) // 8
    )
    file = tmp_path / "best.safetensors"
    save(file, network)
    loaded = load_any(tmp_path)
    assert isinstance(loaded, HuNet)
    assert loaded.config == network.config
    assert torch.equal(loaded.basis, network.basis)
    again = HuNet(network.config)
    begin_with(again, file)
    assert torch.equal(again.basis, network.basis)
    with pytest.raises(BadCheckpoint, match="holds DeformerNet, not HuNet;"):
        begin_with(again, saved)
    with pytest.raises(BadCheckpoint, match="holds HuNet, not DeformerNet"):
        load(file)
    header = {"dnet": json.dumps({"network": "HuNet", "config": {"points": 160}})}
    save_file(network.state_dict(), file, metadata=header)
    with pytest.raises(BadCheckpoint, match="unreadable config"):
        load_any(file)

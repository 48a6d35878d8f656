"""An ONNX file is written if it is the network, and read if it is one of ours."""

import sys
from pathlib import Path

import numpy as np
import onnx
import pytest
from jaxtyping import Float
from onnx import TensorProto, helper
from torch import Tensor

import dnet
from dnet.errors import BadCheckpoint, Disagreement, MissingExtra
from dnet.nets.deformernet import DeformerNet
from dnet.nets.onnx_agreement import Agreement
from dnet.nets.onnx_network import OnnxDeformerNet
from dnet.training.onnx_files import check, export, load
from tests.nets.test_deformernet import clouds
from tests.nets.test_onnx_network import MODEL


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("onnx") / "a.onnx"
    export(MODEL, path, metrics={"epoch": 3})
    return path


def test_a_file_is_loaded_as_the_network_that_it_is(file: Path) -> None:
    network = dnet.load(file)
    assert isinstance(network, OnnxDeformerNet)
    assert network.config == MODEL.config
    current, goal = clouds(2)
    want = MODEL.predict(current, goal)
    np.testing.assert_allclose(network.predict(current, goal), want, atol=1e-5 * np.abs(want).max())
    assert '"epoch": 3' in onnx.load(file).metadata_props[0].value


def test_the_same_network_gives_the_same_bytes(file: Path, tmp_path: Path) -> None:
    again = tmp_path / "deep" / "b.onnx"
    export(MODEL.train(), again, metrics={"epoch": 3})
    assert MODEL.training
    MODEL.eval()
    assert again.read_bytes() == file.read_bytes()
    assert list(again.parent.iterdir()) == [again]


class Crooked(DeformerNet):
    """Another function than its layers are."""

    def motion(
        self, current: Float[Tensor, "p 256"], goal: Float[Tensor, "p 256"]
    ) -> Float[Tensor, "p 3"]:
        return super().motion(current, goal) * 1.001


def test_what_is_not_the_network_is_not_written(tmp_path: Path) -> None:
    crooked = Crooked(MODEL.config)
    crooked.load_state_dict(MODEL.state_dict())
    with pytest.raises(Disagreement, match=r"differs from the original by 1.0e-03.* 1e-05"):
        export(crooked, tmp_path / "a.onnx")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("bad", [np.nan, 1.1e-5])
def test_what_is_no_number_or_beyond_the_limit_is_refused(bad: float) -> None:
    check(Path("a.onnx"), Agreement(1e-5, 0.0, 1))
    with pytest.raises(Disagreement, match=r"a\.onnx was not written"):
        check(Path("a.onnx"), Agreement(0.0, bad, 1))


def another_graph() -> bytes:
    x, y = (helper.make_tensor_value_info(name, TensorProto.FLOAT, [1]) for name in "xy")
    graph = helper.make_graph([helper.make_node("Relu", ["x"], ["y"])], "other", [x], [y])
    opset = [helper.make_opsetid("", 18)]
    return helper.make_model(graph, ir_version=9, opset_imports=opset).SerializeToString()


def test_what_holds_no_network_of_ours_is_refused(file: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.onnx"
    with pytest.raises(BadCheckpoint, match=r"x\.onnx does not exist; give a file that"):
        load(path)
    for content in (b"", b"Dear diary", file.read_bytes()[:1000]):
        path.write_bytes(content)
        with pytest.raises(BadCheckpoint, match=r"x\.onnx (is not a whole ONNX|holds another)"):
            load(path)
    path.write_bytes(another_graph())
    with pytest.raises(BadCheckpoint, match="holds another network than DeformerNet"):
        load(path)


@pytest.mark.parametrize(
    ("before", "after", "why"),
    [
        (b'"network": "DeformerNet"', b'"network": "DenseForest"', "holds another network"),
        (b'{"network": "DeformerNet"', b'<"network": "DeformerNet"', "an unreadable header"),
        (b'"points": 192', b'"points": "x2', "an unreadable header"),
        (b'"size": "light"', b'"size": "heavy"', "an unreadable config"),
    ],
)
def test_a_header_that_says_something_else_is_refused(
    file: Path, tmp_path: Path, before: bytes, after: bytes, why: str
) -> None:
    content = file.read_bytes()
    assert content.count(before) == 1
    path = tmp_path / "x.onnx"
    path.write_bytes(content.replace(before, after))
    with pytest.raises(BadCheckpoint, match=why):
        load(path)


@pytest.mark.parametrize("package", ["onnx", "onnxruntime"])
def test_who_lacks_a_package_is_told_what_to_install(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("onnx_graph", "onnx_builder"):
        monkeypatch.delitem(sys.modules, f"dnet.nets.{module}")
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtra, match=rf"needs {package},.*deformernet\[onnx\]"):
        export(MODEL, tmp_path / "a.onnx")
    assert not list(tmp_path.iterdir())


def test_reading_needs_onnxruntime_alone(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    load(file)
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingExtra, match=r"an ONNX network needs onnxruntime"):
        load(file)

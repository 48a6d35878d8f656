"""The ONNX graph is the network, for clouds in batches of any length."""

from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch

from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.nets.neighbourhoods import Size
from dnet.nets.onnx_agreement import LIMIT
from dnet.nets.onnx_graph import as_graph
from dnet.nets.onnx_network import GOAL, TABLES, OnnxDeformerNet, open_session
from dnet.nets.pointconv import Norm
from tests.nets.test_deformernet import NORMS, batch, clouds, network


def judged(model: DeformerNet) -> DeformerNet:
    """Return the network with running figures of its own, ready to predict."""
    seen = batch(clouds(4, model.config.points), model)
    model.train()(seen, seen.take(torch.tensor([1, 2, 3, 0])))
    return model.eval()


def made(size: Size = "light", norm: Norm = "group", *, density: bool = True) -> DeformerNet:
    model = network(size, norm, 192 if size == "light" else 520)
    if not density:
        bare = DeformerNet(replace(model.config, density=False))
        bare.load_state_dict({k: v for k, v in model.state_dict().items() if "density" not in k})
        model = bare
    return judged(model)


@pytest.mark.parametrize(
    ("size", "norm", "density"),
    [
        ("light", "group", True),
        ("light", "group", False),
        ("light", "batch", True),
        ("light", "batch", False),
        ("paper", "group", True),
    ],
)
def test_the_graph_is_the_network_in_batches_of_any_length(
    size: Size, norm: Norm, density: bool
) -> None:
    model = made(size, norm, density=density)
    graph = as_graph(model, metadata={})
    onnx.checker.check_model(graph, full_check=True)
    exported = OnnxDeformerNet(open_session(graph.SerializeToString()), model.config)
    seen = batch(clouds(3, model.config.points, seed=5), model)
    for rows in ([0, 1, 2], [1]):
        some = seen.take(torch.tensor(rows))
        with torch.no_grad():
            features = model.encode(some)
            goals = model.encode(seen.take(torch.tensor([2, 0, 1])[rows]))
            motion = model.motion(features, goals)
        got_features, got_motion = exported.run(some, goals.numpy())
        for got, want in ((got_features, features.numpy()), (got_motion, motion.numpy())):
            np.testing.assert_allclose(got, want, rtol=0, atol=LIMIT * np.abs(want).max())


@pytest.mark.parametrize("norm", NORMS)
def test_its_inputs_are_tables_of_clouds_and_features_of_goals(norm: Norm) -> None:
    graph = as_graph(DeformerNet(DeformerNetConfig(norm=norm)), metadata={"a": "b"})
    shapes = {
        one.name: [axis.dim_param or axis.dim_value for axis in one.type.tensor_type.shape.dim]
        for one in graph.graph.input
    }
    assert list(shapes) == [*TABLES, GOAL]
    assert shapes["points"] == ["batch", 2048, 3]
    assert shapes["neighbours_2"] == ["batch", 32, 32]
    assert shapes[GOAL] == ["batch", 256]
    assert [(one.key, one.value) for one in graph.metadata_props] == [("a", "b")]

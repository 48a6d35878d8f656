"""DeformerNet as an ONNX graph, so that it runs wherever there is a runtime for ONNX.

One graph holds both halves: it takes a batch of clouds with what depends on their coordinates
alone (`Neighbourhoods`) and, of each, the features of a goal; it gives the features of each cloud
and its motion to that goal in metres. A servo loop encodes one cloud a step, and the goal only
once: its features come from a run in which its own goal is zeros. So one file does what two
would, an encoder and a head, and no two can be mismatched.

The graph is written here operator by operator, as the steps of `dnet.nets.pointconv`. Tracing
those takes minutes and a compiler's worth of packages; that this is the same function is proven
for every file before it gets its name (`dnet.nets.onnx_agreement`).
"""

import numpy as np
from onnx import ModelProto, TensorProto, ValueInfoProto, helper
from torch import nn

from dnet.nets.deformernet import DeformerNet, Encoder
from dnet.nets.neighbourhoods import GROUPINGS
from dnet.nets.onnx_builder import Graph
from dnet.nets.onnx_network import FEATURES, GOAL, MOTION, TABLES
from dnet.nets.pointconv import PointwiseLayer, SetAbstraction

_OPSET, _IR = 18, 9
"""Of 2022 and 2023: what reads ONNX today reads these."""


def as_graph(model: DeformerNet, *, metadata: dict[str, str]) -> ModelProto:
    """Return the network, as it predicts, as an ONNX model for batches of any length.

    Args:
        model: Of either norm; the running figures of BatchNorm become constants.
        metadata: What the model shall say of itself.
    """
    graph = Graph()
    features = _encoder(graph, model)
    graph.call(features, FEATURES)
    motion = _head(graph, model, graph.add("Sub", GOAL, FEATURES))
    graph.call(motion, MOTION)
    whole = helper.make_model(
        helper.make_graph(graph.nodes, "DeformerNet", _inputs(model), _outputs(), graph.constants),
        producer_name="dnet",
        ir_version=_IR,
        opset_imports=[helper.make_opsetid("", _OPSET)],
    )
    helper.set_model_props(whole, metadata)
    return whole


def _inputs(model: DeformerNet) -> list[ValueInfoProto]:
    first, second = GROUPINGS[model.config.size]
    points = model.config.points
    shapes: tuple[tuple[int, ...], ...] = (
        (points, 3),
        (first.centroids,),
        (first.centroids, first.neighbours),
        (second.centroids, second.neighbours),
        (points,),
        (first.centroids,),
        (second.centroids,),
    )
    tables = [
        _value(name, *shape, kind=TensorProto.INT64 if name in TABLES[1:4] else TensorProto.FLOAT)
        for name, shape in zip(TABLES, shapes, strict=True)
    ]
    return [*tables, _value(GOAL, Encoder.features)]


def _outputs() -> list[ValueInfoProto]:
    return [_value(FEATURES, Encoder.features), _value(MOTION, 3)]


def _value(name: str, *shape: int, kind: int = TensorProto.FLOAT) -> ValueInfoProto:
    return helper.make_tensor_value_info(name, kind, ["batch", *shape])


def _encoder(graph: Graph, model: DeformerNet) -> str:
    points, centroids, *neighbours = TABLES[:4]
    densities = TABLES[4:]
    encoder = model.encoder
    first, second = GROUPINGS[model.config.size]
    middle = _gather(graph, points, centroids)
    features = _level(
        graph,
        encoder.first,
        (points, points),
        centroids=middle,
        neighbours=neighbours[0],
        density=densities[0],
        counts=(first.centroids, first.neighbours),
    )
    begin, end, axis = (graph.constant([number]) for number in (0, second.centroids, 1))
    above = graph.add("Slice", middle, begin, end, axis)
    features = _level(
        graph,
        encoder.second,
        (middle, features),
        centroids=above,
        neighbours=neighbours[1],
        density=densities[1],
        counts=(second.centroids, second.neighbours),
    )
    whole = _level(
        graph,
        encoder.third,
        (above, features),
        centroids=graph.mean(above, [1]),
        neighbours=None,
        density=densities[2],
        counts=(1, second.centroids),
    )
    return graph.reshape(whole, Encoder.features)


def _head(graph: Graph, model: DeformerNet, difference: str) -> str:
    hidden = difference
    layers = list(model.head.hidden)
    for linear, norm in zip(layers[::3], layers[1::3], strict=True):
        assert isinstance(linear, nn.Linear)  # noqa: S101
        hidden = graph.linear(hidden, linear.weight, linear.bias)
        hidden = graph.norm_and_relu(hidden, norm, axes=(1,))
    output = graph.linear(hidden, model.head.output.weight, model.head.output.bias)
    unit = graph.constant(np.array([model.config.motion_unit], np.float32))
    return graph.add("Mul", output, unit)


def _gather(graph: Graph, values: str, rows: str) -> str:
    return graph.add("GatherND", values, graph.unsqueeze(rows, -1), batch_dims=1)


def _level(
    graph: Graph,
    level: SetAbstraction,
    below: tuple[str, str],
    *,
    centroids: str,
    neighbours: str | None,
    density: str,
    counts: tuple[int, int],
) -> str:
    """Write `SetAbstraction`; `counts` are the groups and the members of each."""
    points, features = below
    groups, size = counts
    linear = level.point_linear
    known = graph.add("Concat", points, features, axis=-1)
    hidden = graph.linear(known, linear.weight, linear.bias)

    def gathered(values: str) -> str:
        if neighbours is None:
            return graph.unsqueeze(values, 1)
        return _gather(graph, values, neighbours)

    # As step by step: the first layer saw absolute coordinates, the centroid's part comes off.
    part = graph.add("MatMul", centroids, graph.constant(linear.weight[:, :3].t()))
    hidden = graph.add("Sub", gathered(hidden), graph.unsqueeze(part, 2))
    hidden = graph.norm_and_relu(hidden, level.point_norm, axes=(3, 2, 1))

    offsets = graph.add("Sub", gathered(points), graph.unsqueeze(centroids, 2))
    offsets = graph.add("Transpose", graph.reshape(offsets, groups * size, 3), perm=[0, 2, 1])
    weights = _small_net(graph, level.weight_net, offsets)
    if level.density_net is not None:
        scale = gathered(density)
        largest = graph.add("ReduceMax", scale, graph.constant([2]), keepdims=1)
        scale = graph.reshape(graph.add("Div", scale, largest), 1, groups * size)
        weights = graph.add("Mul", weights, _small_net(graph, level.density_net, scale))

    wide = level.weights_per_channel
    weights = graph.reshape(weights, wide, groups, size)
    weights = graph.add("Transpose", weights, perm=[0, 2, 1, 3])
    # Weights before channels, which spares turning the group; the last layer's columns follow.
    summed = graph.reshape(graph.add("MatMul", weights, hidden), groups, -1)
    last = level.output_linear
    turned = last.weight.view(len(last.weight), -1, wide).transpose(1, 2).flatten(1)
    out = graph.linear(summed, turned, last.bias)
    return graph.norm_and_relu(out, level.output_norm, axes=(2, 1))


def _small_net(graph: Graph, net: nn.Sequential, value: str) -> str:
    """Write WeightNet or DensityNet on (batch, channels, rows)."""
    for layer in net:
        assert isinstance(layer, PointwiseLayer)  # noqa: S101
        value = graph.add("MatMul", graph.constant(layer.linear.weight), value)
        value = graph.add("Add", value, graph.constant(layer.linear.bias[:, None]))
        value = graph.norm_and_relu(value, layer.norm, axes=(2, 1), channels_last=False)
    return value

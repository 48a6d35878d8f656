"""An ONNX graph that grows by an operator at a time, with the layers of DeformerNet among them."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from onnx import NodeProto, TensorProto, helper, numpy_helper
from torch import Tensor, nn

from dnet.nets.pointconv import BatchNorm, GroupNorm


class Graph:
    """A graph that grows by an operator at a time."""

    def __init__(self) -> None:
        self.nodes: list[NodeProto] = []
        self.constants: list[TensorProto] = []

    def add(self, operator: str, *inputs: str, **attributes: Any) -> str:
        """Apply an operator and return the name of its output."""
        output = f"{operator}_{len(self.nodes)}"
        self.nodes.append(
            helper.make_node(operator, list(inputs), [output], name=output, **attributes)
        )
        return output

    def constant(self, numbers: Tensor | np.ndarray | list[int]) -> str:
        """Hold numbers and return their name."""
        array = numbers.detach().cpu().numpy() if isinstance(numbers, Tensor) else numbers
        array = np.ascontiguousarray(array)
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(array, name))
        return name

    def call(self, output: str, name: str) -> None:
        """Call the output of the last operator otherwise."""
        last = self.nodes[-1]
        assert last.output[0] == output  # noqa: S101
        last.output[0] = name

    def reshape(self, value: str, *shape: int) -> str:
        """Give the axes after the batch another shape."""
        return self.add("Reshape", value, self.constant([0, *shape]))

    def unsqueeze(self, value: str, axis: int) -> str:
        """Add an axis of length 1."""
        return self.add("Unsqueeze", value, self.constant([axis]))

    def mean(self, value: str, axes: Iterable[int]) -> str:
        """Take the mean over axes, one after the other: sums of fewer numbers round less."""
        for axis in axes:
            value = self.add("ReduceMean", value, self.constant([axis]), keepdims=1)
        return value

    def linear(self, value: str, weight: Tensor, bias: Tensor) -> str:
        """Apply a linear layer to the last axis."""
        product = self.add("MatMul", value, self.constant(weight.t()))
        return self.add("Add", product, self.constant(bias))

    def norm_and_relu(
        self, value: str, norm: nn.Module, *, axes: tuple[int, ...], channels_last: bool = True
    ) -> str:
        """Normalise, of GroupNorm over all `axes`, and apply ReLU."""
        assert isinstance(norm, GroupNorm | BatchNorm)  # noqa: S101

        def of_channels(numbers: Tensor) -> str:
            return self.constant(numbers if channels_last else numbers[:, None])

        if isinstance(norm, BatchNorm):
            centred = self.add("Sub", value, of_channels(norm.mean))
            scale = norm.weight.double() / (norm.variance.double() + norm.epsilon).sqrt()
            scaled = self.add("Mul", centred, of_channels(scale.float()))
        else:
            centred = self.add("Sub", value, self.mean(value, axes))
            variance = self.mean(self.add("Mul", centred, centred), axes)
            epsilon = self.constant(np.array([norm.epsilon], np.float32))
            deviation = self.add("Sqrt", self.add("Add", variance, epsilon))
            scale_of_each = self.add("Div", of_channels(norm.weight), deviation)
            scaled = self.add("Mul", centred, scale_of_each)
        return self.add("Relu", self.add("Add", scaled, of_channels(norm.bias)))

"""Whether networks can be asked and trained, on a GPU too, and whether they go to other formats."""

import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import torch

from dnet.nets.deformernet import DeformerNet, DeformerNetConfig, prepare
from dnet.nets.fused import step_by_step
from dnet.nets.neighbourhoods import stack
from dnet.types import Cloud


def _cloud(points: int, *, raised: float = 0.0) -> Cloud:
    """Return points on a box of the usual size, its right half raised by so many metres."""
    rng = np.random.default_rng(0)
    cloud = rng.uniform([-0.05, -0.05, 0.0], [0.05, 0.05, 0.04], (points, 3)).astype(np.float32)
    cloud[:, 2] += np.float32(raised) * (cloud[:, 0] > 0)
    return cloud


def predict() -> str:
    """Ask the network that ships, step by step: nothing is compiled for it."""
    with step_by_step():
        return _predicted("")


def predict_fused() -> str:
    """Ask it through the kernels, which are compiled the first time."""
    clock = perf_counter()
    return _predicted("") + f", kernels ready in {perf_counter() - clock:.1f} s"


def _predicted(what: str) -> str:
    import dnet  # noqa: PLC0415

    network = dnet.load()
    motion = network.predict(_cloud(2048), _cloud(2048, raised=0.02))
    if not np.isfinite(motion).all() or not 0.0 < motion[2] < 0.1:
        raise RuntimeError(f"the network that ships predicts {motion.tolist()} m for 20 mm up")
    return f"the network that ships answers {1e3 * motion[2]:.0f} mm up{what}"


def train() -> str:
    """Let a small network learn from one pair, by steps of one size down the slope.

    torch's optimizers import its compiler first, which takes seconds.
    """

    def descend(weights: list[torch.nn.Parameter]) -> None:
        with torch.no_grad():
            for weight in weights:
                if weight.grad is not None:
                    weight.sub_(1e-3 * weight.grad.sign())

    return _trained(lambda weights: lambda: descend(weights))


def train_by_optimizer() -> str:
    """Let it learn as a training does, by an optimizer of torch."""
    return _trained(lambda weights: torch.optim.Adam(weights, lr=1e-3).step)


def _trained(descent: Callable[[list[torch.nn.Parameter]], Callable[[], object]]) -> str:
    """Let a small network learn from one pair for some steps, on the processor."""
    torch.manual_seed(0)
    network = DeformerNet(DeformerNetConfig(points=128))
    pair = [prepare(_cloud(128, raised=raised), network.config) for raised in (0.0, 0.02)]
    here, there = (stack([cloud]) for cloud in pair)
    truth = torch.tensor([[0.0, 0.0, 0.02]])
    descend = descent(list(network.parameters()))
    losses = []
    with step_by_step():
        for _ in range(3):
            loss = 1e6 * (network(here, there) - truth).square().mean()
            network.zero_grad()
            loss.backward()
            descend()
            losses.append(float(loss.detach()))
    if not losses[-1] < losses[0]:
        raise RuntimeError(f"a network that learns from one pair has losses {losses}")
    return f"3 steps, the loss fell from {losses[0]:.0f} to {losses[-1]:.0f} mm²"


def multiply() -> str:
    """Multiply matrices on a GPU."""
    if not torch.cuda.is_available():
        raise RuntimeError("no GPU that torch can use; the processor does")
    left = torch.arange(256.0 * 256.0, device="cuda").reshape(256, 256) / 65536
    off = float((left @ left - (left.cpu() @ left.cpu()).cuda()).abs().max())
    if off > 0.1:
        raise RuntimeError(f"a matrix product on the GPU is off by {off}")
    free, total = torch.cuda.mem_get_info()
    name = torch.cuda.get_device_name()
    return f"{name}, {free / 2**30:.0f} of {total / 2**30:.0f} GiB free, CUDA {torch.version.cuda}"


def run_onnx() -> str:
    """Write a sum as ONNX and let ONNX Runtime compute it."""
    onnxruntime: Any = import_module("onnxruntime")
    from onnx import TensorProto, helper  # noqa: PLC0415

    values = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [3]) for name in "abc"]
    node = helper.make_node("Add", ["a", "b"], ["c"])
    graph = helper.make_graph([node], "sum", values[:2], values[2:])
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9
    ).SerializeToString()
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    ones = np.ones(3, np.float32)
    (found,) = session.run(None, {"a": ones, "b": ones})
    if not np.array_equal(found, 2 * ones):
        raise RuntimeError(f"ONNX Runtime adds 1 and 1 to {found}")
    return f"ONNX Runtime {onnxruntime.__version__} computed a graph"


def write_board() -> str:
    """Write a curve for TensorBoard."""
    from torch.utils.tensorboard import SummaryWriter  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        with SummaryWriter(folder) as board:
            board.add_scalar("loss", 1.0, 0)
        size = sum(path.stat().st_size for path in Path(folder).iterdir())
    return f"a curve of {size} bytes written"

"""How fast DeformerNet is, next to the same network written plainly from its equations.

    python -m tests.benchmarks.nets
    python -m tests.benchmarks.nets --size light --threads 1

The reference samples centroids, finds neighbours and densities, and builds every group anew at
each call, as public implementations of PointConv do; training of our own finds them once. Each
formulation runs in a process of its own, so that its memory is its own too. Times are processor
time on one thread, and the clock on several.
"""

import multiprocessing
import resource
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Literal

import numpy as np
import torch
import tyro
from rich.console import Console
from rich.table import Table
from torch import Tensor

from dnet.geometry.sampling import farthest_points
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig, prepare
from dnet.nets.fused import step_by_step
from dnet.nets.neighbourhoods import Size, stack
from dnet.training.allocation import kept_pages
from dnet.training.tasks import new_network
from dnet.types import Cloud
from tests.nets import reference

Formulation = Literal["reference", "step by step", "fused"]
FORMULATIONS: tuple[Formulation, ...] = ("reference", "step by step", "fused")
BATCH = 16
GROUPS, FRAMES = 4, 8
"""Of a batch of all pairs: as many encodings as `BATCH` pairs have."""
REPEATS = 5


@dataclass(frozen=True, slots=True)
class Measured:
    """Milliseconds and megabytes."""

    forward: float
    """Of a pair, in a batch."""
    both: float
    """Forward and backward."""
    memory: float
    """Megabytes that a step with its gradients takes at most."""
    alone: float
    """Of one pair by itself, forward."""
    predict: float
    """From a cloud that was just seen to a motion, the goal being known."""
    all_pairs: float
    """Forward and backward, a pair of a batch of all pairs."""


@dataclass(frozen=True)
class Benchmark:
    """Measure forward and backward of DeformerNet."""

    size: Size = "paper"
    """Levels of the encoder."""
    threads: tuple[int, ...] = (1, 2)
    """How many to measure with, one table each."""

    def run(self) -> None:
        """Measure and print."""
        console = Console(width=120)
        context = multiprocessing.get_context("spawn")
        for threads in self.threads:
            found: dict[Formulation, Measured] = {}
            for formulation in FORMULATIONS:
                with ProcessPoolExecutor(1, mp_context=context) as pool:
                    task = pool.submit(measure, formulation, self.size, threads)
                    found[formulation] = task.result()
            console.print(_table(found, f"{self.size} size, 2048 points, {threads} threads"))


def measure(formulation: Formulation, size: Size, threads: int) -> Measured:
    """Return the figures of one formulation, measured in this process."""
    torch.set_num_threads(threads)
    clock = process_time if threads == 1 else perf_counter
    with kept_pages(), step_by_step() if formulation == "step by step" else nullcontext():
        return _measure(formulation, size, clock)


def _measure(formulation: Formulation, size: Size, clock: Callable[[], float]) -> Measured:
    model = new_network(DeformerNetConfig(size=size), seed=0)
    clouds = [_cloud(seed) for seed in range(2 * BATCH)]
    points = torch.from_numpy(np.stack(clouds)) / model.config.coordinate_unit
    found = [prepare(cloud, model.config) for cloud in clouds]
    tables, few = stack(found), stack(found[:2])

    def encode(count: int) -> Tensor:
        if formulation == "reference":
            return reference.encode(model, reference.sampled(points[:count], size))
        return model.encode(tables if count == len(clouds) else few)

    def pairs() -> Tensor:
        features = encode(2 * BATCH)
        return model.motion(features[:BATCH], features[BATCH:])

    def every_pair() -> Tensor:
        features = encode(2 * BATCH)
        groups = torch.arange(2 * BATCH) // FRAMES
        same = (groups[:, None] == groups) & ~torch.eye(2 * BATCH, dtype=torch.bool)
        current, goal = same.nonzero().T
        return model.motion(features[current], features[goal])

    def learn(motions: Callable[[], Tensor]) -> None:
        model.zero_grad()
        torch.autograd.backward(motions().square().sum())

    def predict(model: DeformerNet) -> None:
        if formulation == "reference":
            alone()
        else:
            model.predict(clouds[0], clouds[1])

    @torch.no_grad()
    def forward() -> None:
        pairs()

    @torch.no_grad()
    def alone() -> None:
        features = encode(2)
        model.motion(features[:1], features[1:])

    before = _peak()
    one = _best(alone, clock)
    predicted = _best(lambda: predict(model), clock)
    forwards = _best(forward, clock)
    both = _best(lambda: learn(pairs), clock)
    memory = _peak() - before
    every = _best(lambda: learn(every_pair), clock)
    return Measured(
        forwards / BATCH,
        both / BATCH,
        memory,
        one,
        predicted,
        every / (GROUPS * FRAMES * (FRAMES - 1)),
    )


def _best(step: Callable[[], object], clock: Callable[[], float]) -> float:
    """Return milliseconds of the fastest of some calls, after one to warm up."""
    step()
    times = []
    for _ in range(REPEATS):
        begin = clock()
        step()
        times.append(clock() - begin)
    return 1000 * min(times)


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _cloud(seed: int) -> Cloud:
    """A sheared box of the lab's size, seen from all sides."""
    rng = np.random.default_rng(seed)
    box = rng.uniform([-0.05, -0.05, 0], [0.05, 0.05, 0.04], (4096, 3))
    bent = box @ (np.eye(3) + rng.uniform(-0.3, 0.3, (3, 3)))
    return farthest_points(bent.astype(np.float32), 2048)


def _table(found: dict[Formulation, Measured], title: str) -> Table:
    table = Table(title=title, caption="milliseconds a pair; in brackets: the reference's share")
    table.add_column("formulation")
    limit = found["reference"]
    columns = {
        f"forward, batch {BATCH}": "forward",
        "forward + backward": "both",
        "the same, all pairs": "all_pairs",
        "forward, batch 1": "alone",
        "predict": "predict",
        "memory, MB": "memory",
    }
    for column in columns:
        table.add_column(column, justify="right")
    for name, measured in found.items():
        cells = []
        for attribute in columns.values():
            value, of = getattr(measured, attribute), getattr(limit, attribute)
            if attribute == "all_pairs":
                of = limit.both
            ratio = f"{value / of:.2f}" if attribute == "memory" else f"{of / value:.1f}x"
            cells.append(f"{value:.2f} ({ratio})" if value < 100 else f"{value:.0f} ({ratio})")
        table.add_row(name, *cells)
    return table


if __name__ == "__main__":
    tyro.cli(Benchmark).run()

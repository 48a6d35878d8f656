"""One training in several processes, as torchrun starts them: gloo on CPUs, NCCL on GPUs."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta

import torch
from torch import Tensor, nn
from torch import distributed as dist
from torch.nn.parallel import DistributedDataParallel

PATIENCE = timedelta(hours=6)
"""How long processes wait for the first, which alone finds tables and judges."""


@dataclass(frozen=True, slots=True)
class Process:
    """Which of the processes of a training this is."""

    rank: int = 0
    """From 0; the first one writes the run."""
    world: int = 1
    """How many there are."""
    local_rank: int = 0
    """From 0, on this machine: the number of its GPU."""

    @property
    def first(self) -> bool:
        """Whether this is the process that writes and tells."""
        return self.rank == 0

    def sum(self, values: Tensor) -> Tensor:
        """Return the sum of `values` over all processes."""
        if self.world > 1:
            dist.all_reduce(values)
        return values

    def wait(self) -> None:
        """Wait until all processes are here."""
        if self.world > 1:
            dist.barrier()

    def joined(self, model: nn.Module) -> nn.Module:
        """Return a module like `model` whose gradients are the mean over all processes."""
        return DistributedDataParallel(model) if self.world > 1 else model


def this_process() -> Process:
    """Return which process torchrun started, the only one if it did not."""
    rank, world, local = (
        int(os.environ.get(name, default))
        for name, default in (("RANK", "0"), ("WORLD_SIZE", "1"), ("LOCAL_RANK", "0"))
    )
    return Process(rank, world, local)


@contextmanager
def meeting(process: Process, device: torch.device) -> Iterator[None]:
    """Let the processes of a training find each other, and part at the end."""
    if process.world == 1:
        yield
        return
    backend = "nccl" if device.type == "cuda" else "gloo"
    dist.init_process_group(backend, rank=process.rank, world_size=process.world, timeout=PATIENCE)
    try:
        yield
    finally:
        dist.destroy_process_group()

"""How fast the laboratory is: both worlds side by side, one worker against two, memory.

    python -m tests.benchmarks.laboratory --shapes 100
    python -m tests.benchmarks.laboratory --memory

Processor seconds, so that other work on the machine disturbs little; two workers against one is
a ratio of wall times, and wants the machine for itself.
"""

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Literal

import psutil
import tyro
from rich.console import Console
from rich.table import Table

from dnet.laboratory import LaboratorySettings, laboratory
from dnet.recording.folder_store import FolderStore
from dnet.recording.pair import record_pair
from dnet.recording.request import RecordingRequest
from tests.benchmarks.stages import Stages, record

WORLDS: tuple[Literal["bullet", "quasistatic"], ...] = ("bullet", "quasistatic")
STAGES = ("planning", "physics", "second opinion", "sensing", "logging", "together")


@dataclass(frozen=True)
class Benchmark:
    """Measure the laboratory."""

    pairs: int = 3
    """Episodes of each world, after one that is not counted."""
    shapes: int = 40
    """Shapes an episode."""
    workers: bool = False
    """Also measure two workers against one, by wall time."""
    memory: bool = False
    """Only measure resident memory: after 200 shapes and after 2000."""
    world: Literal["bullet", "quasistatic"] = "bullet"
    """Whose memory."""

    def run(self) -> None:
        """Measure and print."""
        console = Console(width=100)
        with tempfile.TemporaryDirectory() as folder:
            if self.memory:
                self._memory(Path(folder), console)
                return
            self._stages(Path(folder), console)
            if self.workers:
                self._workers(Path(folder), console)

    def _stages(self, folder: Path, console: Console) -> None:
        measured = {
            world: record(
                LaboratorySettings(world=world), folder, pairs=self.pairs, shapes=self.shapes
            )
            for world in WORLDS
        }
        count = self.pairs * self.shapes
        table = Table("CPU ms a shape", *WORLDS, "ratio", title=f"{count} shapes of each world")
        for stage in STAGES:
            one, other = (1e3 * measured[world].seconds[stage] / count for world in WORLDS)
            table.add_row(stage, f"{one:.1f}", f"{other:.1f}", f"{one / max(other, 1e-9):.1f}")
        console.print(table)
        for world in WORLDS:
            stages = measured[world]
            speed = count / stages.seconds["together"]
            console.print(
                f"{world}: {speed:.2f} shapes a CPU-second; "
                f"sensing and logging take {_share(stages):.1%} of the physics"
            )

    def _workers(self, folder: Path, console: Console) -> None:
        seconds = {}
        for workers in (1, 2):
            out = folder / f"workers-{workers}"
            arguments = ["--pairs", "4", "--shapes", str(self.shapes), "--workers", str(workers)]
            dnet = Path(sys.executable).parent / "dnet"
            begin = perf_counter()
            subprocess.run([dnet, "record", out, *arguments], check=True, capture_output=True)
            seconds[workers] = perf_counter() - begin
        console.print(
            f"4 episodes of {self.shapes} shapes: {seconds[1]:.1f} s with one worker, "
            f"{seconds[2]:.1f} s with two, {seconds[1] / seconds[2]:.2f} times as fast"
        )

    def _memory(self, folder: Path, console: Console) -> None:
        settings = LaboratorySettings(world=self.world)
        request = RecordingRequest(pairs=10, shapes=200, laboratory=settings)
        process = psutil.Process()
        resident = []
        with laboratory(settings) as lab:
            for index in range(request.pairs):
                record_pair(lab, request, index, FolderStore(folder), shape_done=lambda: None)
                resident.append(process.memory_info().rss)
                console.print(f"{200 * (index + 1)} shapes: {resident[-1] / 1e6:.1f} MB")
        console.print(f"after 2000 shapes against after 200: {resident[-1] / resident[0]:.3f}")


def _share(stages: Stages) -> float:
    seconds = stages.seconds
    return (seconds["sensing"] + seconds["logging"]) / seconds["physics"]


if __name__ == "__main__":
    tyro.cli(Benchmark).run()

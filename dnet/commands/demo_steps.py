"""How the demo goes from step to step, and what it tells at the end, read back from its files."""

import json
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol, runtime_checkable

import numpy as np
from rich.console import Console
from rich.table import Table

from dnet.datasets.reader import EpisodeReader
from dnet.errors import OccupiedOutput
from dnet.tools.listing import list_episodes
from dnet.training.run import METRICS, best_of, main_scores, read_config

STATE = "demo.json"


@runtime_checkable
class Command(Protocol):
    """What `dnet` runs."""

    def run(self) -> None:
        """Do it."""


class Steps:
    """Runs the steps that are not done yet, and remembers those that are in `out/demo.json`."""

    def __init__(self, out: Path, options: dict[str, Any], console: Console) -> None:
        """Begin, or go on where a demo with the same options ended.

        Raises:
            OccupiedOutput: If `out` holds a demo with other options.
        """
        self.seconds: dict[str, float] = {}
        self._file, self._options, self._console = out / STATE, options, console
        if self._file.exists():
            state = json.loads(self._file.read_text())
            if state["options"] != options:
                raise OccupiedOutput(out, f"a demo with other options ({state['options']})")
            self.seconds = state["seconds"]

    def run(self, name: str, line: str, command: Command) -> None:
        """Show a command line and run the command behind it, unless that was done before."""
        self._console.print(f"\n[bold]$ {line}[/bold]", highlight=False, soft_wrap=True)
        if name in self.seconds:
            self._console.print("done before", style="dim")
            return
        start = perf_counter()
        command.run()
        self.seconds[name] = perf_counter() - start
        self._file.parent.mkdir(parents=True, exist_ok=True)
        part = self._file.with_suffix(".part")
        part.write_text(json.dumps({"options": self._options, "seconds": self.seconds}, indent=2))
        part.replace(self._file)


def held_out_goal(data: Path, train: Path) -> tuple[Path, int]:
    """Return an episode that was not trained on, and its shape farthest from rest."""
    name = read_config(train)["data"]["unseen_episodes"][0]
    path = data / f"{name}.mcap"
    with EpisodeReader(path) as episode:
        motions = np.linalg.norm(episode.grasps - episode.grasps[0], axis=1)
        return path, int(np.argmax(motions))


def summary(out: Path, seconds: dict[str, float]) -> Table:
    """Return the closing table of the demo in `out`."""
    shapes = int(list_episodes(out / "data")["shapes"].sum())
    epochs = [json.loads(line) for line in (out / "train" / METRICS).read_text().splitlines()]
    best = main_scores((best_of(epochs) or epochs[-1])["unseen_episodes"])
    with EpisodeReader(out / "servo" / "run.mcap") as episode:
        result, goal = episode.result or {}, episode.meta.settings["goal"]
    chamfer = [1e3 * distance for distance in result["chamfer"]]
    table = Table("step", "result", "seconds", "files")
    for name, text, files in (
        ("record", f"{shapes} shapes, {shapes / seconds['record']:.2f} a second", "data"),
        (
            "train",
            f"error on unseen episodes {best['mse_mm2']:.0f} mm² (mean over xyz), "
            f"{best['mean_mm']:.1f} mm; without motion {best['zero_mse_mm2']:.0f} mm², "
            f"{best['zero_mean_mm']:.1f} mm",
            "train",
        ),
        (
            "servo",
            f"Chamfer {chamfer[0]:.2f} mm -> {chamfer[-1]:.2f} mm, {result['outcome']} after "
            f"{len(chamfer) - 1} motions; goal {goal}",
            "servo/run.rrd",
        ),
        ("picture of the run", "", "servo.png"),
        ("picture of the goal", "", "episode.png"),
    ):
        table.add_row(name, text, f"{seconds[name]:.0f}", str(out / files))
    table.add_row("together", "", f"{sum(seconds.values()):.0f}", str(out))
    return table

"""What the demo chooses and what it tells at the end, all of it read back from its files."""

import json
from pathlib import Path

from rich.table import Table

from dnet.datasets.reader import EpisodeReader
from dnet.tools.listing import list_episodes
from dnet.training.run import METRICS, read_config


def held_out_goal(data: Path, run: Path) -> str:
    """Return `EPISODE:FRAME`: the last shape of an episode that was not trained on."""
    name = read_config(run)["data"]["validation"][0]
    path = data / f"{name}.mcap"
    with EpisodeReader(path) as episode:
        return f"{path}:{len(episode) - 1}"


def summary(out: Path, goal: str, seconds: dict[str, float]) -> Table:
    """Return the closing table of the demo in `out`."""
    shapes = int(list_episodes(out / "data")["shapes"].sum())
    epochs = [json.loads(line) for line in (out / "train" / METRICS).read_text().splitlines()]
    best = min(epochs, key=lambda epoch: epoch["validation"]["any_pair"]["mse_mm2"])
    errors = best["validation"]["any_pair"]
    with EpisodeReader(out / "servo" / "run.mcap") as episode:
        result = episode.result or {}
    chamfer = [1e3 * distance for distance in result["chamfer"]]
    table = Table("step", "result", "seconds", "files")
    table.add_row(
        "record",
        f"{shapes} shapes ({shapes / seconds['record']:.2f} a second)",
        f"{seconds['record']:.0f}",
        str(out / "data"),
    )
    table.add_row(
        "train",
        f"validation error {errors['mse_mm2']:.1f} mm² (mean over xyz), "
        f"{errors['mean_mm']:.1f} mm; zero motion {errors['zero_mse_mm2']:.0f} mm²",
        f"{seconds['train']:.0f}",
        str(out / "train"),
    )
    table.add_row(
        "servo",
        f"Chamfer {chamfer[0]:.2f} -> {chamfer[-1]:.2f} mm in {len(chamfer) - 1} motions, "
        f"{result['outcome']}; goal {Path(goal).name}",
        f"{seconds['servo']:.0f}",
        str(out / "servo" / "run.rrd"),
    )
    pictures = sum(value for name, value in seconds.items() if name.startswith("picture"))
    table.add_row("play", "two pictures", f"{pictures:.0f}", str(out / "*.png"))
    table.add_row("together", "", f"{sum(seconds.values()):.0f}", str(out))
    return table

"""What the demo takes as its goal, and what it tells at the end, read back from its files."""

from pathlib import Path

import numpy as np
from rich.table import Table

from dnet.datasets.reader import EpisodeReader
from dnet.files.plain_names import plain_name
from dnet.tools.listing import list_episodes
from dnet.training.run import best_of, main_scores, read_config, read_history


def held_out_goal(data: Path, train: Path) -> tuple[Path, int]:
    """Return an episode that was not trained on, and its shape farthest from rest."""
    name = plain_name(read_config(train)["data"]["unseen_episodes"][0], what=f"a goal of {train}")
    path = data / f"{name}.mcap"
    with EpisodeReader(path) as episode:
        motions = np.linalg.norm(episode.grasps - episode.grasps[0], axis=1)
        return path, int(np.argmax(motions))


def summary(out: Path, seconds: dict[str, float]) -> Table:
    """Return the closing table of the demo in `out`."""
    shapes = int(list_episodes(out / "data")["shapes"].sum())
    epochs = read_history(out / "train")
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

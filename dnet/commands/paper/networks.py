"""The experiment `networks`: errors of DeformerNet and of Hu et al., as their trainings say."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from dnet.commands.index_bar import read_index
from dnet.commands.paper.episodes import Episodes, unseen_episodes
from dnet.commands.paper.request import PaperRequest, hu_weights
from dnet.commands.progress import progress
from dnet.datasets.frame_table import FrameTable
from dnet.evaluation.report.asked import read_asked, write_asked
from dnet.evaluation.report.networks_section import ARCHITECTURE
from dnet.evaluation.report.published import GRASP_CASES
from dnet.evaluation.report.trainings import CONFIG, ERRORS, SHIPPED, SHIPPED_HU
from dnet.files.sizes import read_json
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.training.checkpoints import load, load_any, weights_file, write_json
from dnet.training.division import divide, thinned
from dnet.training.frames import Frames
from dnet.training.tasks import task_of
from dnet.weights import DEFORMERNET

FRAMES = 1500
"""Of each part, that the networks that ship are judged by, evenly over its episodes."""


def run_networks(request: PaperRequest) -> None:
    """Copy what trainings found, and judge the networks that ship, unless that was done.

    Raises:
        DnetError: If the episodes or a training will not do.
    """
    folder = request.out / "networks"
    episodes = unseen_episodes(request, request.count(GRASP_CASES))
    asked = request.asked(
        FRAMES,
        weights={
            "deformernet": _weights(request),
            "hu": hu_weights(request),
            **_best_weights(request),
        },
        data={episodes.folder.name: episodes.table.fingerprint},
        options={"validation": request.validation} if request.from_mcap is not None else {},
    )
    before = read_asked(folder)
    same = before is not None and (before.weights, before.data, before.count, before.options) == (
        asked.weights,
        asked.data,
        asked.count,
        asked.options,
    )
    if same and (folder / SHIPPED / ERRORS).is_file():
        return
    for name, run in request.trainings.items():
        _copy(run, folder / name)
    for name, model, path in (
        (SHIPPED, "deformernet", _weights(request)),
        (SHIPPED_HU, "hu", hu_weights(request)),
    ):
        _judge(request, episodes, folder / name, network=(model, path), most=max(2, asked.count))
    write_json(folder / ARCHITECTURE, {"paper": _weights_of("paper"), "shipped": _weights_of()})
    write_asked(folder, asked)


def _copy(run: Path, folder: Path) -> None:
    """Keep what a training says of itself: the report is made from its own directory alone."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (CONFIG, ERRORS):
        write_json(folder / name, read_json(run / name, what="description of a training"))


def _judge(
    request: PaperRequest, episodes: Episodes, folder: Path, *, network: tuple[str, Path], most: int
) -> None:
    """Judge a network, by its kind and its file, on some of the frames, with a progress bar."""
    kind, path = network
    model = load_any(path)
    judged_by = task_of(model)
    errors: dict[str, Any] = {}
    with progress(request.console, "clouds") as bar:
        for part, table in _parts(request, episodes).items():
            some = thinned(table, most)
            frames = Frames.of(some, model.config)
            task = bar.add_task(f"judging {kind}, {part}", total=2 * len(some))
            frames.tables.build(on_clouds=partial(bar.advance, task))
            found = judged_by.judge(model, frames, on_clouds=partial(bar.advance, task))
            if found is not None:
                errors[part] = asdict(found)
    folder.mkdir(parents=True, exist_ok=True)
    told = {"model": kind} | asdict(model.config)
    write_json(folder / CONFIG, {"network": told, "training": {}})
    write_json(folder / ERRORS, errors)


def _parts(request: PaperRequest, episodes: Episodes) -> dict[str, FrameTable]:
    if request.from_mcap is None or request.validation >= 1:
        return {"unseen episodes": episodes.unseen}
    index = read_index(episodes.folder, request.console)
    return divide(index, fraction=request.validation, seed=request.seed).parts


def _weights(request: PaperRequest) -> Path:
    return DEFORMERNET if request.checkpoint is None else weights_file(request.checkpoint)


def _best_weights(request: PaperRequest) -> dict[str, Path]:
    return {name: weights_file(run) for name, run in request.trainings.items()}


def _weights_of(size: str | None = None) -> int:
    """Return how many weights a network has: of a size, or the one that ships."""
    model = load(DEFORMERNET) if size is None else DeformerNet(DeformerNetConfig(size="paper"))
    return sum(weights.numel() for weights in model.parameters())

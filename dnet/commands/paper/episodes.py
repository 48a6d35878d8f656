"""Episodes that no network has learned from: those given, or some recorded for the report."""

from dataclasses import dataclass
from pathlib import Path

from dnet.commands.index_bar import read_index
from dnet.commands.paper.request import PaperRequest
from dnet.commands.progress import progress
from dnet.datasets.frame_table import FrameTable, settled_frames
from dnet.datasets.split import split
from dnet.laboratory import LaboratorySettings
from dnet.recording.dataset import record_missing, recording
from dnet.recording.request import RecordingRequest
from dnet.recording.store import open_store

SHAPES = 4
"""Of each episode that is recorded: 25 episodes make 100 cases."""
SEED = 1
"""Of those: the networks that ship learned from seed 0."""
DATA = "data"


@dataclass(frozen=True)
class Episodes:
    """Where they are, and what is known of them."""

    folder: Path
    table: FrameTable
    """Settled frames of all that lie there."""
    unseen: FrameTable
    """Of those alone that no network has learned from."""


def unseen_episodes(request: PaperRequest, cases: int) -> Episodes:
    """Return episodes with at least so many shapes; record what is missing, if none were given.

    Raises:
        DnetError: If the given ones will not do.
    """
    if request.from_mcap is not None:
        return _given(request, request.from_mcap)
    folder = request.out / DATA / "boxes"
    # Two at least: a network is judged by what differs between episodes, too.
    pairs = max(2, -(-cases // SHAPES))
    record(
        RecordingRequest(
            pairs=pairs,
            shapes=SHAPES,
            seed=SEED,
            laboratory=LaboratorySettings(world="quasistatic"),
        ),
        folder,
        request,
    )
    table = settled_frames(read_index(folder, request.console))
    return Episodes(folder, table, table)


def record(asked: RecordingRequest, folder: Path, request: PaperRequest) -> None:
    """Record what a folder lacks, with a progress bar.

    Raises:
        DnetError: If the folder holds something else.
    """
    with recording(open_store(folder), asked) as manifest:
        if not manifest.missing():
            return
        with progress(request.console, "shapes") as bars:
            shapes = len(manifest.missing()) * asked.shapes
            task = bars.add_task(f"recording {folder.name}", total=shapes)
            record_missing(
                manifest,
                workers=request.jobs,
                progress=lambda count: bars.update(task, advance=float(count)),
            )


def _given(request: PaperRequest, folder: Path) -> Episodes:
    table = settled_frames(read_index(folder, request.console))
    if request.validation >= 1:
        return Episodes(folder, table, table)
    _, unseen = split(table.episodes_seen, fraction=request.validation, seed=request.seed)
    return Episodes(folder, table, table.of_episodes(set(unseen)))

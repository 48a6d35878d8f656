"""How a training goes, for people who look: a Rerun file, and TensorBoard if they like."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from dnet.errors import MissingExtra, MissingPackage
from dnet.packages import needed_for
from dnet.recorders.training_values import (
    EpochPoint,
    LossPoint,
    Motions,
    RatePoint,
    SetErrors,
    WorstSample,
)
from dnet.training.run import RunWriter, main_scores
from dnet.training.showcase import Showcase

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

RECORDING, BOARD = "training.rrd", "tensorboard"
SETS = {"unseen shapes": "unseen_shapes", "unseen episodes": "unseen_episodes"}
"""Held-out frames, and how the metrics of an epoch name them."""


class TrainingLog:
    """Writes RUN/training.rrd anew after every epoch, and adds to RUN/tensorboard.

    A machine for training alone may do without Rerun: there is no recording then.

    Args:
        run: Of the training.
        board: Whether TensorBoard is wanted.
        say: Shows a line to people.

    Raises:
        MissingExtra: If it is, and is not installed.
    """

    def __init__(self, run: RunWriter, *, board: bool, say: Callable[[str], None]) -> None:
        self._run = run
        self._draw = _with_rerun(say)
        self._board = _open_board(run.path / BOARD, run.history) if board else None

    def __enter__(self) -> "TrainingLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._board is not None:
            self._board.close()

    def add(self, showcases: Mapping[str, Showcase]) -> None:
        """Take note of the last epoch of the run's history, and of pairs that it was judged by."""
        history = self._run.history
        if self._draw is not None:
            self._draw(
                self._run.path / RECORDING,
                name=self._run.path.name,
                losses=[point for line in _steps(history) for point in _losses(*line)],
                rates=[RatePoint(line["steps"], line["learning_rate"]) for line in history],
                epochs=[EpochPoint(line["steps"], _errors(line)) for line in history],
                motions=[_motions(name, showcase) for name, showcase in showcases.items()],
                worst=_worst(showcases["unseen episodes"]),
            )
        if self._board is not None:
            _add_scalars(self._board, history[-1])


def _with_rerun(say: Callable[[str], None]) -> "Callable[..., None] | None":
    """Return what writes a recording; None where Rerun is missing, which is said."""
    try:
        with needed_for(f"{RECORDING}, which `dnet play` shows,"):
            from dnet.recorders.training_recording import write_training
    except MissingPackage as error:
        say(f"the training goes on without a recording: {error}")
        return None
    return write_training


def _steps(history: list[dict[str, Any]]) -> list[tuple[int, dict[str, Any]]]:
    """Return the steps before each epoch, and the epoch."""
    ends = [line["steps"] for line in history]
    return list(zip([0, *ends], history, strict=False))


def _losses(before: int, line: dict[str, Any]) -> list[LossPoint]:
    """Return the curve of an epoch, each point at the end of what it is the mean of."""
    losses, steps = line["losses"], line["steps"] - before
    return [
        LossPoint(before + steps * (part + 1) // len(losses), loss)
        for part, loss in enumerate(losses)
    ]


def _errors(line: dict[str, Any]) -> dict[str, SetErrors]:
    found = {}
    for name, key in SETS.items():
        if line[key] is not None:
            scores = main_scores(line[key])
            found[name] = SetErrors(scores["mse_mm2"], scores["mean_mm"], scores["r2"])
    return found


def _motions(name: str, showcase: Showcase) -> Motions:
    predicted, true = showcase.motions
    return Motions(name, predicted.numpy(), true.numpy())


def _worst(showcase: Showcase) -> list[WorstSample]:
    return [
        WorstSample(
            caption=pair.title,
            current=pair.current,
            goal=pair.goal,
            grasp=pair.origin,
            true=pair.true,
            predicted=pair.predicted,
            error_mm=pair.error_mm,
        )
        for pair in showcase.worst()
    ]


def _open_board(folder: Path, history: list[dict[str, Any]]) -> "SummaryWriter":
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise MissingExtra("tensorboard", "tensorboard", "--tensorboard") from error
    # What was written after the training was put down comes again.
    steps = history[-1]["steps"] + 1 if history else 0
    return SummaryWriter(str(folder), purge_step=steps)


def _add_scalars(board: "SummaryWriter", line: dict[str, Any]) -> None:
    step = line["steps"]
    board.add_scalar("loss", line["loss"], step)
    board.add_scalar("learning_rate", line["learning_rate"], step)
    for name, errors in _errors(line).items():
        board.add_scalar(f"{name}/mse_mm2", errors.mse_mm2, step)
        board.add_scalar(f"{name}/mean_mm", errors.mean_mm, step)
    board.flush()

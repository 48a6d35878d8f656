"""How far predicted manipulation points are from true ones, next to the middle of the object."""

from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from dnet.nets.manipulation_point import (
    SCORED,
    DensePredictor,
    PointRegressor,
    expected,
    middle,
    surface,
)
from dnet.nets.neighbourhoods import Neighbourhoods
from dnet.training.frames import Frames, Rows
from dnet.training.scores import Errors, Tally, Watch

# Goals that are looked at together: few enough that judging takes no more memory than learning.
_GOALS = 32


def point_errors(
    model: PointRegressor | DensePredictor,
    frames: Frames,
    *,
    watch: Watch | None = None,
    on_clouds: Callable[[int], None] = lambda _: None,
) -> Errors | None:
    """Return the errors of `model` from the rest shape of each episode to its other shapes.

    Points are counted from the middle of the rest cloud, so that the errors of predicting zero
    are those of always choosing it. None if there is no pair.

    Args:
        model: On any device.
        frames: To judge it by.
        watch: Told of all pairs, with points instead of motions.
        on_clouds: Called with how many clouds are done, as they are.
    """
    was_training = model.training
    model.eval()
    tally = Tally()
    try:
        with torch.inference_mode():
            for file in np.unique(frames.table.file).tolist():
                rows = np.flatnonzero(frames.table.file == file)
                rests = rows[frames.table.rest[rows]]
                if len(rests):
                    _judge(model, frames, rows, rest=int(rests[0]), tally=tally, watch=watch)
                on_clouds(len(rows))
    finally:
        model.train(was_training)
    return Errors(None, tally.scores()) if tally.pairs else None


def _judge(
    model: PointRegressor | DensePredictor,
    frames: Frames,
    rows: Rows,
    *,
    rest: int,
    tally: Tally,
    watch: Watch | None,
) -> None:
    """Count the pairs of one episode."""
    device = next(model.parameters()).device
    initial = frames.prepared(np.array([rest])).to(device)
    centre = middle(initial, model.config).cpu()
    goals = rows[~frames.table.rest[rows]]
    for part in np.split(goals, range(_GOALS, len(goals), _GOALS)):
        if not len(part):
            continue
        current = np.full(len(part), rest)
        goal = frames.prepared(part).to(device)
        predicted = _points(model, initial, goal).float().cpu() - centre
        true = torch.from_numpy(frames.points(current)) - centre
        tally.add(predicted, true)
        if watch is not None:
            watch(current, part, predicted, true)


def _points(
    model: PointRegressor | DensePredictor, initial: Neighbourhoods, goal: Neighbourhoods
) -> Float[Tensor, "p 3"]:
    count = len(goal.points)
    of = torch.zeros(count, dtype=torch.int64, device=goal.points.device)
    if isinstance(model, PointRegressor):
        answer: Tensor = model(initial, goal, of)
        return answer
    candidates = surface(initial, SCORED)
    scores = model(initial, goal, of, candidates=candidates).scores
    return expected(scores.float(), candidates[0] * model.config.coordinate_unit)

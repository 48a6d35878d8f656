"""How far chosen manipulation points are from the true ones, method by method."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np
import polars as pl
from jaxtyping import Float64

from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import FrameTable
from dnet.errors import NoDisplacement, TooFew
from dnet.servo.pickers import Choice, Picker
from dnet.types import Cloud, Point


@dataclass(frozen=True, slots=True)
class Case:
    """A rest shape, a goal, and the point at which the goal was made."""

    name: str
    """Episode and number of the goal's frame."""
    initial: Cloud
    goal: Cloud
    truth: Point
    """In metres."""


@dataclass(frozen=True, slots=True)
class Answers:
    """What one method chose, case by case."""

    points: Float64[np.ndarray, "n 3"]
    """In metres; NaN where it gave no answer."""
    choices: tuple[Choice | None, ...]
    """What lies behind them."""
    distances: Float64[np.ndarray, " n"]
    """From the truth, in metres; of a case without an answer, from the middle of the object: it
    is counted, not dropped."""
    confidences: Float64[np.ndarray, " n"]
    seconds: Float64[np.ndarray, " n"]
    """Processor time of each choice."""

    @property
    def unanswered(self) -> int:
        """Cases without an answer."""
        return int(np.isnan(self.points[:, 0]).sum())


def cases_of(table: FrameTable, count: int, *, seed: int = 0) -> list[Case]:
    """Return pairs of a rest shape and another of its episode, as even over episodes as it goes.

    Args:
        table: Settled frames, of episodes that no method has learned from.
        count: How many.
        seed: Of which shapes are taken.

    Raises:
        TooFew: If there are fewer pairs.
    """
    clouds = Clouds(table)
    random = np.random.default_rng(seed)
    rests, shapes = [], []
    for file in np.unique(table.file).tolist():
        rows = np.flatnonzero(table.file == file)
        found = rows[table.rest[rows]]
        if len(found) and len(others := rows[~table.rest[rows]]):
            rests.append(int(found[0]))
            shapes.append(random.permutation(others).tolist())
    if (total := sum(map(len, shapes))) < count:
        raise TooFew("number of unseen pairs for --cases to choose from", total, count)
    cases: list[Case] = []
    turn = 0
    while len(cases) < count:
        for rest, others in zip(rests, shapes, strict=True):
            if turn < len(others) and len(cases) < count:
                row = others[turn]
                name = f"{table.episodes[int(table.file[row])]}:{table.frame[row]}"
                truth = table.grasps[rest].astype(np.float64)
                cases.append(Case(name, clouds[rest].copy(), clouds[row].copy(), truth))
        turn += 1
    clouds.close()
    return cases


def answers_of(
    picker: Picker, cases: Sequence[Case], *, on_case: Callable[[], None] = lambda: None
) -> Answers:
    """Return what a method chooses.

    Args:
        picker: The method; it must not know the truth.
        cases: To choose for.
        on_case: Called after each.
    """
    points = np.full((len(cases), 3), np.nan)
    confidences, seconds = np.zeros(len(cases)), np.zeros(len(cases))
    choices: list[Choice | None] = []
    for number, case in enumerate(cases):
        began = process_time()
        choice = _choice(picker, case)
        seconds[number] = process_time() - began
        choices.append(choice)
        if choice is not None:
            points[number], confidences[number] = choice.point, choice.confidence
        on_case()
    truths = np.stack([case.truth for case in cases])
    middles = np.stack([case.initial.mean(axis=0, dtype=np.float64) for case in cases])
    distances = np.linalg.norm(np.where(np.isnan(points), middles, points) - truths, axis=1)
    return Answers(points, tuple(choices), distances, confidences, seconds)


def _choice(picker: Picker, case: Case) -> Choice | None:
    try:
        return picker.pick(case.initial, case.goal)
    except NoDisplacement:
        return None


def frame_of(cases: Sequence[Case], answers: Mapping[str, Answers]) -> str:
    """Return every choice as CSV, in metres and seconds."""
    rows = [
        {
            "method": name,
            "case": case.name,
            **{f"true_{axis}": value for axis, value in zip("xyz", case.truth, strict=True)},
            **{f"chosen_{axis}": v for axis, v in zip("xyz", found.points[number], strict=True)},
            "distance": found.distances[number],
            "confidence": found.confidences[number],
            "seconds": found.seconds[number],
        }
        for name, found in answers.items()
        for number, case in enumerate(cases)
    ]
    return pl.DataFrame(rows).write_csv(float_precision=6)


def table_of(answers: Mapping[str, Answers]) -> str:
    """Return the distances of each method as a Markdown table, in millimetres."""
    lines = [
        "| method | cases | mean | median | 90 % | worst | no answer | ms a case |",
        "|---|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for name, found in answers.items():
        mm = 1e3 * found.distances
        figures = (mm.mean(), np.median(mm), np.quantile(mm, 0.9), mm.max())
        told = " | ".join(f"{figure:.1f}" for figure in figures)
        speed = 1e3 * np.median(found.seconds)
        lines.append(f"| {name} | {len(mm)} | {told} | {found.unanswered} | {speed:.0f} |")
    return "\n".join(lines) + "\n"

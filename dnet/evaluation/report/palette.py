"""The colours of the report: one for each thing, the same in every plot."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class Stroke(NamedTuple):
    """How a curve is drawn."""

    colour: str
    dash: str = "solid"
    """As plotly calls it."""


INK, FAINT, RULE = "#1f2933", "#6b7783", "#d9dee3"
NAVY, BLUE, SKY, SAND, CLAY, GREY = (
    "#1d3f5e",
    "#3b7aa8",
    "#8db8d4",
    "#c9a26a",
    "#b0573c",
    "#98a2ac",
)
SCALE = (NAVY, BLUE, SKY, SAND, CLAY, GREY)
"""From cold to warm; told apart by people who see no red or green, too."""

KNOWN: Mapping[str, Stroke] = {
    "deformernet": Stroke(NAVY),
    "deformernet + keypoints": Stroke(BLUE, "dash"),
    "deformernet + regressor": Stroke(SKY, "dash"),
    "deformernet + dense": Stroke(SAND, "dash"),
    "oracle": Stroke(GREY, "dot"),
    "none": Stroke(GREY),
    "rrt": Stroke(SAND),
    "hu": Stroke(CLAY),
    "hu-online": Stroke(CLAY, "dash"),
    "hu, true point": Stroke(CLAY),
    "keypoints": Stroke(NAVY),
    "regressor": Stroke(BLUE),
    "dense": Stroke(SKY),
    "most displaced point": Stroke(SAND),
    "random point": Stroke(GREY),
    "in distribution": Stroke(NAVY),
    "out of distribution": Stroke(SKY),
    "start": Stroke(GREY),
    "goal": Stroke(CLAY),
    "end": Stroke(NAVY),
    "true point": Stroke("#2e7d4f"),
    "chosen point": Stroke("#2b55c4"),
}
"""Points keep the paper's colours: the truth is green, a choice blue, a goal red."""


def strokes(labels: Sequence[str]) -> list[Stroke]:
    """Return how curves are drawn: as always, others in one colour of the scale after another."""
    others = [label for label in dict.fromkeys(labels) if label not in KNOWN]
    drawn = {label: Stroke(SCALE[turn % len(SCALE)]) for turn, label in enumerate(others)}
    return [KNOWN.get(label) or drawn[label] for label in labels]

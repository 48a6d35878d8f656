"""The experiments that the paper is reproduced by: what each shows, needs and costs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

ExperimentName = Literal["grasp", "cases", "importance", "networks", "goals", "generalisation"]


@dataclass(frozen=True, slots=True)
class Experiment:
    """One of them."""

    title: str
    reproduces: str
    """What of the paper."""
    needs: str
    """Besides the networks that ship."""
    cost: str
    """At full size, in time of one processor core."""


EXPERIMENTS: Mapping[ExperimentName, Experiment] = {
    "grasp": Experiment(
        "Where to grasp",
        "table 1: distance of the manipulation point over 100 cases",
        "episodes: given, or recorded (25 x 4 shapes)",
        "2 minutes",
    ),
    "cases": Experiment(
        "Four servo cases",
        "table 2: final Chamfer distances; figures 3 to 6: results, set-up, sequences, over time",
        "nothing",
        "3 minutes",
    ),
    "importance": Experiment(
        "A good and a bad manipulation point",
        "figure 2",
        "nothing",
        "half a minute",
    ),
    "networks": Experiment(
        "DeformerNet against Hu et al.",
        "figure 1, and the losses on the full dataset and on a few shapes",
        "trainings: --runs; without, those that ship alone are judged",
        "2 minutes",
    ),
    "goals": Experiment(
        "A hundred unseen goals",
        "success over the tolerance, against baselines (of the follow-ups)",
        "episodes, as for grasp",
        "20 minutes",
    ),
    "generalisation": Experiment(
        "Other objects, cameras and clouds",
        "stiffness, size, shape, camera noise, points (of the follow-ups)",
        "for 512 and 1024 points trainings in --runs",
        "40 minutes",
    ),
}

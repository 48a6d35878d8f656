"""The experiments by name: what runs each of them."""

from collections.abc import Callable, Mapping

from dnet.commands.paper.cases import run_cases
from dnet.commands.paper.generalisation import run_generalisation
from dnet.commands.paper.goals import run_goals
from dnet.commands.paper.grasp import run_grasp
from dnet.commands.paper.importance import run_importance
from dnet.commands.paper.networks import run_networks
from dnet.commands.paper.request import PaperRequest
from dnet.evaluation.report.catalogue import ExperimentName

RUN: Mapping[ExperimentName, Callable[[PaperRequest], None]] = {
    "grasp": run_grasp,
    "cases": run_cases,
    "importance": run_importance,
    "networks": run_networks,
    "goals": run_goals,
    "generalisation": run_generalisation,
}

"""A report read from a directory: whatever experiments it holds, and nothing is run."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from dnet.evaluation.report.asked import Asked, read_asked
from dnet.evaluation.report.cases_section import cases_section
from dnet.evaluation.report.catalogue import EXPERIMENTS, ExperimentName
from dnet.evaluation.report.generalisation_section import generalisation_section
from dnet.evaluation.report.goals_section import goals_section
from dnet.evaluation.report.grasp_section import grasp_section
from dnet.evaluation.report.importance_section import importance_section
from dnet.evaluation.report.networks_section import networks_section
from dnet.evaluation.report.values import Cell, Column, Report, Section, Sheet


class Read(Protocol):
    """Reads one experiment."""

    def __call__(self, folder: Path, asked: Asked | None, *, title: str, out: Path) -> Section:
        """Return what it came to."""
        ...


SECTIONS: Mapping[ExperimentName, Read] = {
    "grasp": grasp_section,
    "cases": cases_section,
    "importance": importance_section,
    "networks": networks_section,
    "goals": goals_section,
    "generalisation": generalisation_section,
}


def read_report(
    out: Path, *, on_section: Callable[[ExperimentName], None] = lambda _name: None
) -> Report:
    """Return the report of the experiments in a directory; those that are not there are named.

    Args:
        out: Directory with one directory an experiment.
        on_section: Called with the name of each experiment before it is read.

    Raises:
        DnetError: If a log cannot be read.
    """
    sections = []
    for name, read in SECTIONS.items():
        on_section(name)
        asked = read_asked(out / name)
        sections.append(read(out / name, asked, title=EXPERIMENTS[name].title, out=out))
    return Report(tuple(sections), _provenance(out))


def _provenance(out: Path) -> Sheet:
    """Return with what each experiment was run."""
    rows: list[tuple[Cell, ...]] = []
    for name in SECTIONS:
        asked = read_asked(out / name)
        if asked is None:
            rows.append((name, "not run", None, None, "", "", "", ""))
            continue
        told = (asked.options, asked.data, asked.weights, asked.versions)
        amount = f"{asked.count} of {asked.full}"
        rows.append((name, amount, asked.scale, asked.seed, *map(_pairs, told)))
    columns = (
        Column("experiment"),
        Column("amount"),
        Column("scale"),
        Column("seed"),
        Column("options"),
        Column("data"),
        Column("weights"),
        Column("versions"),
    )
    note = (
        "Data: fingerprint of the settled frames of each set of episodes. Weights: the beginning "
        "of the SHA-256 of each file."
    )
    return Sheet("provenance", "With what it was made", columns, tuple(rows), note)


def _pairs(values: Mapping[str, object]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())

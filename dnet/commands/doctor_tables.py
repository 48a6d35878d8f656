"""What `dnet doctor` found, as tables for people and as JSON for machines."""

import os
import platform
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from dnet.diagnosis.attempts import Outcome
from dnet.diagnosis.libraries import LIBRARIES, Library, remedy
from dnet.diagnosis.machine import Fact
from dnet.packages import Package, is_installed, packages

STYLES = {"works": "green", "fails": "red", "missing": "yellow"}
UNWRAPPED_WIDTH = 2000


def show(outcomes: Sequence[Outcome], facts: Sequence[Fact], missing: Sequence[Library]) -> None:
    """Print what works, what is installed, and what the machine has."""
    console = Console(highlight=False)
    if not console.is_terminal:
        # What is piped into another program must not be cut to a guessed width.
        console = Console(highlight=False, width=UNWRAPPED_WIDTH)
    console.print(f"dnet {_version('deformernet')}, Python {platform.python_version()}", end=" ")
    console.print(f"({sys.executable}), {platform.platform()}\n", markup=False)
    console.print(_abilities(outcomes))
    console.print()
    console.print(_packages())
    console.print()
    console.print(_machine(facts, missing))


def document(
    outcomes: Sequence[Outcome], facts: Sequence[Fact], missing: Sequence[Library]
) -> dict[str, Any]:
    """Return the same as JSON would have it."""
    return {
        "dnet": _version("deformernet"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "works": all(one.status == "works" for one in outcomes if one.ability.needed),
        "abilities": [
            {
                "name": one.ability.name,
                "commands": list(one.ability.commands),
                "needed": one.ability.needed,
                "status": one.status,
                "note": one.note,
                "remedy": one.remedy,
            }
            for one in outcomes
        ],
        "packages": [
            {
                "name": package.name,
                "version": _present(package),
                "extras": list(package.extras),
                "remedy": "" if _present(package) else package.remedy,
            }
            for package in packages()
        ],
        "libraries": [
            {"file": one.file, "found": one not in missing, "use": one.use} for one in LIBRARIES
        ],
        "libraries_remedy": _library_remedy(missing),
        "machine": [{"name": f.name, "value": f.value, "warning": f.warning} for f in facts],
    }


def _table(*columns: str) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for name in columns:
        table.add_column(name, overflow="fold")
    return table


def _abilities(outcomes: Sequence[Outcome]) -> Table:
    table = _table("what", "", "for", "seen", "what mends it")
    for one in outcomes:
        style = STYLES[one.status]
        if not one.ability.needed and one.status == "fails":
            style = STYLES["missing"]
        table.add_row(
            one.ability.name,
            Text(one.status, style=style),
            Text(", ".join(one.ability.commands)),
            Text(one.note),
            Text(one.remedy),
        )
    return table


def _packages() -> Table:
    """Return one row for what every installation has, and one for each extra."""
    table = _table("packages", "installed", "not installed", "what mends it")
    extras = dict.fromkeys(package.extras[:1] for package in packages())
    for extra in sorted(extras):
        members = [package for package in packages() if package.extras[:1] == extra]
        here = [f"{package.name} {_present(package)}" for package in members if _present(package)]
        gone = [package for package in members if not _present(package)]
        remedies = dict.fromkeys(package.remedy for package in gone)
        table.add_row(
            Text(f"[{extra[0]}]" if extra else "needed"),
            Text(", ".join(here)),
            Text(", ".join(package.name for package in gone), style="" if extra else "red"),
            Text("; ".join(remedies)),
        )
    return table


def _machine(facts: Sequence[Fact], missing: Sequence[Library]) -> Table:
    table = _table("machine", "found", "what mends it")
    for fact in facts:
        table.add_row(fact.name, Text(fact.value), Text(fact.warning, style="yellow"))
    if sys.platform.startswith("linux"):
        names = ", ".join(library.file for library in missing)
        found = f"not found: {names}" if missing else f"all {len(LIBRARIES)} found"
        table.add_row("system libraries", Text(found), Text(_library_remedy(missing)))
    return table


def _library_remedy(missing: Sequence[Library]) -> str:
    return remedy(missing, root=hasattr(os, "geteuid") and os.geteuid() == 0)


def _present(package: Package) -> str:
    """Return the version of a package; empty if it is not there, or cannot be imported."""
    found = _version(package.name)
    return found if is_installed(package.module) else ""


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""

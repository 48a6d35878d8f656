"""Trying every ability in processes beside each other, which may crash and hang."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal

from dnet.diagnosis.abilities import ABILITIES, Ability
from dnet.packages import is_installed, packages

SECONDS, THOROUGH_SECONDS = 120.0, 600.0
"""How long a process may take, all its attempts together."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Whether an ability is there, and what makes it so."""

    ability: Ability
    status: Literal["works", "fails", "missing"]
    """`missing`: a package that it needs is not installed."""
    note: str
    """What was seen."""
    remedy: str
    """The command that mends it, if that is known; empty where it works."""


def try_all(
    *,
    abilities: Sequence[Ability] = ABILITIES,
    thorough: bool = False,
    cores: int = 2,
    on_outcome: Callable[[], None] = lambda: None,
) -> list[Outcome]:
    """Try all abilities whose packages are installed, and return what came out, in their order.

    Args:
        abilities: What to try.
        thorough: Whether to take the attempts that take seconds.
        cores: How many processes may run at once.
        on_outcome: Called after each.
    """
    outcomes: dict[str, Outcome] = {}
    for ability in abilities:
        lacking = [module for module in ability.modules if not is_installed(module)]
        if lacking:
            outcomes[ability.name] = _missing(ability, lacking)
            on_outcome()
    chains: dict[str, list[Ability]] = {}
    for ability in abilities:
        if ability.name not in outcomes:
            chains.setdefault(ability.process, []).append(ability)

    def try_chain(chain: Sequence[Ability]) -> None:
        for outcome in _tried(chain, thorough=thorough):
            outcomes[outcome.ability.name] = outcome
            on_outcome()

    with ThreadPoolExecutor(max(1, cores)) as pool:
        list(pool.map(try_chain, chains.values()))
    return [outcomes[ability.name] for ability in abilities]


def _missing(ability: Ability, modules: Sequence[str]) -> Outcome:
    known = {package.module: package for package in packages()}
    # What comes along with another package is mended by that one.
    owners = [known.get(module, known.get(module.partition("_")[0])) for module in modules]
    remedies = dict.fromkeys(owner.remedy for owner in owners if owner is not None)
    names = ", ".join(dict.fromkeys(owner.name for owner in owners if owner is not None))
    return Outcome(ability, "missing", f"not installed: {names}", "; ".join(remedies))


def _tried(chain: Sequence[Ability], *, thorough: bool) -> Iterator[Outcome]:
    """Try abilities one after another, in a new process after one that took its process along."""
    while chain:
        process = _run(chain, thorough=thorough)
        answers: dict[str, Mapping[str, str]] = {}
        for line in process.stdout.splitlines():
            answer = json.loads(line)
            answers[answer["name"]] = answer
        done = 0
        for ability in chain:
            if ability.name not in answers:
                break
            done += 1
            yield _outcome(ability, answers[ability.name], process)
        if not done:  # Not even the first began: Python itself fails.
            yield _outcome(chain[0], {}, process)
        chain = chain[max(1, done) :]


@dataclass(frozen=True, slots=True)
class _Ended:
    stdout: str
    how: str


def _run(chain: Sequence[Ability], *, thorough: bool) -> _Ended:
    wanted = [f"{one.name}={(one.thorough if thorough else '') or one.attempt}" for one in chain]
    command = [sys.executable, "-m", f"{__package__}.attempting", *wanted]
    limit = THOROUGH_SECONDS if thorough else SECONDS
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=threads | dict(os.environ),
        start_new_session=True,
    ) as process:
        try:
            said, _ = process.communicate(timeout=limit)
        except BaseException as error:
            # A hung attempt goes with all that it started; so does one that Ctrl-C leaves behind.
            os.killpg(process.pid, signal.SIGKILL)
            said, _ = process.communicate()
            if not isinstance(error, subprocess.TimeoutExpired):
                raise
            return _Ended(said, f"hangs: not done within {limit:.0f} s")
    if process.returncode < 0:
        return _Ended(said, f"crashes: {signal.Signals(-process.returncode).name}")
    return _Ended(said, f"ends with status {process.returncode}")


def _outcome(ability: Ability, answer: Mapping[str, str], process: _Ended) -> Outcome:
    if "works" in answer:
        return Outcome(ability, "works", answer["works"], "")
    return Outcome(
        ability, "fails", answer.get("fails", process.how), ability.remedy or _reinstall(ability)
    )


def _reinstall(ability: Ability) -> str:
    names = " ".join(
        f'"{package.name}{package.versions}"'
        for package in packages()
        if package.module in ability.modules
    )
    return f"pip install --force-reinstall --no-deps {names}"

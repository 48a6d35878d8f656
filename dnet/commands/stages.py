"""A chain of commands that goes on after the last one that was finished."""

import json
from pathlib import Path
from time import perf_counter
from typing import Any, Protocol, runtime_checkable

from rich.console import Console

from dnet.errors import BadReport, OccupiedOutput, TooLarge
from dnet.files.sizes import read_json
from dnet.files.whole_file import write_whole


@runtime_checkable
class Command(Protocol):
    """What `dnet` runs."""

    def run(self) -> None:
        """Do it."""


class Stages:
    """Runs the stages that are not done yet, and remembers in a file those that are.

    Args:
        file: Where to remember them; its name says of what they are, as in `demo.json`.
        options: What shapes the results: a chain with others is another one.
        console: Where to show the command of each stage.

    Raises:
        OccupiedOutput: If `file` tells of a chain with other options.
        BadReport: If it does not tell of one.
    """

    def __init__(self, file: Path, options: dict[str, Any], console: Console) -> None:
        self.seconds: dict[str, float] = {}
        """How long each finished stage took, with the time of calls that were stopped in it."""
        self._stopped: dict[str, float] = {}
        self._file, self._options, self._console = file, options, console
        if file.exists():
            state = _read(file)
            if state["options"] != options:
                held = f"a {file.stem} with other options ({state['options']})"
                raise OccupiedOutput(file.parent, held)
            self.seconds, self._stopped = state["seconds"], state.get("stopped", {})

    def run(self, name: str, line: str, command: Command) -> None:
        """Show a command line and run the command behind it, unless that was done before."""
        self._console.print(f"\n[bold]$ {line}[/bold]", highlight=False, soft_wrap=True)
        if name in self.seconds:
            self._console.print("done before", style="dim")
            return
        before, start = self._stopped.pop(name, 0.0), perf_counter()
        try:
            command.run()
        except BaseException:
            self._stopped[name] = before + perf_counter() - start
            self._write()
            raise
        self.seconds[name] = before + perf_counter() - start
        self._write()

    def _write(self) -> None:
        state = {"options": self._options, "seconds": self.seconds, "stopped": self._stopped}
        write_whole(self._file, json.dumps(state, indent=2).encode())


def _read(file: Path) -> dict[str, Any]:
    try:
        state = read_json(file, what="list of stages")
        times = (*state["seconds"].values(), *state.get("stopped", {}).values())
        if not all(isinstance(one, int | float) for one in times):
            raise TypeError("its seconds are no numbers")
        return {**state, "options": state["options"]}
    except TooLarge:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadReport(file, f"is unreadable ({error!r})", "remove it to begin anew") from error

"""The `dnet` command: a union of commands, parsed by tyro, run, its errors said in one line."""

import errno
import os
import sys
from collections.abc import Sequence
from typing import Annotated, Any, Union

import tyro

from dnet.commands.demo import Demo
from dnet.commands.doctor import Doctor
from dnet.commands.evaluate import Evaluate
from dnet.commands.export import Export
from dnet.commands.inspect import Inspect
from dnet.commands.play import Play
from dnet.commands.record import Record
from dnet.commands.reproduce import Reproduce
from dnet.commands.servo import Servo
from dnet.commands.train import Train
from dnet.errors import DiskFailed, DnetError
from dnet.packages import needed_for

DESCRIPTION = """An open DeformerNet: simulate a da Vinci robot that deforms soft tissue, log it,
learn from the logs, and drive the tissue to a goal shape.

  dnet record data --pairs 4 --shapes 20
  dnet train --from-mcap data --out run
  dnet servo --checkpoint run --goal data/episode-0-00000.mcap --out servo
  dnet play servo/run.rrd

`dnet COMMAND --help` teaches each."""

Command = Record | Train | Servo | Play | Inspect | Evaluate | Export | Reproduce | Demo | Doctor
COMMANDS: dict[str, type[Command]] = {
    "record": Record,
    "train": Train,
    "servo": Servo,
    "play": Play,
    "inspect": Inspect,
    "evaluate": Evaluate,
    "export": Export,
    "reproduce": Reproduce,
    "demo": Demo,
    "doctor": Doctor,
}

OF_THE_DISK = frozenset(
    getattr(errno, name)
    for name in ("EACCES", "EDQUOT", "EFBIG", "EIO", "ENOSPC", "EPERM", "EROFS")
)
"""What is wrong with a disk, and not with dnet."""


def parse(arguments: Sequence[str]) -> Command:
    """Return the command that the arguments name, with its options.

    Where no command is named, each is described by its first line; its own help says the rest.
    """
    named = bool(arguments) and arguments[0] in COMMANDS

    def described(name: str, command: type[Command]) -> object:
        first_line = (command.__doc__ or "").split("\n")[0]
        description = None if named else first_line
        return Annotated[command, tyro.conf.subcommand(name, description=description)]

    union: Any = Union[tuple(described(*entry) for entry in COMMANDS.items())]  # noqa: UP007
    chosen: Command = tyro.cli(union, prog="dnet", description=DESCRIPTION, args=arguments)
    return chosen


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command that the arguments name, by default those of the process.

    Exits with 0; with 1 and one line on stderr where dnet refuses; with 2 for arguments that it
    cannot read; with 130 after Ctrl-C.
    """
    given = sys.argv[1:] if arguments is None else arguments
    try:
        with needed_for(" ".join(["dnet", *given[:1]])):
            parse(given).run()
    except DnetError as error:
        sys.exit(f"dnet: {_printable(str(error))}")
    except KeyboardInterrupt:
        print("dnet: interrupted; what was finished is kept", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        # Somebody piped us into `head`: not our error, and nothing more can be said there.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        if error.errno not in OF_THE_DISK:
            raise
        sys.exit(f"dnet: {_printable(str(DiskFailed(error)))}")


def _printable(text: str) -> str:
    """Return `text` without what would steer a terminal: names in a file may hold anything."""
    return "".join(
        char if char.isprintable() or char == "\n" else char.encode("unicode_escape").decode()
        for char in text
    )

"""The `dnet` command: a union of commands, parsed by tyro, run, its errors said in one line."""

import os
import sys
from typing import Annotated

import tyro

from dnet.commands.record import Record
from dnet.errors import DnetError

Command = (
    Annotated[Record, tyro.conf.subcommand("record")]
    | Annotated[Record, tyro.conf.subcommand("record2")]
)


def main() -> None:
    """Run the command that the arguments name.

    Exits with 0, with 1 and one line on stderr where dnet refuses, with 2 for arguments that it
    cannot read, with 130 after Ctrl-C.
    """
    command = tyro.cli(Command, prog="dnet", description=__doc__)
    try:
        command.run()
    except DnetError as error:
        sys.exit(f"dnet: {error}")
    except KeyboardInterrupt:
        print("dnet: interrupted; what was finished is kept", file=sys.stderr)  # noqa: T201
        sys.exit(130)
    except BrokenPipeError:
        # Somebody piped us into `head`: not our error, and nothing more can be said there.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)

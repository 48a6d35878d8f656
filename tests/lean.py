"""The command as it runs where some packages are not installed, in it and in its processes."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
HIDING = """
import sys
from importlib.machinery import PathFinder

class WithoutThem(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        hidden = name.partition(".")[0] in {hidden!r}
        return None if hidden else super().find_spec(name, path, target)

sys.meta_path[:] = [WithoutThem if one is PathFinder else one for one in sys.meta_path]
"""
"""Python runs a module of the name `sitecustomize` before anything else."""


CALLING = """
import sys
from dnet.cli import main

for arguments in {calls!r}:
    try:
        main(arguments)
    except SystemExit as ended:
        print(ended.code, file=sys.stderr, flush=True)
"""


def run(
    *calls: Sequence[object], without: Sequence[str], directory: Path
) -> "subprocess.CompletedProcess[str]":
    """Run `dnet` with each of `calls` in `directory`, without the modules named in `without`.

    One process does for all of them; with what status each ended stands on stderr.
    """
    hiding = directory / ".hiding"
    hiding.mkdir(exist_ok=True)
    (hiding / "sitecustomize.py").write_text(HIDING.format(hidden=tuple(without)))
    texts = [[str(argument) for argument in call] for call in calls]
    return subprocess.run(
        [sys.executable, "-c", CALLING.format(calls=texts)],
        capture_output=True,
        text=True,
        check=True,
        cwd=directory,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(hiding), str(ROOT)])},
    )

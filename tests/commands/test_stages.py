import json
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from rich.console import Console

from dnet.commands.stages import Stages
from dnet.errors import OccupiedOutput


@dataclass
class Append:
    """A stage that leaves a line."""

    file: Path

    def run(self) -> None:
        with self.file.open("a") as lines:
            lines.write("done\n")


class Stopped:
    """A stage in which somebody presses Ctrl-C."""

    def run(self) -> None:
        time.sleep(0.02)
        raise KeyboardInterrupt


def stages(out: Path, scale: float = 1.0) -> Stages:
    return Stages(out / "work.json", {"scale": scale}, Console(quiet=True))


def test_a_finished_stage_is_not_done_again(tmp_path: Path) -> None:
    lines = tmp_path / "lines"
    for _ in range(2):
        stages(tmp_path).run("one", "dnet one", Append(lines))
    assert lines.read_text() == "done\n"


def test_a_stopped_stage_is_done_again_and_its_time_counts(tmp_path: Path) -> None:
    chain = stages(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        chain.run("one", "dnet one", Stopped())
    assert chain.seconds == {}
    again = stages(tmp_path)
    again.run("one", "dnet one", Append(tmp_path / "lines"))
    assert again.seconds["one"] > 0.02
    assert (tmp_path / "lines").read_text() == "done\n"


def test_a_chain_with_other_options_is_refused(tmp_path: Path) -> None:
    stages(tmp_path).run("one", "dnet one", Append(tmp_path / "lines"))
    with pytest.raises(OccupiedOutput, match=r"a work with other options \(\{'scale': 1.0\}\)"):
        stages(tmp_path, scale=0.5)


def test_after_a_kill_the_chain_goes_on_with_the_stage_under_way(tmp_path: Path) -> None:
    script = f"""
import time
from pathlib import Path
from tests.commands.test_stages import Append, stages

class Long:
    def run(self):
        Append(Path({str(tmp_path / "begun")!r})).run()
        time.sleep(60)

chain = stages(Path({str(tmp_path)!r}))
chain.run("one", "dnet one", Append(Path({str(tmp_path / "one")!r})))
chain.run("two", "dnet two", Long())
"""
    with subprocess.Popen([sys.executable, "-c", script]) as process:
        deadline = time.monotonic() + 30
        while not (tmp_path / "begun").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
    assert set(json.loads((tmp_path / "work.json").read_text())["seconds"]) == {"one"}
    chain = stages(tmp_path)
    chain.run("one", "dnet one", Append(tmp_path / "one"))
    chain.run("two", "dnet two", Append(tmp_path / "two"))
    assert (tmp_path / "one").read_text() == (tmp_path / "two").read_text() == "done\n"

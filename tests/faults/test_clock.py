"""A wall clock that jumps by a day, forth and back: no byte and no time limit depends on it."""

import ast
import itertools
import json
import shutil
import subprocess
import time
from pathlib import Path

import pytest

import dnet
from dnet.cli import main
from tests.faults.children import elsewhere
from tests.recorders import rollout
from tests.recording.synthetic import contents

QUICK = ("--world", "quasistatic")
SOURCES = Path(dnet.__file__).parent
WALL = {"time.time", "time.time_ns", "datetime.now", "datetime.utcnow", "datetime.today"}
SERVO = ("servo", "--goal", "random:3", "--controller", "oracle", *QUICK)
RECORD = ("--pairs", "2", "--shapes", "1", "--points", "64", *QUICK)


def test_only_the_end_of_an_episode_in_the_timings_is_told_by_the_wall_clock() -> None:
    found = []
    for path in sources():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and ast.unparse(node) in WALL:
                found.append(path.name)
            if isinstance(node, ast.ImportFrom) and node.module == "time":
                found += [path.name for name in node.names if name.name in ("time", "time_ns")]
    assert found == ["manifest.py"]


def sources() -> list[Path]:
    """All modules; three of the folders are links."""
    linked = [SOURCES / name for name in ("recorders", "datasets", "tools")]
    return [path for folder in (SOURCES, *linked) for path in folder.resolve().rglob("*.py")]


def work(folder: str) -> None:
    out = Path(folder)
    looks = [time.time() for _ in range(4)]
    assert max(abs(b - a) for a, b in itertools.pairwise(looks)) > 86_000
    main(["record", str(out / "data"), *RECORD])
    main([*SERVO, "--out", str(out / "servo")])
    for number in range(3):
        seen = rollout.frames(3, seed=number, points=128)
        rollout.write(out / "boxes" / f"episode-{number}.mcap", seen)
    asked = ["train", "--from-mcap", str(out / "boxes"), "--device", "cpu"]
    clock = time.monotonic()
    main([*asked, "--out", str(out / "run"), "--epochs", "1000000", "--minutes", "0.05"])
    assert 3 < time.monotonic() - clock < 120


@pytest.mark.slow
def test_recording_servoing_and_a_time_limit_go_by_other_clocks(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (cc) to make a clock that jumps; apt-get install gcc brings one")
    source, library = Path(__file__).with_name("jumping_clock.c"), tmp_path / "clock.so"
    made = [compiler, "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"]
    subprocess.run(made, check=True)
    out = tmp_path / "out"
    elsewhere(work, out, environment={"LD_PRELOAD": str(library)})
    main(["record", str(tmp_path / "data"), *RECORD])
    main([*SERVO, "--out", str(tmp_path / "servo")])
    assert contents(out / "data") == contents(tmp_path / "data")
    runs = [folder / "servo" / "run.mcap" for folder in (out, tmp_path)]
    assert runs[0].read_bytes() == runs[1].read_bytes()
    lines = (out / "run" / "metrics.jsonl").read_text().splitlines()
    seconds = [json.loads(line)["seconds"] for line in lines]
    assert seconds == sorted(seconds)
    assert 0 < seconds[-1] < 120

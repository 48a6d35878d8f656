"""The tests notice when a line of arithmetic is wrong: each mutant is run against them.

`make slow` runs this, or `python -m pytest -m slow tests/mutation`.
"""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tests.mutation.mutants import MUTANTS, Mutant

ROOT = Path(__file__).parents[2]
TREE = ("dnet", "recorders", "datasets", "tools", "tests", "pyproject.toml")
FAILED = 1
"""What pytest exits with when tests ran and some failed; a file that is broken exits with 2."""


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("mutation") / "tree"
    copy.mkdir()
    for name in TREE:
        place = ROOT / name
        if place.is_file():
            shutil.copy2(place, copy / name)
        else:
            # What numba compiled says nothing of other lines.
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(place, copy / name, symlinks=True, ignore=ignored)
    return copy


def exit_code(tree: Path, tests: tuple[str, ...]) -> int:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    # Random examples find a mistake on some days; those that are written down find it on each.
    command += ["-m", "not hypothesis"]
    # Two trees of the same age and size would pass for one among Python's compiled files.
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, check=False
    ).returncode


unmutated = cache(exit_code)
"""Tests of several mutants run once without them."""


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda one: one.name)
def test_each_line_stands_in_its_file_once(mutant: Mutant) -> None:
    lines = [line.strip() for line in (ROOT / mutant.file).read_text().splitlines()]
    assert lines.count(mutant.line) == 1
    assert mutant.mistake != mutant.line


@pytest.mark.slow
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda one: one.name)
def test_tests_fail_for_a_wrong_line_and_pass_for_the_right_one(mutant: Mutant, tree: Path) -> None:
    file = tree / mutant.file
    right = file.read_text(encoding="utf-8")
    assert unmutated(tree, mutant.tests) == 0
    file.write_text(right.replace(mutant.line, mutant.mistake), encoding="utf-8")
    try:
        assert exit_code(tree, mutant.tests) == FAILED
    finally:
        file.write_text(right, encoding="utf-8")

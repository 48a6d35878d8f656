"""The page that says what survives which fault names tests that there are."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reliability.md"
ROW = re.compile(r"^\|.*\|$", re.MULTILINE)
NAMED = re.compile(r"`(tests/[\w/]+/test_\w+\.py)::(test_\w+)`")


def functions(file: Path) -> set[str]:
    """The tests that pytest finds in a module."""
    found = ast.parse(file.read_text(encoding="utf-8")).body
    return {one.name for one in found if isinstance(one, ast.FunctionDef)}


def test_every_test_that_the_page_names_is_there() -> None:
    named = NAMED.findall(PAGE.read_text(encoding="utf-8"))
    assert len(named) > 30
    for path, name in named:
        assert name in functions(ROOT / path), f"{path} has no {name}"


def test_every_row_names_a_test() -> None:
    rows = [row for row in ROW.findall(PAGE.read_text(encoding="utf-8")) if "---" not in row]
    for row in rows:
        assert row.startswith("| fault |") or NAMED.search(row), row
        assert row.count("|") == 5, row

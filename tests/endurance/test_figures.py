"""What is measured is what is held: what was asked for counts, and what was given back does not."""

from pathlib import Path

from tests.endurance.figures import Table, measure, read_table
from tests.endurance.memory_of_c import ask_and_give_back
from tests.faults.children import elsewhere


def test_what_c_code_asks_for_counts_until_it_is_given_back(tmp_path: Path) -> None:
    # A training tells C to keep what is given back, in whatever process it ran.
    elsewhere(ask_and_give_back, tmp_path)


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "figures.csv"
    table = Table(path)
    table.add(measure(tmp_path, number=0, hours=0.25))
    assert read_table(path) == table.rows
    table.close()

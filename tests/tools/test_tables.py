import polars as pl
import pytest

from dnet.tools.tables import print_table


def test_a_table_in_a_pipe_is_printed_whole(capsys: pytest.CaptureFixture[str]) -> None:
    name = "episode-" + "0" * 120
    frame = pl.DataFrame(
        {"episode": [name], "x": [0.123456], "mm": [1.0], "frames": [None], "finished": [True]}
    )
    print_table(frame)
    header, row = capsys.readouterr().out.splitlines()
    assert header.split() == frame.columns
    assert row.split() == [name, "0.1235", "1.00", "-", "yes"]


def test_brackets_are_no_markup(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(pl.DataFrame({"episode": ["[bold]a[/bold]"]}))
    assert "[bold]a[/bold]" in capsys.readouterr().out

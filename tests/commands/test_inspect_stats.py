import json
from pathlib import Path

import pytest
import tyro

from dnet.commands.inspect import Inspect
from dnet.commands.inspect_stats import Stats
from dnet.errors import NoEpisodes, UnknownPicture
from tests.recorders.rollout import frames, write


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Two episodes, one broken one, and how long they took."""
    directory = tmp_path / "data"
    write(directory / "a.mcap", frames(6))
    write(directory / "b.mcap", frames(4, seed=1))
    (directory / "c.mcap").write_bytes(b"something else")
    line = '{"worker": 1, "shapes": 5, "seconds": 10, "cpu_seconds": 5, "ended": "2026-01-01"}\n'
    (directory / "timings.jsonl").write_text(line + line[:20])
    return directory


def run(*arguments: str | Path) -> None:
    tyro.cli(Inspect, args=["stats", *(str(argument) for argument in arguments)]).run()


def test_its_word_is_stats() -> None:
    assert tyro.cli(Inspect, args=["stats", "data"]) == Inspect(Stats(Path("data")))


def test_it_prints_every_figure(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(data)
    out, err = capsys.readouterr()
    lines = [line.split() for line in out.splitlines()]
    assert err == ""
    assert lines[0][:7] == ["episodes", "2", "finished,", "0", "unfinished,", "1", "broken"]
    assert lines[1] == ["frames", "18:", "2", "rest,", "8", "shape,", "8", "way"]
    assert ["box", "100", "x", "100", "x", "40", "1", "2", "8"] in lines
    assert ["any", "two", "42"] in [line[:3] for line in lines]
    assert ["rest", "to", "shape", "8"] in [line[:4] for line in lines]
    assert ["folded", "4", "33.33", "12", "shapes"] in [line[:3] + line[-2:] for line in lines]
    assert ["one", "worker", "0.00", "0.50"] in lines
    assert out.endswith("1 cut-off lines of timings.jsonl do not count\n")


def test_bars_add_up_to_the_shapes(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(data)
    lines = capsys.readouterr().out.splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith("its length"))
    rows = [line.split() for line in lines[start + 2 : lines.index("", start)]]
    assert sum(int(row[1]) for row in rows) == 8
    assert all((len(row) == 4) == (int(row[1]) > 0) for row in rows)
    fullest = max(rows, key=lambda row: int(row[1]))
    assert fullest[3] == "█" * 40


def test_json_is_one_object_with_the_same_figures(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(data, "--json")
    figures = json.loads(capsys.readouterr().out)
    assert figures["directory"] == str(data)
    assert figures["files"]["broken"] == 1
    assert figures["frames"] == {"rest": 2, "shape": 8, "way": 8}
    assert figures["any_pair"]["pairs"] == 6 * 5 + 4 * 3
    assert figures["draws"]["rejected"] == [{"reason": "folded", "count": 4, "share": 4 / 12}]
    assert sum(figures["displacement_mm"]["length"]["histogram"]["counts"]) == 8
    assert figures["speed"]["cpu"]["shapes_per_second"] == 1.0
    assert figures["deviation"] is None


def test_plot_draws_a_picture_besides(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(data)
    alone = capsys.readouterr().out
    run(data, "--plot", tmp_path / "new" / "stats.png")
    assert capsys.readouterr().out == alone
    assert (tmp_path / "new" / "stats.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_of_no_kind_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    with pytest.raises(UnknownPicture, match=r"stats\.gif"):
        run(tmp_path / "nowhere", "--plot", "stats.gif")


def test_nothing_recorded_says_how_to_record(tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes, match="dnet record"):
        run(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_recording_without_a_shape_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "a.mcap", frames(1))
    write(tmp_path / "b.mcap", [])
    run(tmp_path)
    out = capsys.readouterr().out
    assert "frames     1: 1 rest, 0 shape, 0 way" in out
    assert "displacement" not in out
    assert "motions" not in out

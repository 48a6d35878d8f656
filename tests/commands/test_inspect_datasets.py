import json
from pathlib import Path

import pytest
import tyro

from dnet.commands.inspect import Inspect
from dnet.datasets.index import INDEX
from dnet.errors import MissingPath, NothingMatches, UnlikePaths
from tests.datasets.dataset import write_dataset


def run(*arguments: str | Path) -> None:
    tyro.cli(Inspect, args=[str(argument) for argument in arguments]).run()


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return write_dataset(tmp_path / "data", (3, 2, 4))


def test_split_then_merge_is_the_same_dataset(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("split", data, "--out", tmp_path / "split", "--validation", "0.4")
    sides = [tmp_path / "split" / name for name in ("training", "validation")]
    out = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in out] == [str(side) for side in sides]
    run("merge", *sides, "--out", tmp_path / "merged")
    assert capsys.readouterr().out == f"3 episodes in {tmp_path / 'merged'}\n"
    assert (tmp_path / "merged" / INDEX).exists()
    run("diff", data, tmp_path / "merged")
    assert capsys.readouterr().out == "3 files, the same in both\n"


def test_filter_prints_what_matches_and_makes_a_dataset_of_it(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("filter", data, "kind = 'shape' and frame > 5", "--out", tmp_path / "far")
    header, row, sums = capsys.readouterr().out.splitlines()
    assert header.split()[:3] == ["episode", "frame", "kind"]
    assert row.split()[:3] == ["episode-2", "6", "shape"]
    assert sums.startswith("1 of 15 frames, in 1 of 3 episodes; those episodes are in ")
    assert [path.name for path in (tmp_path / "far").iterdir()] == ["episode-2.mcap"]
    with pytest.raises(NothingMatches, match="'frame > 99' holds for none of 15 frames"):
        run("filter", data, "frame > 99", "--out", tmp_path / "none")
    assert not (tmp_path / "none").exists()
    run("filter", data, "kind = 'shape'", "--episodes", "--json")
    assert [row["frames"] for row in json.loads(capsys.readouterr().out)] == [2, 1, 3]


def test_diff_exits_with_1_where_there_is_a_difference(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("diff", data / "episode-0.mcap", data / "episode-0.mcap")
    assert capsys.readouterr().out == "no difference: the same bytes\n"
    with pytest.raises(SystemExit) as ended:
        run("diff", data / "episode-0.mcap", data / "episode-2.mcap")
    assert ended.value.code == 1
    assert "episode_id: episode-0 and episode-2" in capsys.readouterr().out
    other = write_dataset(tmp_path / "other", (3, 2))
    with pytest.raises(SystemExit):
        run("diff", data, other, "--json")
    assert json.loads(capsys.readouterr().out) == [
        {"file": "episode-2.mcap", "difference": f"only in {data}"}
    ]


def test_diff_compares_like_with_like(data: Path) -> None:
    file = data / "episode-0.mcap"
    for pair in ((data, file), (file, data)):
        with pytest.raises(UnlikePaths, match=r"data is a directory and .*mcap is a file"):
            run("diff", *pair)
    with pytest.raises(MissingPath, match="nowhere does not exist"):
        run("diff", data, data / "nowhere")

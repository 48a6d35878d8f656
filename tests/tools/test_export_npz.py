"""What is exported is whole, under its name or not there, and numpy reads it bit for bit."""

import json
import os
import shutil
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tyro

from dnet.commands.inspect_export import Export
from dnet.datasets.index import open_index
from dnet.errors import BadEpisode, MissingPath, NoEpisodes, OccupiedOutput, UnusedOption, Unwritten
from dnet.tools.export_hdf5 import export_hdf5
from dnet.tools.export_lerobot import export_lerobot
from dnet.tools.export_npz import export_npz
from dnet.tools.export_parquet import export_parquet
from dnet.tools.exported_output import Exported
from tests.recorders import rollout
from tests.tools.exported import assert_frames, logged, logged_meta, plain, write_exportable

EXPORTS: list[Callable[..., Exported]] = [export_npz, export_parquet, export_hdf5, export_lerobot]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_exportable(tmp_path_factory.mktemp("exported") / "data")


def test_numpy_reads_the_frames_bit_for_bit(tmp_path: Path, data: Path) -> None:
    done = export_npz(open_index(data), tmp_path / "out")
    assert (done.episodes, done.frames) == (3, 7 + 1 + 11)
    files = sorted((tmp_path / "out").iterdir())
    assert done.bytes == sum(path.stat().st_size for path in files)
    assert [path.name for path in files] == [f"episode-{number}.npz" for number in range(3)]
    for path in files:
        log = data / f"{path.stem}.mcap"
        with np.load(path, allow_pickle=False) as arrays:
            assert_frames(dict(arrays), logged(log))
            assert json.loads(str(arrays["meta"])) == plain(logged_meta(log))


def test_clouds_of_several_sizes_have_an_array_each(tmp_path: Path) -> None:
    seen = rollout.frames(3)
    seen[1] = replace(seen[1], cloud=seen[1].cloud[:9], nodes=seen[1].nodes[:0])
    (tmp_path / "data").mkdir()
    log = rollout.write(tmp_path / "data" / "a.mcap", seen)
    index = open_index(tmp_path / "data")
    export_npz(index, tmp_path / "out")
    with np.load(tmp_path / "out" / "a.npz", allow_pickle=False) as found:
        arrays = dict(found)
    for name, one in (("clouds", "cloud"), ("nodes", "nodes")):
        assert name not in arrays
        arrays[name] = [arrays[f"{one}_{number:03d}"] for number in range(5)]
    assert_frames(arrays, logged(log))
    for export in (export_parquet, export_lerobot):
        with pytest.raises(BadEpisode, match=r"9 points at frame 1.*npz or hdf5"):
            export(index, tmp_path / "table")
    with pytest.raises(BadEpisode, match="several numbers of points"):
        export_parquet(index, tmp_path / "table", per_episode=True)
    assert not (tmp_path / "table").exists()
    assert not (tmp_path / "table.part").exists()


@pytest.mark.parametrize("export", EXPORTS)
def test_an_export_replaces_nothing(
    tmp_path: Path, data: Path, export: Callable[..., Exported]
) -> None:
    index = open_index(data)
    for name in ("out", "out.part"):
        (tmp_path / name).write_bytes(b"mine")
        with pytest.raises(OccupiedOutput, match=name):
            export(index, tmp_path / "out")
        assert (tmp_path / name).read_bytes() == b"mine"
        (tmp_path / name).unlink()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
@pytest.mark.parametrize("export", EXPORTS)
def test_what_is_interrupted_leaves_nothing(
    tmp_path: Path, data: Path, export: Callable[..., Exported], error: type[BaseException]
) -> None:
    index = open_index(data)
    there: list[bool] = []

    def stop(done: int, _total: int) -> None:
        there.append((tmp_path / "new" / "out.part").exists())
        if done == 2 and error is KeyboardInterrupt:
            os.kill(os.getpid(), signal.SIGINT)
        elif done == 2:
            raise error

    # A shell that starts tests in the background has them ignore Ctrl-C.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(error):
            export(index, tmp_path / "new" / "out", on_episode=stop)
    finally:
        signal.signal(signal.SIGINT, before)
    assert there[:2] == [True, True]
    assert not list((tmp_path / "new").iterdir())


@pytest.mark.parametrize("export", EXPORTS)
def test_a_place_that_takes_nothing_is_named(
    tmp_path: Path, data: Path, export: Callable[..., Exported]
) -> None:
    index = open_index(data)
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(Unwritten, match=r"nothing can be written into .*file"):
        export(index, tmp_path / "file" / "out")


def test_what_counts_twice_or_not_at_all_is_refused(tmp_path: Path, data: Path) -> None:
    copy = tmp_path / "data"
    shutil.copytree(data, copy)
    shutil.copy(copy / "episode-1.mcap", copy / "copy.mcap")
    index = open_index(copy)
    for export in EXPORTS:
        with pytest.raises(BadEpisode, match="same episode as copy"):
            export(index, tmp_path / "out")
    for path in copy.glob("*[0-9y].mcap"):
        path.unlink()
    index = open_index(copy)
    for export in EXPORTS:
        with pytest.raises(NoEpisodes, match=r"no \.mcap episode with a frame"):
            export(index, tmp_path / "out")
    assert not list(tmp_path.glob("out*"))


def test_a_log_that_vanishes_meanwhile_leaves_nothing(tmp_path: Path, data: Path) -> None:
    copy = tmp_path / "data"
    shutil.copytree(data, copy)
    index = open_index(copy)
    (copy / "episode-2.mcap").unlink()
    for export in EXPORTS:
        with pytest.raises(MissingPath, match="episode-2"):
            export(index, tmp_path / "out")
        assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize("form", ["npz", "parquet", "hdf5", "lerobot"])
def test_the_command_says_what_it_wrote_and_what_it_left_out(
    tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str], form: str
) -> None:
    out = tmp_path / "out"
    tyro.cli(Export, args=[str(data), "--to", form, "--out", str(out)]).run()
    left, done = capsys.readouterr().out.splitlines()
    assert left.startswith("left out broken.mcap: ")
    assert done.startswith("3 episodes, 19 frames")
    assert done.endswith(f"as {form} in {out}")
    args = [os.fspath(data), "--to", form, "--out", str(tmp_path / "again"), "--json"]
    tyro.cli(Export, args=args).run()
    told = json.loads(capsys.readouterr().out)
    assert (told["episodes"], told["frames"], told["format"]) == (3, 19, form)
    assert list(told["left_out"]) == ["broken.mcap"]


def test_an_option_that_does_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnusedOption, match="--per-episode does nothing without --to parquet"):
        Export(tmp_path, "npz", tmp_path / "out", per_episode=True).run()

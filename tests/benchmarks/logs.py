"""How fast logs are written and read, next to what else people keep clouds in.

    python -m tests.benchmarks.logs
    python -m tests.benchmarks.logs --data data/paper

Processor seconds, of pages that are in memory, so that neither a disk nor other work on the
machine counts. Every reader gives the same clouds as float32 arrays, and touches all their bytes.
Peers come with `pip install -e ".[peers]"`; LeRobot, which asks for other versions of torch, in a
Python of its own that DNET_PEERS names.
"""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import polars as pl
import tyro
from rich.console import Console
from rich.table import Table

from dnet.datasets.batch_order import BatchOrder
from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import FrameTable, settled_frames
from dnet.datasets.index import INDEX, Index, open_index
from dnet.datasets.index_file import pack_index, unpack_index
from dnet.datasets.pairs import any_two
from dnet.datasets.samples import Samples
from dnet.datasets.stream import Stream
from dnet.recorders import messages
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.mcap_sink import McapSink
from dnet.types import Frame
from tests.benchmarks.pace import REPEATS, at_random, sequential
from tests.benchmarks.peers import PEERS, Kept, Unavailable, lerobot_speeds
from tests.recorders import rollout

RANDOM = 4000
"""Clouds that are read at random; fewer of a reader that is slow."""
SAMPLES = 20_000
MANY = 1_000_000
"""Frames of the large index."""


@dataclass(frozen=True)
class Benchmark:
    """Measure how fast logs are written and read."""

    data: Path | None = None
    """Episodes of `dnet record`; left out, made-up ones are written."""
    episodes: int = 150
    """How many are made up."""
    shapes: int = 20
    """Shapes of each."""
    points: int = 2048
    peers: bool = True
    """Also measure other readers, those that are installed."""

    def run(self) -> None:
        """Measure and print."""
        console = Console(width=110)
        with tempfile.TemporaryDirectory() as folder:
            scratch = Path(folder)
            root = self.data or self._made_up(scratch / "data", console)
            index = _opened(root, console)
            table = settled_frames(index)
            self._compare(index, scratch, console)
            _stream(table, console)
            _query(index, console)
            _written(Clouds(table), scratch, console)

    def _made_up(self, folder: Path, console: Console) -> Path:
        folder.mkdir()
        rng = np.random.default_rng(0)
        begin = process_time()
        for number in range(self.episodes):
            seen = rollout.frames(self.shapes + 1, seed=number, points=self.points)
            path = folder / f"episode-{number:05}.mcap"
            with EpisodeWriter(
                path, rollout.meta(path.stem), arms=rollout.ARMS, attachments={}
            ) as writer:
                for one in seen:
                    if one.kind != "way":
                        writer.add(_noisy(one, rng))
                writer.finish({"frames": len(writer)})
        size = sum(path.stat().st_size for path in folder.iterdir())
        console.print(
            f"{self.episodes} episodes of {self.shapes + 1} frames, {size / 1e6:.0f} MB, "
            f"made up and written in {process_time() - begin:.1f} CPU s"
        )
        return folder

    def _compare(self, index: Index, scratch: Path, console: Console) -> None:
        table = settled_frames(index)
        clouds = Clouds(table)
        rows = np.random.default_rng(1).integers(len(table), size=RANDOM).tolist()
        shown = Table(
            "reader",
            *("sequential MB/s", "of memmap", "random clouds/s", "of memmap", "of stock mcap"),
            title=f"{len(table)} clouds of {table.points} points, per CPU-second",
        )
        found: dict[str, tuple[float | None, float | None]] = {}
        missing: list[str] = []
        for peer in PEERS if self.peers else PEERS[:3]:
            with ExitStack() as stack:
                try:
                    kept = peer.keep(clouds, scratch / "peers")
                except Unavailable as error:
                    missing.append(f"{peer.name}: {error}")
                    continue
                stack.callback(kept.close)
                _require_same(kept, clouds, peer.name)
                found[peer.name] = (
                    kept.sequential and sequential(kept.sequential),
                    kept.random and at_random(kept.random, rows),
                )
        if self.peers:
            try:
                found["LeRobot"] = lerobot_speeds(index, rows, scratch)
            except Unavailable as error:
                missing.append(f"LeRobot: {error}")
        limit, stock = found["npy memmap"], found["mcap, stock reader"]
        for name, (in_order, scattered) in found.items():
            shown.add_row(
                name,
                *(_number(in_order), _ratio(in_order, limit[0])),
                *(_number(scattered), _ratio(scattered, limit[1]), _ratio(scattered, stock[1])),
            )
        console.print(shown)
        for line in missing:
            console.print(f"not measured: {line}", markup=False)


def _noisy(one: Frame, rng: np.random.Generator) -> Frame:
    noise = rng.normal(scale=1e-4, size=one.cloud.shape).astype(np.float32)
    return replace(one, cloud=one.cloud + noise)


def _opened(root: Path, console: Console) -> Index:
    (root / INDEX).unlink(missing_ok=True)
    begin = process_time()
    index = open_index(root, workers=1)
    cold = process_time() - begin
    begin = perf_counter()
    clouds = Clouds(settled_frames(open_index(root)))
    first = np.flatnonzero(np.diff(clouds.table.file, prepend=-1))
    for row in first.tolist():
        clouds[row].sum()
    warm = perf_counter() - begin
    files = index.files.height
    console.print(
        f"indexing {files} episodes: {1e3 * cold / files:.1f} CPU ms each; opening all of them "
        f"with a warm index, a cloud of each read: {warm:.3f} s"
    )
    return index


def _require_same(kept: Kept, clouds: Clouds, name: str) -> None:
    if kept.random is not None:
        row = len(clouds) // 2
        np.testing.assert_array_equal(kept.random(row), clouds[row], err_msg=name)
    if kept.sequential is not None:
        first = next(iter(kept.sequential()))
        np.testing.assert_array_equal(first, clouds[0], err_msg=name)


def _stream(table: FrameTable, console: Console) -> None:
    samples = Samples(Clouds(table), any_two(table))
    stream = Stream(samples, BatchOrder(len(samples), 32))
    speeds = []
    for _ in range(REPEATS):
        seen, begin = 0, process_time()
        for batch in stream:
            seen += len(batch)
            if seen >= SAMPLES:
                break
        speeds.append(seen / (process_time() - begin))
    console.print(
        f"samples (current, goal, motion), shuffled over {len(table.names)} episodes: "
        f"{max(speeds):.0f} a CPU-second; {len(samples)} of them, their order takes no memory, "
        f"a frame {_bytes(table) / len(table):.0f} bytes"
    )


def _bytes(table: FrameTable) -> int:
    arrays = (table.file, table.frame, table.rest, table.grasps, table.data, table.places)
    return sum(array.nbytes for array in arrays)


def _query(index: Index, console: Console) -> None:
    times = -(-MANY // index.frames.height)
    renamed = [pl.format("{}-{}", pl.lit(copy), "name") for copy in range(times)]
    files, frames = (
        pl.concat([table.with_columns(name=name) for name in renamed])
        for table in (index.files, index.frames)
    )
    moved = np.random.default_rng(2).normal(scale=0.03, size=(3, frames.height))
    columns = {f"motion_{axis}": values for axis, values in zip("xyz", moved, strict=True)}
    content = pack_index(files, frames.with_columns(**columns))
    begin = perf_counter()
    _, frames = unpack_index(content, most=files.height)
    found = (
        frames.filter((pl.col("kind") == "shape") & (pl.col("motion_z") > 0.02))
        .group_by("name")
        .agg(pl.len(), pl.col("motion_x").mean())
    )
    console.print(
        f"an index of {frames.height} frames, {len(content) / 1e6:.0f} MB, asked for the shapes "
        f"that were lifted by 2 cm, by episode ({found.height}): {perf_counter() - begin:.3f} s"
    )


def _written(clouds: Clouds, scratch: Path, console: Console) -> None:
    count = min(len(clouds), 2000)

    def sink() -> int:
        writer = McapSink(scratch / "clouds.mcap")
        for number in range(count):
            writer.put("/cloud/current", messages.point_cloud(clouds[number], number), number)
            writer.flush()
        writer.close()
        return (scratch / "clouds.mcap").stat().st_size

    def frames() -> int:
        path = scratch / "frames.mcap"
        path.unlink(missing_ok=True)
        seen = list(_frames(clouds, count))
        meta = rollout.meta()
        begin = process_time()
        with EpisodeWriter(path, meta, arms=rollout.ARMS, attachments={}) as writer:
            for one in seen:
                writer.add(one)
            writer.finish({})
        spent.append(process_time() - begin)
        return path.stat().st_size

    spent: list[float] = []
    whole = max(frames() / 1e6 / spent[-1] for _ in range(REPEATS))
    console.print(
        f"written a CPU-second, each flushed: clouds {_best(sink):.0f} MB, whole frames with "
        f"joints, transforms and nodes {whole:.0f} MB, {count / min(spent):.0f} frames"
    )


def _frames(clouds: Clouds, count: int) -> Iterator[Frame]:
    one = rollout.frame(0.0, np.zeros(3), "rest")
    for number in range(count):
        yield replace(one, cloud=np.array(clouds[number]), time=float(number))


def _best(write: Callable[[], int]) -> float:
    speeds = []
    for _ in range(REPEATS):
        begin = process_time()
        size = write()
        speeds.append(size / 1e6 / (process_time() - begin))
    return max(speeds)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:,.0f}"


def _ratio(value: float | None, limit: float | None) -> str:
    if value is None or not limit:
        return "-"
    return f"{value / limit:.2f}" if value > limit / 10 else f"{value / limit:.1g}"


if __name__ == "__main__":
    tyro.cli(Benchmark).run()

"""A LeRobot dataset is what LeRobot says it is, and what it gives back is what was logged."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from dnet.datasets.index import open_index
from dnet.tools.export_lerobot import export_lerobot
from dnet.tools.lerobot_statistics import QUANTILES
from dnet.types import Frame
from tests.tools.exported import (
    LENGTHS,
    assert_bits,
    assert_frames,
    logged,
    logged_meta,
    plain,
    write_exportable,
)

PEERS = os.environ.get("DNET_PEERS", "")
SEEN_BY_LEROBOT = """
import json, sys
from importlib.metadata import version

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

root, out = sys.argv[1:]
dataset = LeRobotDataset("dnet/episodes", root=root)
items = [dataset[number] for number in range(len(dataset))]
last = dataset.num_episodes - 1
ahead = LeRobotDataset(
    "dnet/episodes", root=root, episodes=[last], delta_timestamps={"action": [0.0, 1.0]}
)
np.savez(
    out,
    cloud=np.stack([item["observation.cloud"].numpy() for item in items]),
    state=np.stack([item["observation.state"].numpy() for item in items]),
    action=np.stack([item["action"].numpy() for item in items]),
    episode=np.array([int(item["episode_index"]) for item in items]),
    kinds=np.array([item["kind"] for item in items]),
    task=np.array([item["task"] for item in items]),
    first=np.array(dataset.meta.episodes["dataset_from_index"]),
    end=np.array(dataset.meta.episodes["dataset_to_index"]),
    metas=np.array(dataset.meta.episodes["dnet.meta"]),
    mean=dataset.meta.stats["observation.cloud"]["mean"],
    ahead=np.stack([ahead[number]["action"].numpy() for number in range(len(ahead))]),
    padded=np.stack([ahead[number]["action_is_pad"].numpy() for number in range(len(ahead))]),
)
print("lerobot", version("lerobot"), "torch", version("torch"))
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_exportable(tmp_path_factory.mktemp("exported") / "data")


def exported(data: Path, out: Path, **options: Any) -> Path:
    done = export_lerobot(open_index(data), out, **options)
    assert (done.episodes, done.frames) == (3, 19)
    return out


def episodes(data: Path) -> list[list[Frame]]:
    return [logged(data / f"episode-{number}.mcap") for number in range(len(LENGTHS))]


def wanted_motions(frames: list[Frame]) -> np.ndarray:
    """By the definition: what the next settled frame is away from this one."""
    motions = []
    for number, one in enumerate(frames):
        later = [other for other in frames[number + 1 :] if other.kind != "way"]
        motions.append(later[0].grasp - one.grasp if later else np.zeros(3))
    return np.array(motions, np.float32)


def read_json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def test_polars_reads_the_frames_bit_for_bit(tmp_path: Path, data: Path) -> None:
    out = exported(data, tmp_path / "out")
    table = pl.read_parquet(out / "data" / "chunk-000" / "file-000.parquet")
    assert table["index"].to_list() == list(range(19))
    parts = table.partition_by("episode_index", maintain_order=True)
    for number, (part, frames) in enumerate(zip(parts, episodes(data), strict=True)):
        joints = part["joints"].to_numpy()
        assert_frames(
            {
                "kinds": part["kind"].to_list(),
                "times": part["time"].to_numpy(),
                "clouds": part["observation.cloud"].to_numpy(),
                "grasps": part["grasp"].to_numpy(),
                "joints": joints.reshape(-1, 2, 6),
                "nodes": [one.to_numpy() for one in part["nodes"]],
            },
            frames,
        )
        state = np.hstack([part["grasp"].to_numpy(), joints]).astype(np.float32)
        assert_bits(part["observation.state"].to_numpy(), state, np.float32)
        assert_bits(part["action"].to_numpy(), wanted_motions(frames), np.float32)
        assert part["episode_index"].unique().to_list() == [number]
        assert part["frame_index"].to_list() == list(range(len(frames)))
        assert part["timestamp"].to_list() == [float(place) for place in range(len(frames))]


def test_features_tell_type_and_shape_of_every_column(tmp_path: Path, data: Path) -> None:
    out = exported(data, tmp_path / "out")
    info = read_json(out / "meta" / "info.json")
    assert info["codebase_version"] == "v3.0"
    counts = {key: info[f"total_{key}"] for key in ("episodes", "frames", "tasks")}
    assert counts == {"episodes": 3, "frames": 19, "tasks": 1}
    assert info["splits"] == {"train": "0:3"}
    table = pl.read_parquet(out / info["data_path"].format(chunk_index=0, file_index=0))
    assert list(info["features"]) == table.columns
    types = {"float32": pl.Float32, "float64": pl.Float64, "int64": pl.Int64, "string": pl.String}
    for name, feature in info["features"].items():
        inner: Any = types[feature["dtype"]]
        shape = tuple(feature["shape"])
        if name == "nodes":
            # Meshes differ in this dataset.
            assert shape == (None, 3)
            wanted: Any = pl.List(pl.Array(inner, 3))
        else:
            wanted = inner if shape == (1,) else pl.Array(inner, shape)
        assert table.schema[name] == wanted
        assert feature["names"] is None or len(feature["names"]) == shape[0]


def test_the_table_of_episodes_says_where_each_is(tmp_path: Path, data: Path) -> None:
    # Each file ends with the first episode in it, however short.
    out = exported(data, tmp_path / "out", bytes_a_file=1)
    info = read_json(out / "meta" / "info.json")
    (path,) = (out / "meta" / "episodes").rglob("*.parquet")
    assert path == out / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    rows = pl.read_parquet(path).to_dicts()
    assert len(list((out / "data").rglob("*.parquet"))) == len(rows) == 3
    first = 0
    for number, (row, frames) in enumerate(zip(rows, episodes(data), strict=True)):
        assert row["episode_index"] == number
        assert row["length"] == len(frames)
        assert (row["dataset_from_index"], row["dataset_to_index"]) == (first, first + len(frames))
        place = {f"{key}_index": row[f"data/{key}_index"] for key in ("chunk", "file")}
        table = pl.read_parquet(out / info["data_path"].format(**place))
        assert table["index"].to_list() == list(range(first, first + len(frames)))
        assert json.loads(row["dnet.meta"]) == plain(logged_meta(data / f"episode-{number}.mcap"))
        first += len(frames)
    tasks = pl.read_parquet(out / "meta" / "tasks.parquet")
    assert tasks["task_index"].to_list() == [0]
    assert all(row["tasks"] == tasks["task"].to_list() for row in rows)


def test_statistics_are_those_of_all_frames(tmp_path: Path, data: Path) -> None:
    out = exported(data, tmp_path / "out")
    figures = read_json(out / "meta" / "stats.json")
    frames = [one for episode in episodes(data) for one in episode]
    motions = np.concatenate([wanted_motions(one) for one in episodes(data)])
    clouds = np.concatenate([one.cloud for one in frames])
    for name, values in {"observation.cloud": clouds, "action": motions}.items():
        exact = values.astype(np.float64)
        for figure in ("min", "max", "mean", "std"):
            told = getattr(exact, figure)(axis=0)
            np.testing.assert_allclose(figures[name][figure], told, rtol=1e-9, atol=1e-12)
        assert figures[name]["count"] == [len(frames)]
        # Quantiles are means of the episodes', each of which is exact.
        rows = pl.read_parquet(out / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
        for quantile in QUANTILES:
            each = np.array(rows[f"stats/{name}/{quantile}"].to_list())
            mean = np.average(each, axis=0, weights=rows["length"].to_numpy())
            np.testing.assert_allclose(figures[name][quantile], mean)
    assert "nodes" not in figures


def test_no_ground_truth_is_an_input(tmp_path: Path, data: Path) -> None:
    features = read_json(exported(data, tmp_path / "out") / "meta" / "info.json")["features"]
    inputs = {name for name in features if name.startswith("observation")}
    assert inputs == {"observation.cloud", "observation.state"}


@pytest.mark.skipif(
    not PEERS,
    reason="lerobot wants other versions than ours: install it in an environment of its own, and "
    "let DNET_PEERS name the Python of that",
)
@pytest.mark.parametrize("bytes_a_file", [1, 2**20])
def test_lerobot_opens_it_and_sees_what_was_logged(
    tmp_path: Path, data: Path, bytes_a_file: int
) -> None:
    out = exported(data, tmp_path / "out", bytes_a_file=bytes_a_file)
    seen = tmp_path / "seen.npz"
    quiet = {"HF_HOME": str(tmp_path / "hf"), "HF_HUB_OFFLINE": "1"}
    done = subprocess.run(
        [PEERS, "-W", "ignore", "-c", SEEN_BY_LEROBOT, str(out), str(seen)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | quiet,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    with np.load(seen, allow_pickle=False) as archive:
        found = dict(archive)
    frames = [one for episode in episodes(data) for one in episode]
    lengths = [len(one) for one in episodes(data)]
    motions = [wanted_motions(one) for one in episodes(data)]
    assert_bits(found["cloud"], np.stack([one.cloud for one in frames]), np.float32)
    assert_bits(found["action"], np.concatenate(motions), np.float32)
    state = np.stack([np.concatenate([one.grasp, *one.joints]) for one in frames])
    assert_bits(found["state"], state.astype(np.float32), np.float32)
    assert found["kinds"].tolist() == [one.kind for one in frames]
    assert found["episode"].tolist() == np.repeat(range(3), lengths).tolist()
    assert (found["end"] - found["first"]).tolist() == lengths
    assert found["first"].tolist() == [0, *np.cumsum(lengths)[:-1]]
    for number, text in enumerate(found["metas"]):
        assert json.loads(text) == plain(logged_meta(data / f"episode-{number}.mcap"))
    assert len(set(found["task"].tolist())) == 1
    assert "manipulation point" in found["task"][0]
    assert found["mean"].shape == (3,)
    # A look ahead ends where the episode does.
    np.testing.assert_array_equal(found["ahead"][:, 0], motions[-1])
    np.testing.assert_array_equal(found["ahead"][:-1, 1], motions[-1][1:])
    assert found["padded"].tolist() == [[False, False]] * (lengths[-1] - 1) + [[False, True]]

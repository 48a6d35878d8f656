"""Whoever wrote a .npz: it becomes an episode that says where it comes from, or is refused."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro

from dnet.commands.inspect_import import Import
from dnet.datasets.index import open_index
from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadArrays, MissingPath, OccupiedOutput, TooFew, Unwritten
from dnet.geometry.sampling import farthest_points
from dnet.recorders.arms import ArmModel
from dnet.recorders.episode import EpisodeWriter
from dnet.tools.export_npz import export_npz
from dnet.tools.import_npz import Imported, TipAlone, import_files, import_npz
from tests.recorders import rollout
from tests.tools.exported import (
    assert_bits,
    assert_frames,
    logged,
    logged_meta,
    write_exportable,
)

Arrays = dict[str, Any]
Change = Callable[[Arrays], Arrays]


def foreign(count: int = 4, points: int = 30) -> Arrays:
    """The least that a file must hold."""
    rng = np.random.default_rng(0)
    return {
        "clouds": rng.normal(0.0, 0.05, (count, points, 3)).astype(np.float32),
        "grasps": rng.normal(0.0, 0.05, (count, 3)),
    }


def imported(folder: Path, arrays: Arrays, name: str = "mine") -> Imported:
    path = folder / f"{name}.npz"
    np.savez(path, **arrays)
    return import_npz(path, folder / "out")


def sorted_points(cloud: np.ndarray) -> np.ndarray:
    return cloud[np.lexsort(cloud.T)]


def test_an_export_comes_back_frame_by_frame(tmp_path: Path) -> None:
    data = write_exportable(tmp_path / "data")
    export_npz(open_index(data), tmp_path / "npz")
    made = import_files(sorted((tmp_path / "npz").iterdir()), tmp_path / "out")
    assert [(one.episode.name, one.notes) for one in made] == [
        (f"episode-{number}.mcap", ()) for number in range(3)
    ]
    export_npz(open_index(tmp_path / "out"), tmp_path / "again")
    for number in range(3):
        name = f"episode-{number}"
        with np.load(tmp_path / "again" / f"{name}.npz", allow_pickle=False) as arrays:
            assert_frames(dict(arrays), logged(data / f"{name}.mcap"))
        before, after = (
            logged_meta(folder / f"{name}.mcap") for folder in (data, tmp_path / "out")
        )
        assert after["settings"].pop("imported") == {"from": f"{name}.npz", "notes": []}
        assert after == before
    assert not list((tmp_path / "out").glob("*.part"))


def test_a_recording_that_was_cut_short_stays_one(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    log = tmp_path / "data" / "short.mcap"
    with EpisodeWriter(log, rollout.meta("short"), arms=rollout.ARMS, attachments={}) as writer:
        for one in rollout.frames(2):
            writer.add(one)
    writer.part.rename(log)
    export_npz(open_index(tmp_path / "data"), tmp_path / "npz")
    made = import_npz(tmp_path / "npz" / "short.npz", tmp_path / "out")
    with EpisodeReader(made.episode) as episode:
        assert not episode.finished
        assert len(episode) == 3


def test_clouds_and_grasps_are_enough(tmp_path: Path) -> None:
    arrays = foreign()
    made = imported(tmp_path, arrays)
    with EpisodeReader(made.episode) as episode:
        assert episode.meta.episode_id == "mine"
        assert episode.finished
        assert episode.kinds == ("rest", "shape", "shape", "shape")
        assert episode.times.tolist() == [0.0, 1.0, 2.0, 3.0]
        assert episode.meta.settings["imported"]["from"] == "mine.npz"
        assert episode.meta.settings["imported"]["notes"] == list(made.notes)
        for number in range(4):
            frame = episode.frame(number)
            assert_bits(frame.grasp, arrays["grasps"][number], np.float64)
            assert frame.nodes.shape == (0, 3)
            assert not np.any(frame.joints)
            # The same points, in the order on which networks rely.
            wanted = farthest_points(arrays["clouds"][number], 30)
            assert_bits(frame.cloud, wanted, np.float32)
            (tip,) = episode.transforms(number)
            assert (tip.parent, tip.child) == ("world", "psm_right/tip_link")
            assert_bits(tip.translation, arrays["grasps"][number], np.float64)
        scene = episode.meta.scene
    size = np.ptp(arrays["clouds"][0], axis=0)
    np.testing.assert_allclose(scene.tissue.size, size, rtol=1e-6)
    assert scene.manipulation_point == tuple(arrays["grasps"][0])
    notes = "; ".join(made.notes)
    for word in ("times assumed", "kinds assumed", "joints assumed", "no nodes", "farthest-point"):
        assert word in notes


def test_what_is_given_is_taken(tmp_path: Path) -> None:
    arrays = foreign(3) | {
        "kinds": np.array([b"rest", b"way", b"shape"]),
        "times": np.array([2, 2, 5]),
        "joints": np.random.default_rng(1).normal(size=(3, 2, 6)),
        "nodes_0": np.ones((5, 3), np.float32),
        "nodes_1": np.ones((2, 3), np.float32),
        "nodes_2": np.zeros((0, 3), np.float32),
        "meta": np.array(json.dumps({"camera": "ours"})),
    }
    made = imported(tmp_path, arrays)
    frames = logged(made.episode)
    assert [one.kind for one in frames] == ["rest", "way", "shape"]
    assert [one.time for one in frames] == [2.0, 2.0, 5.0]
    assert_bits([one.joints for one in frames], arrays["joints"], np.float64)
    assert [len(one.nodes) for one in frames] == [5, 2, 0]
    assert logged_meta(made.episode)["settings"]["meta"] == {"camera": "ours"}
    assert not any("assumed" in note for note in made.notes)


def test_clouds_may_differ_in_size_and_lie_in_arrays_of_their_own(tmp_path: Path) -> None:
    clouds = [np.full((count, 3), count, np.float32) for count in (3, 1, 12)]
    numbered = {f"cloud_{number:03d}": cloud for number, cloud in enumerate(clouds)}
    made = imported(tmp_path, {"grasps": np.zeros((3, 3)), **dict(reversed(numbered.items()))})
    for frame, cloud in zip(logged(made.episode), clouds, strict=True):
        assert_bits(frame.cloud, cloud, np.float32)


def test_what_is_converted_or_ignored_is_said(tmp_path: Path) -> None:
    arrays = foreign()
    exact = arrays["clouds"].astype(np.float64) + 1e-12
    others = {"clouds": exact, "grasps": arrays["grasps"].astype(np.float32), "time": np.ones(4)}
    made = imported(tmp_path, arrays | others)
    assert "clouds converted from float64 to float32" in made.notes
    assert "ignored: time" in made.notes
    assert not any("grasps" in note for note in made.notes)
    frame = logged(made.episode)[1]
    np.testing.assert_array_equal(
        sorted_points(frame.cloud), sorted_points(exact[1].astype(np.float32))
    )
    assert frame.grasp.tolist() == others["grasps"][1].astype(np.float64).tolist()


def test_a_cloud_in_farthest_point_order_keeps_it(tmp_path: Path) -> None:
    arrays = foreign(1)
    arrays["clouds"] = farthest_points(arrays["clouds"][0], 30, start=7)[None]
    made = imported(tmp_path, arrays)
    assert_bits(logged(made.episode)[0].cloud, arrays["clouds"][0], np.float32)
    assert not any("order" in note for note in made.notes)


def put(name: str, value: Any) -> Change:
    return lambda arrays: arrays | {name: np.asarray(value)}


def spoilt(name: str, value: float) -> Change:
    def change(arrays: Arrays) -> Arrays:
        values = arrays[name].copy()
        values.flat[4] = value
        return arrays | {name: values}

    return change


def without(name: str) -> Change:
    return lambda arrays: {key: value for key, value in arrays.items() if key != name}


OURS = {"schema_version": "1", "episode_id": "a", "seed": 0, "index": 0, "result": None}


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (without("clouds"), "neither `clouds`"),
        (without("grasps"), "no `grasps`"),
        (put("clouds", np.zeros((0, 5, 3), np.float32)), "no frame"),
        (put("clouds", np.zeros((4, 0, 3), np.float32)), "without points"),
        (put("clouds", np.zeros((4, 5, 2), np.float32)), r"shape \(4, 5, 2\).*\(any, any, 3\)"),
        (put("clouds", np.zeros((4, 5, 3), np.int32)), "type int32"),
        (put("clouds", np.array([None] * 4)), "unreadable `clouds`"),
        (put("clouds", np.full((4, 5, 3), 1e300)), r"`clouds` at \[0, 0, 0\] is 1e\+300"),
        (spoilt("clouds", np.nan), r"`clouds` at \[0, 1, 1\] is nan"),
        (spoilt("grasps", np.inf), r"`grasps` at \[1, 1\] is inf"),
        (put("grasps", np.zeros((3, 3))), r"`grasps` has shape \(3, 3\), must have \(4, 3\)"),
        (put("times", [0.0, 1.0, 2.0]), r"`times` has shape \(3,\)"),
        (put("times", [0.0, 2.0, 1.0, 3.0]), "backwards"),
        (put("times", [-1.0, 0.0, 1.0, 2.0]), "must be from 0"),
        (put("times", [0.0, 1.0, 2.0, 1e10]), "must be from 0"),
        (put("times", ["a", "b", "c", "d"]), "`times` is of type"),
        (put("kinds", ["rest", "shape", "shape", "pull"]), "'pull', not one of rest, shape, way"),
        (put("kinds", [0, 1, 1, 1]), "must be text"),
        (put("joints", np.zeros((4, 12))), r"`joints` has shape \(4, 12\)"),
        (put("nodes", np.zeros((3, 9, 3), np.float32)), "nodes of 3 frames and clouds of 4"),
        (put("meta", 3), "must be one text"),
        (put("meta", "{"), "no JSON"),
        (put("meta", "[" * 100_000), "no JSON"),
        (put("meta", "[]"), "no object"),
        (put("meta", json.dumps(OURS | {"schema_version": "2"})), "schema version '2'"),
        (put("meta", json.dumps(OURS | {"scene": {}, "settings": {}})), "describes no episode"),
        (put("meta", json.dumps(OURS)), "describes no episode"),
    ],
)
def test_what_makes_no_episode_is_refused(tmp_path: Path, change: Change, why: str) -> None:
    with pytest.raises(BadArrays, match=why):
        imported(tmp_path, change(foreign()))
    assert not (tmp_path / "out").exists()


def test_arrays_are_numbered_from_0_on(tmp_path: Path) -> None:
    cloud = np.ones((5, 3), np.float32)
    with pytest.raises(BadArrays, match=r"2 arrays `cloud_...`, not numbered from 0"):
        imported(tmp_path, {"cloud_1": cloud, "cloud_2": cloud, "grasps": np.zeros((2, 3))})


class Trap:
    """Whoever unpickles this touches a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    sprung = tmp_path / "sprung"
    trap = np.array([Trap(sprung)], dtype=object)
    for name in ("clouds", "grasps", "kinds", "meta"):
        with pytest.raises(BadArrays, match=f"unreadable `{name}`"):
            imported(tmp_path, foreign() | {name: trap})
    np.save(tmp_path / "trap.npy", trap, allow_pickle=True)
    with pytest.raises(BadArrays, match=r"is no \.npz"):
        import_npz(tmp_path / "trap.npy", tmp_path / "out")
    assert not sprung.exists()


def test_a_file_that_is_no_npz_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "whole.npz", **foreign())
    whole = (tmp_path / "whole.npz").read_bytes()
    path = tmp_path / "mine.npz"
    for content in (b"", b"text", whole[:-40], whole[:500]):
        path.write_bytes(content)
        with pytest.raises(BadArrays, match=r"is no \.npz"):
            import_npz(path, tmp_path / "out")
    flipped = bytearray(whole)
    flipped[400] ^= 1
    path.write_bytes(flipped)
    with pytest.raises(BadArrays, match="unreadable `clouds`"):
        import_npz(path, tmp_path / "out")
    with path.open("wb") as file:
        np.save(file, np.zeros(3))
    with pytest.raises(BadArrays, match="a single array"):
        import_npz(path, tmp_path / "out")
    header = np.lib.format.magic(1, 0) + b"\x76\x00"
    text = b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000000000, 5, 3), }"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("clouds.npy", header + text.ljust(117) + b"\n")
    with pytest.raises(BadArrays, match="unreadable `clouds`"):
        import_npz(path, tmp_path / "out")
    with pytest.raises(MissingPath, match=r"none\.npz"):
        import_npz(tmp_path / "none.npz", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_import_replaces_nothing_and_leaves_nothing_half(tmp_path: Path) -> None:
    made = imported(tmp_path, foreign())
    before = made.episode.read_bytes()
    with pytest.raises(OccupiedOutput):
        import_npz(made.file, tmp_path / "out")
    assert made.episode.read_bytes() == before
    (tmp_path / "out" / "other.mcap.part").write_bytes(b"a recording")
    with pytest.raises(OccupiedOutput, match="unfinished"):
        imported(tmp_path, foreign(), "other")
    assert (tmp_path / "out" / "other.mcap.part").read_bytes() == b"a recording"
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(Unwritten):
        import_npz(made.file, tmp_path / "file")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "mine.mcap",
        "other.mcap.part",
    ]


def test_arms_of_which_only_a_tip_is_known_are_arms() -> None:
    assert isinstance(TipAlone(), ArmModel)


def test_the_command_says_what_became_of_each_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a", "b"):
        np.savez(tmp_path / f"{name}.npz", **foreign())
    files = [str(tmp_path / f"{name}.npz") for name in ("a", "b")]
    tyro.cli(Import, args=[*files, "--out", str(tmp_path / "out")]).run()
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{tmp_path / 'out' / 'a.mcap'}: 4 frames of {files[0]}"
    assert "  times assumed: 0, 1, 2, ..." in lines
    tyro.cli(Import, args=[files[0], "--out", str(tmp_path / "new"), "--json"]).run()
    (told,) = json.loads(capsys.readouterr().out)["episodes"]
    assert (told["frames"], told["file"]) == (4, files[0])
    with pytest.raises(TooFew):
        Import((), tmp_path).run()

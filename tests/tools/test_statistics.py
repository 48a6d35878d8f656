import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from jaxtyping import Float64

from dnet.datasets.index import INDEX, open_index
from dnet.datasets.index_file import pack_index
from dnet.errors import BadIndex, MissingPath, NoEpisodes
from dnet.geometry.pose import rotation_z
from dnet.recorders.episode import EpisodeWriter
from dnet.tools.statistics import statistics
from dnet.tools.statistics_recorded import read_recorded
from dnet.tools.statistics_values import Statistics
from dnet.types import Frame, FrameKind, Scene, Tissue
from tests.recorders.rollout import ARMS, SCENE, frame, meta

Motions = Float64[np.ndarray, "_ 3"]

SIDE = 10.0
CORNERS = SIDE * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
"""Of a cube about the rest position, in millimetres."""


def record(
    path: Path,
    motions: Motions,
    *,
    scene: Scene = SCENE,
    result: dict[str, Any] | None = None,
    way: bool = False,
    points: int = 64,
) -> Path:
    """Write an episode whose shapes are displaced by `motions` from rest, in millimetres."""
    with EpisodeWriter(
        path, replace(meta(path.stem), scene=scene), arms=ARMS, attachments={}
    ) as writer:
        writer.add(frame(0.0, np.zeros(3), "rest", points=points))
        for number, motion in enumerate(motions / 1e3, start=1):
            kinds: Sequence[tuple[float, FrameKind]] = [(1.0, "shape")]
            if way:
                kinds = [(0.5, "way"), (1.0, "shape")]
            for share, kind in kinds:
                writer.add(frame(number - 1 + share, share * motion, kind, points=points))
        writer.finish(result or {})
    return path


def figures(directory: Path) -> Statistics:
    return statistics(read_recorded(directory), None)


def test_the_files_are_counted_and_weighed(tmp_path: Path) -> None:
    paths = [
        record(tmp_path / "a.mcap", CORNERS[:3], way=True, points=50),
        record(tmp_path / "b.mcap", CORNERS[:1], points=70),
    ]
    (tmp_path / "c.mcap").write_bytes(paths[0].read_bytes()[:-100])
    (tmp_path / "d.mcap.part").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("no episode")
    found = figures(tmp_path)
    sizes = [path.stat().st_size for path in paths]
    assert (found.files.finished, found.files.unfinished, found.files.broken) == (2, 1, 1)
    assert found.files.total_bytes == sum(sizes)
    assert (found.files.episode_bytes.least, found.files.episode_bytes.greatest) == (
        min(sizes),
        max(sizes),
    )
    assert found.files.frame_bytes == sum(sizes) / 9
    assert found.frames == {"rest": 2, "shape": 4, "way": 3}
    assert found.cloud_points == (50, 70)
    assert found.simulated_seconds == 4.0


def test_an_episode_that_never_ended_is_unfinished_whatever_its_name(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS)
    with EpisodeWriter(tmp_path / "b.mcap", meta("b"), arms=ARMS, attachments={}) as writer:
        writer.add(frame(0.0, np.zeros(3), "rest"))
    writer.part.rename(tmp_path / "b.mcap")
    found = figures(tmp_path)
    assert (found.files.finished, found.files.unfinished) == (1, 1)
    assert found.frames["rest"] == 1


def test_displacements_to_the_corners_of_a_cube(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS)
    found = figures(tmp_path).displacement_mm
    for axis in "xyz":
        spread = found[axis].spread
        assert (spread.mean, spread.std) == pytest.approx((0.0, SIDE), abs=1e-9)
        assert (spread.least, spread.greatest) == pytest.approx((-SIDE, SIDE))
    length = found["length"]
    assert length.spread.mean == pytest.approx(SIDE * 3**0.5)
    assert length.spread.std == pytest.approx(0.0, abs=1e-9)
    assert (length.histogram.start, length.histogram.counts) == (17.0, (8,))


def test_motions_between_the_corners_and_the_centre_of_a_cube(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS)
    found = figures(tmp_path)
    assert found.any_pair is not None
    assert found.from_rest is not None
    assert found.any_pair.pairs == 72
    # Of each corner: three neighbours, three over a face, one through the centre, which is rest.
    whole = 8 * (3 * 2 + 3 * 2 * 2**0.5 + 2 * 3**0.5) + 16 * 3**0.5
    assert found.any_pair.mean_mm == pytest.approx(SIDE * whole / 72)
    assert found.any_pair.zero_mse_mm2 == pytest.approx(2 * SIDE**2)
    assert found.from_rest.pairs == 8
    assert found.from_rest.mean_mm == pytest.approx(SIDE * 3**0.5)
    assert found.from_rest.zero_mse_mm2 == pytest.approx(SIDE**2)
    assert found.from_rest.mean_mse_mm2 == pytest.approx(SIDE**2)


def test_predicting_the_mean_leaves_what_varies(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS + np.array([30.0, 0.0, 20.0]))
    found = figures(tmp_path).from_rest
    assert found is not None
    assert found.zero_mse_mm2 == pytest.approx(SIDE**2 + (30**2 + 20**2) / 3)
    assert found.mean_mse_mm2 == pytest.approx(SIDE**2)


def test_pairs_are_all_ordered_ones_of_settled_frames_within_an_episode(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    all_motions = []
    for name, count in (("a", 4), ("b", 7), ("c", 0)):
        moved = random.uniform([-10, -20, 0], [20, 20, 30], (count, 3))
        record(tmp_path / f"{name}.mcap", moved, way=True)
        seen = [np.zeros(3), *moved]
        all_motions += [
            goal - current
            for one, current in enumerate(seen)
            for other, goal in enumerate(seen)
            if one != other
        ]
    motions = np.array(all_motions)
    found = figures(tmp_path).any_pair
    assert found is not None
    assert found.pairs == len(motions) == 5 * 4 + 8 * 7
    assert found.mean_mm == pytest.approx(np.linalg.norm(motions, axis=1).mean())
    assert found.zero_mse_mm2 == pytest.approx(np.square(motions).mean())
    assert found.mean_mse_mm2 == pytest.approx(np.square(motions - motions.mean(axis=0)).mean())


def test_manipulation_points_do_not_depend_on_where_the_object_lies(tmp_path: Path) -> None:
    own = np.array([[0.02, -0.03, 0.04], [0.04, 0.05, 0.02]])
    for number, (point, yaw, x) in enumerate(zip(own, (0.2, -0.1), (0.01, -0.008), strict=True)):
        placed = rotation_z(yaw) @ point + np.array([x, 0.002, 0.0])
        scene = replace(
            SCENE, position=(x, 0.002), yaw=yaw, manipulation_point=tuple(placed.tolist())
        )
        record(tmp_path / f"{number}.mcap", CORNERS[:1], scene=scene)
    found = figures(tmp_path).manipulation_point_mm
    ends = [(found[axis].least, found[axis].greatest) for axis in "xyz"]
    np.testing.assert_allclose(ends, [(20, 40), (-30, 50), (20, 40)])
    assert found["y"].mean == pytest.approx(10.0)


def test_moduli_that_repeat_are_told_apart_and_others_are_a_range(tmp_path: Path) -> None:
    tissues = [Tissue(young=1000.0), Tissue(young=5000.0), Tissue(young=1000.0)]
    tissues += [
        Tissue(shape="cylinder", size=(0.1, width, 0.04), young=young)
        for width, young in ((0.05, 900.0), (0.06, 1100.0), (0.08, 1000.0))
    ]
    for number, tissue in enumerate(tissues):
        record(
            tmp_path / f"{number}.mcap", CORNERS[: number + 1], scene=replace(SCENE, tissue=tissue)
        )
    soft, stiff, cylinder = figures(tmp_path).tissues
    assert [(row.shape, row.episodes, row.shapes) for row in (soft, stiff, cylinder)] == [
        ("box", 2, 4),
        ("box", 1, 2),
        ("cylinder", 3, 15),
    ]
    assert (soft.young_kpa.mean, stiff.young_kpa.mean) == (1.0, 5.0)
    assert (cylinder.young_kpa.least, cylinder.young_kpa.greatest) == (0.9, 1.1)
    assert cylinder.young_kpa.mean == pytest.approx(1.0)
    widths = cylinder.size_mm[1]
    assert (widths.least, widths.greatest) == pytest.approx((50.0, 80.0))


def test_rejected_draws_are_shares_of_what_was_drawn(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS, result={"rejected": {"inverted": 3, "scene": 2}})
    record(tmp_path / "b.mcap", CORNERS[:5], result={"rejected": {"inverted": 3, "bistable": 1}})
    record(tmp_path / "old.mcap", CORNERS, result={"frames": 9})
    found = figures(tmp_path).draws
    assert found is not None
    assert (found.shapes, found.scenes, found.rejected_shapes) == (20, 4, 7)
    assert [(row.reason, row.count, row.share) for row in found.rejected] == [
        ("inverted", 6, 6 / 20),
        ("scene", 2, 2 / 4),
        ("bistable", 1, 1 / 20),
    ]


def test_deviations_are_averaged_over_shapes(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS[:6], result={"deviation_mm": {"mean": 0.1, "worst": 2.0}})
    record(tmp_path / "b.mcap", CORNERS[:2], result={"deviation_mm": {"mean": 0.5, "worst": 1.0}})
    record(tmp_path / "old.mcap", CORNERS)
    found = figures(tmp_path).deviation
    assert found is not None
    assert found.mean_mm == pytest.approx(0.2)
    assert found.worst_mm == 2.0


def test_an_older_recording_says_less(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS, result={"rejected": 3, "deviation_mm": {"mean": "NaN"}})
    found = figures(tmp_path)
    assert found.draws is None
    assert found.deviation is None
    assert found.speed is None


def test_a_rest_shape_alone_has_no_displacement(tmp_path: Path) -> None:
    record(
        tmp_path / "a.mcap",
        CORNERS[:0],
        result={"rejected": {}, "deviation_mm": {"mean": 0.0, "worst": 0.0}},
    )
    found = figures(tmp_path)
    assert found.displacement_mm == {}
    assert found.any_pair is None
    assert found.from_rest is None
    assert found.deviation is None
    assert found.draws is not None
    assert (found.draws.shapes, found.draws.rejected) == (0, ())
    assert found.tissues[0].shapes == 0


def test_an_episode_without_frames_has_a_size_and_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with EpisodeWriter(path, meta("a"), arms=ARMS, attachments={}) as writer:
        writer.finish({})
    found = figures(tmp_path)
    assert found.files.total_bytes == path.stat().st_size
    assert found.files.frame_bytes is None
    assert found.cloud_points is None
    assert found.simulated_seconds == 0.0
    assert found.manipulation_point_mm["z"].mean == pytest.approx(40.0)


class CarelessWriter(EpisodeWriter):
    """Somebody else's, that writes what is not a number."""

    def _check(self, frame: Frame) -> None:
        pass


def test_a_grasp_that_is_not_a_number_breaks_its_episode_alone(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", CORNERS)
    seen = frame(0.0, np.zeros(3), "rest")
    with CarelessWriter(tmp_path / "b.mcap", meta("b"), arms=ARMS, attachments={}) as writer:
        writer.add(replace(seen, grasp=np.full(3, np.nan)))
        writer.finish({})
    found = figures(tmp_path)
    assert (found.files.finished, found.files.broken) == (1, 1)
    assert found.frames == {"rest": 1, "shape": 8, "way": 0}


def test_every_file_is_announced(tmp_path: Path) -> None:
    for name in "abc":
        record(tmp_path / f"{name}.mcap", CORNERS[:1])
    (tmp_path / "d.mcap").write_bytes(b"")
    announced: list[tuple[int, int]] = []
    read_recorded(tmp_path, on_episode=lambda done, total: announced.append((done, total)))
    assert announced == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_nowhere_and_nothing_finished_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingPath):
        read_recorded(tmp_path / "nowhere")
    with pytest.raises(NoEpisodes, match="dnet record"):
        read_recorded(tmp_path)
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n and no more")
    (tmp_path / "b.mcap.part").write_bytes(b"")
    with pytest.raises(NoEpisodes, match="1 unfinished and 1 broken"):
        read_recorded(tmp_path)


@pytest.mark.parametrize("column", ["scene", "result"])
@pytest.mark.parametrize("value", ["{", "[]", "7", '{"position": [1, 2]}', "[" * 100_000, None])
def test_what_a_foreign_index_says_of_an_episode_is_refused_by_name_and_value(
    tmp_path: Path, column: str, value: str | None
) -> None:
    path = record(tmp_path / "a.mcap", CORNERS[:3])
    index = open_index(tmp_path)
    spoiled = index.files.with_columns(pl.lit(value, pl.String).alias(column))
    (tmp_path / INDEX).write_bytes(pack_index(spoiled, index.frames))
    if (column, value) in {("scene", None), ("result", "[]"), ("result", '{"position": [1, 2]}')}:
        assert figures(tmp_path).files.finished == 1
        return
    told = re.escape(f"its {column} is {str(value)[:60]!r}")
    with pytest.raises(BadIndex, match=rf"{INDEX} says of {path.name} that {told}.*delete the"):
        figures(tmp_path)
    (tmp_path / INDEX).unlink()
    assert figures(tmp_path).files.finished == 1


@pytest.mark.parametrize("value", [10**30, -(10**30), 10**400, "many", None, [1]])
def test_a_count_or_a_deviation_that_cannot_be_is_left_out(tmp_path: Path, value: object) -> None:
    result = {"rejected": {"folded": value, "slipped": 2}, "deviation_mm": {"mean": value}}
    record(tmp_path / "a.mcap", CORNERS[:3], result=result)
    draws = figures(tmp_path).draws
    assert draws is not None
    assert [(one.reason, one.count) for one in draws.rejected] == [("slipped", 2)]

from pathlib import Path

import numpy as np
import pytest
import tyro
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.image import imread

from dnet.commands.inspect_plot import Plot
from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import Index, open_index
from dnet.errors import NoSuchEpisode, TooFew, UnknownPicture
from dnet.geometry.chamfer import chamfer
from dnet.tools.picking import pick_episodes
from dnet.tools.plotting import plot_dataset
from dnet.tools.plotting_shapes import Shapes, spread
from dnet.tools.plotting_sheet import COLUMNS, project, rows_of
from tests.datasets.dataset import write_dataset
from tests.recorders.rollout import frames

LENGTHS = (4, 1, 6)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("plot") / "data", LENGTHS)


@pytest.fixture(scope="module")
def index(data: Path) -> Index:
    return open_index(data)


def test_shapes_are_those_that_settled_each_with_its_own_rest_shape(index: Index) -> None:
    shapes = Shapes(settled_frames(index))
    wanted = [
        (f"episode-{number}:{place}", one, seen[0])
        for number, length in enumerate(LENGTHS)
        for seen in [frames(length, seed=number)]
        for place, one in enumerate(seen)
        if one.kind == "shape"
    ]
    assert len(shapes) == len(wanted)
    for number, (name, one, rest) in enumerate(wanted):
        shape = shapes.shape(number)
        assert shape.name == name
        np.testing.assert_array_equal(shape.cloud, one.cloud)
        np.testing.assert_array_equal(shape.rest, rest.cloud)
        np.testing.assert_allclose(shape.motion, one.grasp - rest.grasp)
        np.testing.assert_array_equal(shapes.motions[number], shape.motion)
    numbers = np.array([0, 2, 3, 7])
    told: list[tuple[int, int]] = []
    found = shapes.distances(numbers, on_shape=lambda done, total: told.append((done, total)))
    np.testing.assert_array_equal(
        found, [chamfer(wanted[one][1].cloud, wanted[one][2].cloud) for one in numbers]
    )
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


@settings(deadline=None, max_examples=40)
@given(count=st.integers(0, 500), most=st.integers(1, 60))
def test_numbers_are_spread_evenly_and_none_comes_twice(count: int, most: int) -> None:
    numbers = spread(count, most)
    assert len(numbers) == min(count, most)
    assert ((numbers >= 0) & (numbers < count)).all()
    gaps = np.diff(numbers)
    assert (gaps > 0).all()
    assert not len(gaps) or gaps.max() - gaps.min() <= 1


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(*[st.floats(-1, 1, width=32)] * 3), min_size=2, max_size=9))
def test_a_projection_turns_and_does_not_distort(points: list[tuple[float, float, float]]) -> None:
    before = np.array(points, np.float32)
    after = project(before)
    np.testing.assert_allclose(
        np.linalg.norm(after - after[0], axis=1),
        np.linalg.norm(before.astype(float) - before[0].astype(float), axis=1),
        atol=1e-12,
    )
    # Upright things stay upright, and what is behind is farther away.
    up = project(np.eye(3, dtype=np.float32))
    assert up[2, 0] == 0
    assert up[2, 1] > 0
    assert up[1, 2] > 0


def test_the_picture_shows_the_data_and_grows_with_the_shapes_drawn(
    index: Index, tmp_path: Path
) -> None:
    drawn = {}
    for name, chosen, sheets in (
        ("all", index, 7),
        ("one", pick_episodes(index, ["episode-2"]), 7),
    ):
        plot_dataset(chosen, tmp_path / "new" / f"{name}.png", sheets=sheets)
        drawn[name] = imread(tmp_path / "new" / f"{name}.png")
    height, width, _ = drawn["all"].shape
    # Of five shapes there is one row.
    assert height > drawn["one"].shape[0]
    assert width == drawn["one"].shape[1]
    # Above the shapes, below the histograms at the left and the workspace at the right.
    for rows, columns in (
        (slice(80, height // 2), slice(0, width)),
        (slice(height * 2 // 3, height), slice(0, width // 2)),
        (slice(height * 2 // 3, height), slice(width // 2, width)),
    ):
        assert drawn["all"][rows, columns, :3].std() > 0.02


@pytest.mark.parametrize("name", ["a.pdf", "a.SVG"])
def test_the_same_data_draw_the_same_bytes(index: Index, tmp_path: Path, name: str) -> None:
    written = []
    for run in ("one", "two"):
        plot_dataset(index, tmp_path / run / name, sheets=1)
        written.append((tmp_path / run / name).read_bytes())
    assert written[0] == written[1]


def test_pictures_stand_in_rows() -> None:
    assert [rows_of(count) for count in (1, COLUMNS, COLUMNS + 1)] == [1, 1, 2]


def test_what_cannot_be_drawn_is_refused(index: Index, tmp_path: Path) -> None:
    with pytest.raises(UnknownPicture):
        plot_dataset(index, tmp_path / "a.gif")
    with pytest.raises(TooFew, match="shapes to draw is 0"):
        plot_dataset(index, tmp_path / "a.png", sheets=0)
    with pytest.raises(TooFew, match="other than at rest"):
        plot_dataset(pick_episodes(index, ["episode-1"]), tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


def test_the_command_draws_and_says_where(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(data), "--out", str(tmp_path / "a.png"), "--sheets", "2", "--episode"]
    tyro.cli(Plot, args=[*words, "episode-0", "episode-2"]).run()
    told = capsys.readouterr()
    assert (told.out.strip(), told.err) == (str(tmp_path / "a.png"), "")
    assert imread(tmp_path / "a.png").std() > 0
    with pytest.raises(NoSuchEpisode, match="no readable episode none"):
        tyro.cli(Plot, args=[*words, "none"]).run()

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from dnet.errors import UnknownPicture
from dnet.tools.statistics import statistics
from dnet.tools.statistics_figure import check_picture, draw_statistics
from dnet.tools.statistics_recorded import Recorded, read_recorded
from tests.recorders.rollout import frames, write


@pytest.fixture
def index(tmp_path: Path) -> Recorded:
    write(tmp_path / "data" / "a.mcap", frames(12))
    return read_recorded(tmp_path / "data")


def test_the_picture_shows_the_data(index: Recorded, tmp_path: Path) -> None:
    write(tmp_path / "other" / "a.mcap", frames(12, seed=1))
    other = read_recorded(tmp_path / "other")
    pictures = []
    for number, seen in enumerate((index, other)):
        path = tmp_path / "pictures" / f"{number}.png"
        draw_statistics(seen, statistics(index, None), path)
        pictures.append(imread(path))
    assert pictures[0].shape == (800, 1600, 4)
    # The histogram along x, and the displacements in x and z; titles are the same.
    assert not np.array_equal(pictures[0][:400, :400], pictures[1][:400, :400])
    assert not np.array_equal(pictures[0][420:, 400:800], pictures[1][420:, 400:800])
    assert np.array_equal(pictures[0][:25], pictures[1][:25])


@pytest.mark.parametrize("name", ["a.png", "a.PDF", "a.svg"])
def test_the_same_figures_draw_the_same_bytes(index: Recorded, tmp_path: Path, name: str) -> None:
    found = statistics(index, None)
    written = []
    for run in ("one", "two"):
        draw_statistics(index, found, tmp_path / run / name)
        written.append((tmp_path / run / name).read_bytes())
    assert written[0] == written[1]


def test_a_recording_with_many_shapes_and_one_with_none_are_drawn(tmp_path: Path) -> None:
    write(tmp_path / "few" / "a.mcap", frames(1))
    few = read_recorded(tmp_path / "few")
    many = Recorded(
        few.directory,
        few.episodes,
        few.frames.sample(3000, with_replacement=True, seed=0).with_columns(
            kind=np.full(3000, "shape"), x=np.linspace(-20.0, 40.0, 3000)
        ),
        few.rejected,
        few.oddities,
        few.unfinished,
        few.broken,
    )
    for name, index in (("few", few), ("many", many)):
        path = tmp_path / f"{name}.png"
        draw_statistics(index, statistics(index, None), path)
        assert imread(path).std() > 0


def test_a_directory_with_a_dollar_in_its_name_is_no_formula(tmp_path: Path) -> None:
    write(tmp_path / "$\\bad$" / "a.mcap", frames(2))
    index = read_recorded(tmp_path / "$\\bad$")
    draw_statistics(index, statistics(index, None), tmp_path / "a.svg")
    assert (tmp_path / "a.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize("name", ["a.gif", "a", "a.png.part"])
def test_other_pictures_are_refused(name: str) -> None:
    with pytest.raises(UnknownPicture, match=r"\.png, \.pdf, \.svg"):
        check_picture(Path(name))

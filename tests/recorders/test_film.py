from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadEpisode, NoFilm
from dnet.recorders.film import SIZE, STRIP, film
from dnet.recorders.film_strip import Strip
from tests.recorders.rollout import frames, write, write_servo


@pytest.mark.parametrize("kind", ["webp", "gif"])
def test_a_film_has_a_picture_of_each_step(tmp_path: Path, kind: str) -> None:
    out = tmp_path / f"run.{kind}"
    log = tmp_path / "run.mcap"
    write_servo(log)
    with EpisodeReader(log) as episode:
        film(episode, out)
        steps = len(episode.steps())
    with Image.open(out) as moving:
        assert getattr(moving, "n_frames", 1) == steps
        assert moving.size == (SIZE[0], SIZE[1] + STRIP)
    assert not list(tmp_path.glob("*.part"))


def test_a_recording_of_random_shapes_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "episode.mcap"
    write(log, frames())
    with EpisodeReader(log) as episode, pytest.raises(BadEpisode, match="is no servo run"):
        film(episode, tmp_path / "film.webp")
    assert not (tmp_path / "film.webp").exists()


def test_a_film_of_another_kind_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "run.mcap"
    write_servo(log)
    with EpisodeReader(log) as episode, pytest.raises(NoFilm, match=r"\.webp or \.gif"):
        film(episode, tmp_path / "film.avi")


def test_a_strip_differs_from_step_to_step_and_not_otherwise() -> None:
    strip = Strip(np.array([9.0, 4.0, 1.0]), 0.9, size=(720, STRIP))
    first, again, next_ = (np.asarray(strip.draw(step, motion=12.0)) for step in (0, 0, 1))
    assert first.shape == (STRIP, 720, 3)
    np.testing.assert_array_equal(first, again)
    assert (first != next_).any()

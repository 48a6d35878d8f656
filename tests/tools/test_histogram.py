import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.tools.histogram import bar, histogram, skyline

VALUES = st.lists(st.integers(-100_000, 100_000).map(lambda n: n / 64), min_size=1, max_size=60)


@given(values=VALUES, most=st.integers(2, 60))
def test_every_value_lies_in_its_bin(values: list[float], most: int) -> None:
    found = histogram(np.array(values), most=most)
    assert sum(found.counts) == len(values)
    assert len(found.counts) <= most
    for place, count in enumerate(found.counts):
        low = found.start + place * found.width
        inside = [low - 1e-6 < value < low + found.width + 1e-6 for value in values]
        assert count <= sum(inside)


@given(values=VALUES, most=st.integers(2, 60))
def test_bins_are_round_and_start_at_whole_widths(values: list[float], most: int) -> None:
    found = histogram(np.array(values), most=most)
    power = math.floor(math.log10(found.width) + 1e-9)
    assert round(found.width / 10.0**power, 6) in (1, 2, 5)
    assert found.start / found.width == pytest.approx(round(found.start / found.width), abs=1e-6)


@pytest.mark.parametrize(
    ("high", "width", "bins"), [(9.9, 0.5, 20), (49.9, 2, 25), (50.1, 5, 11), (104, 5, 21)]
)
def test_bins_are_as_narrow_as_their_number_allows(high: float, width: float, bins: int) -> None:
    found = histogram(np.array([0.0, high]), most=25)
    assert found.width == width
    assert len(found.counts) == bins
    assert found.counts[0] == found.counts[-1] == 1


def test_values_that_differ_by_rounding_are_not_torn_apart() -> None:
    found = histogram(np.array([40.5, np.nextafter(40.5, 41), 40.5]))
    assert (found.start, found.width, found.counts) == (40.0, 1.0, (3,))


def test_no_values_give_no_bins() -> None:
    assert histogram(np.array([])).counts == ()


def test_a_bar_is_as_long_as_its_share_to_an_eighth() -> None:
    assert bar(8, 8, length=10) == "█" * 10
    assert bar(4, 8, length=10) == "█" * 5
    assert bar(1, 16, length=10) == "▋"
    assert bar(0, 8) == ""
    assert bar(1, 10**6, length=10) == "▏"


def test_a_skyline_is_blank_only_where_nothing_is() -> None:
    assert skyline((0, 1, 500, 1000)) == " ▁▄█"
    assert skyline(()) == ""
    assert skyline((0, 0)) == "  "

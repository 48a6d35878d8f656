from pathlib import Path, PurePosixPath

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.errors import BadName
from dnet.files.plain_names import LONGEST_NAME, plain_name, plain_path

NO_NAMES = [
    "../../x",
    "..",
    ".",
    "",
    "/etc/passwd",
    "a/b",
    "..\\..\\x",
    "C:x",
    "\\\\host\\share",
    "a\0b",
    "a\nb",
    "a\x1b[2Jb",
    "\u202eb",
    "\ud800",
    "x" * (LONGEST_NAME + 1),
    "ü" * LONGEST_NAME,
    None,
    3,
]


@pytest.mark.parametrize("name", NO_NAMES)
def test_what_is_no_name_is_refused(name: object) -> None:
    with pytest.raises(BadName, match="the episode of a test is") as caught:
        plain_name(name, what="the episode of a test")
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("name", ["episode-0-00000", "weich, 软", "a b", "..a", "x" * LONGEST_NAME])
def test_a_name_stays_as_it_is(name: str) -> None:
    assert plain_name(name, what="it") == name


@pytest.mark.parametrize("name", [one for one in NO_NAMES if one != "a/b"])
def test_no_part_of_a_path_may_be_what_is_no_name(name: object) -> None:
    for text in (name, f"a/{name}", f"{name}/a") if isinstance(name, str) else (name,):
        with pytest.raises(BadName):
            plain_path(text, what="a run")


def test_a_path_may_have_several_parts() -> None:
    assert plain_path("a/b/c", what="a run") == PurePosixPath("a/b/c")


@settings(max_examples=30)
@given(text=st.text(max_size=300))
def test_what_is_taken_leads_nowhere_else(text: str) -> None:
    folder = Path("/data/folder")
    try:
        place = folder / plain_path(text, what="a run")
    except BadName:
        return
    assert place.is_relative_to(folder)
    assert place != folder
    assert ".." not in place.parts

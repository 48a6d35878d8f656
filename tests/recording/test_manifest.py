"""The manifest says what is there, so that any later call goes on and nothing is mixed up."""

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.errors import (
    BadEpisode,
    BadManifest,
    DamagedEpisode,
    DnetError,
    OccupiedOutput,
    OtherRequest,
)
from dnet.laboratory import LaboratorySettings
from dnet.recording.folder_store import FolderStore
from dnet.recording.manifest import MANIFEST, TIMINGS, open_manifest
from dnet.recording.request import RecordingRequest, differences
from dnet.sim.tissue_families import TissueFamily
from tests.recording.synthetic import REQUEST, report, request, write_episode


def record(folder: Path, asked: RecordingRequest, *indices: int) -> None:
    """Do what a recording of those pairs leaves."""
    manifest = open_manifest(FolderStore(folder), asked)
    manifest.write()
    for index in indices:
        manifest.add(report(write_episode(folder, asked, index), asked))


def content(folder: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads((folder / MANIFEST).read_text())
    return read


def missing(folder: Path, asked: RecordingRequest = REQUEST) -> list[int]:
    return open_manifest(FolderStore(folder), asked).missing()


def test_a_new_recording_lacks_every_pair_and_leaves_nothing_by_asking(tmp_path: Path) -> None:
    assert missing(tmp_path) == [0, 1, 2]
    assert list(tmp_path.iterdir()) == []


def test_a_recording_goes_on_with_what_is_missing(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 1)
    assert missing(tmp_path) == [0, 2]
    assert content(tmp_path)["finished"] is False
    record(tmp_path, REQUEST, 0, 2)
    assert missing(tmp_path) == []
    assert content(tmp_path)["finished"] is True


def test_the_manifest_does_not_depend_on_the_order_or_the_number_of_calls(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.mkdir()
    other.mkdir()
    record(one, REQUEST, 0, 1, 2)
    for index in (2, 0, 1):
        record(other, REQUEST, index)
    assert (one / MANIFEST).read_bytes() == (other / MANIFEST).read_bytes()
    assert len((other / TIMINGS).read_text().splitlines()) == 3


def test_the_manifest_adds_up_its_episodes_and_tells_what_shaped_them(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0, 1, 2)
    said = content(tmp_path)
    files = sorted(tmp_path.glob("*.mcap"))
    assert said["bytes"] == sum(path.stat().st_size for path in files)
    assert said["frames"] == sum(entry["frames"] for entry in said["episodes"].values()) == 9
    assert said["rejected"] == {"inverted": 0 + 1 + 2}
    assert list(said["episodes"]) == [path.stem for path in files]
    assert said["settings"]["seed"] == REQUEST.seed
    assert said["settings"]["laboratory"]["versions"].keys() >= {"deformernet", "numpy", "pybullet"}


def test_more_pairs_are_added_and_fewer_take_nothing_away(tmp_path: Path) -> None:
    record(tmp_path, request(2), 0, 1)
    assert missing(tmp_path, request(4)) == [2, 3]
    record(tmp_path, request(4), 2)
    assert content(tmp_path)["pairs"] == 4
    assert missing(tmp_path, request(1)) == []
    record(tmp_path, request(1))
    assert content(tmp_path)["pairs"] == 4
    assert len(content(tmp_path)["episodes"]) == 3
    assert content(tmp_path)["finished"] is False


def test_an_episode_that_was_removed_is_missing_again(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0, 1, 2)
    whole = (tmp_path / MANIFEST).read_bytes()
    (tmp_path / "episode-5-00001.mcap").unlink()
    assert missing(tmp_path) == [1]
    record(tmp_path, REQUEST, 1)
    assert (tmp_path / MANIFEST).read_bytes() == whole


def test_an_episode_finished_just_before_a_kill_is_entered(tmp_path: Path) -> None:
    """The file has its name, the manifest does not have it yet."""
    record(tmp_path, REQUEST, 0, 1, 2)
    whole = (tmp_path / MANIFEST).read_bytes()
    cut = content(tmp_path)
    del cut["episodes"]["episode-5-00002"]
    (tmp_path / MANIFEST).write_text(json.dumps(cut))
    assert missing(tmp_path) == []
    record(tmp_path, REQUEST)
    assert (tmp_path / MANIFEST).read_bytes() == whole


def test_a_stranger_under_an_episodes_name_is_not_entered(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0)
    write_episode(tmp_path, replace(REQUEST, shapes=7), 1)
    with pytest.raises(OtherRequest, match=r"episode-5-00001\.mcap .*shapes 7 there, 1 now"):
        missing(tmp_path)


def test_half_an_episode_under_a_whole_ones_name_is_not_entered(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0)
    path = tmp_path / "episode-5-00001.mcap"
    path.write_bytes((tmp_path / "episode-5-00000.mcap").read_bytes()[:5000])
    with pytest.raises(BadEpisode, match=r"episode-5-00001\.mcap"):
        missing(tmp_path)


def test_an_episode_whose_size_changed_is_refused_by_name(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0, 1)
    path = tmp_path / "episode-5-00001.mcap"
    size = path.stat().st_size
    with path.open("ab") as file:
        file.write(b"more")
    expected = rf"episode-5-00001\.mcap has {size + 4} bytes, had {size}"
    with pytest.raises(DamagedEpisode, match=expected):
        missing(tmp_path)


@pytest.mark.parametrize(
    ("other", "named"),
    [
        (replace(REQUEST, seed=6), "seed 5 there, 6 now"),
        (replace(REQUEST, rate=2.0), r"rate 0\.0 there, 2\.0 now"),
        (replace(REQUEST, tissue=TissueFamily(vary=True)), "tissue.vary False there, True now"),
        (
            replace(REQUEST, laboratory=LaboratorySettings(points=64)),
            "laboratory.world quasistatic there, bullet now",
        ),
    ],
)
def test_other_settings_are_refused_by_name(
    tmp_path: Path, other: RecordingRequest, named: str
) -> None:
    record(tmp_path, REQUEST, 0)
    with pytest.raises(OtherRequest, match=named):
        missing(tmp_path, other)


def test_another_version_of_a_package_is_refused_by_name(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0)
    said = content(tmp_path)
    said["settings"]["laboratory"]["versions"]["numpy"] = "1.0"
    (tmp_path / MANIFEST).write_text(json.dumps(said))
    with pytest.raises(OtherRequest, match=r"laboratory\.versions\.numpy 1\.0 there"):
        missing(tmp_path)


def test_episodes_without_a_manifest_are_left_alone(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0)
    (tmp_path / MANIFEST).unlink()
    with pytest.raises(OccupiedOutput, match=r"1 recordings, such as episode-5-00000\.mcap"):
        missing(tmp_path)


def test_a_manifest_of_another_version_is_refused(tmp_path: Path) -> None:
    record(tmp_path, REQUEST, 0)
    (tmp_path / MANIFEST).write_text(json.dumps(content(tmp_path) | {"version": 2}))
    with pytest.raises(BadManifest, match="it has version 2, this dnet writes 1"):
        missing(tmp_path)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "Expecting value"),
        ('{"version": 1', "Expecting ',' delimiter"),
        ("[1]", "list indices"),
        ('{"version": 1, "pairs": 1, "settings": {}}', "it lacks 'episodes'"),
        ('{"version": 1, "pairs": "1", "settings": {}, "episodes": {}}', "its pairs or settings"),
        ('{"version": 1, "pairs": 1, "settings": {}, "episodes": {"e": {}}}', "it lacks 'bytes'"),
    ],
)
def test_a_garbled_manifest_is_refused(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(BadManifest, match=why):
        missing(tmp_path)


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A recording, and its manifest."""
    folder = tmp_path_factory.mktemp("begun")
    record(folder, REQUEST, 0)
    return folder, (folder / MANIFEST).read_text()


WORDS = st.text("abc", max_size=3)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | WORDS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=3),
    max_leaves=5,
)


@settings(deadline=None, max_examples=60)
@given(data=st.data(), other=JSON)
def test_whatever_a_manifest_says_it_is_taken_or_refused(
    begun: tuple[Path, str], data: st.DataObject, other: Any
) -> None:
    folder, text = begun
    place = said = json.loads(text)
    while True:
        key = data.draw(st.sampled_from(sorted(place)))
        if not isinstance(place[key], dict) or not place[key] or data.draw(st.booleans()):
            break
        place = place[key]
    place[key] = other
    (folder / MANIFEST).write_text(json.dumps(said))
    # Any other exception than a refusal fails the test.
    with suppress(DnetError):
        opened = open_manifest(FolderStore(folder), REQUEST)
        opened.write()
        assert set(opened.missing()) <= {0, 1, 2}


def test_settings_differ_where_they_say_so_and_absence_is_none() -> None:
    old = {"a": 1, "b": {"c": [1, 2], "d": None}, "gone": 3}
    new = {"a": 1, "b": {"c": [1, 3]}, "e": None}
    assert differences(old, new) == ["b.c [1, 2] there, [1, 3] now", "gone 3 there, None now"]
    assert differences(old, old) == []

from pathlib import Path

import pytest

from dnet.errors import TooLarge
from dnet.files.sizes import parse_json, read_at_most, read_json


def test_a_file_is_read_up_to_its_limit_and_not_beyond(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_at_most(path, 5, what="note") == b"12345"
    with pytest.raises(TooLarge, match=r"note .*file has 5 bytes, at most 4 are read"):
        read_at_most(path, 4, what="note")


def test_a_limit_beyond_all_memory_costs_none(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_at_most(path, 2**60, what="note") == b"12345"


def test_a_file_without_an_end_is_not_read_to_its_end() -> None:
    with pytest.raises(TooLarge):
        read_at_most(Path("/dev/zero"), 1000, what="note")


def test_a_file_that_is_huge_and_empty_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sparse.json"
    with path.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(TooLarge, match=f"has {2**40} bytes"):
        read_json(path, what="config")


def test_json_is_a_value_or_a_value_error() -> None:
    assert parse_json('{"a": [1, null]}') == {"a": [1, None]}
    for text in ("", "{", "[" * 100_000, b"\xff\xfe", "9" * 5000):
        with pytest.raises(ValueError, match=r"."):
            parse_json(text)

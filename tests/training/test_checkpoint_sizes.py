"""Networks that are larger than any: refused before there is memory for them."""

import json
import struct
from pathlib import Path

import pytest

from dnet.errors import TooLarge
from dnet.training.checkpoints import LARGEST_CHECKPOINT, LARGEST_HEADER, load_any
from dnet.training.run import CONFIG, METRICS, is_finished, read_config


def sparse(path: Path, size: int, head: bytes = b"") -> Path:
    with path.open("wb") as file:
        file.write(head)
        file.truncate(size)
    return path


def test_a_checkpoint_larger_than_any_network_is_refused(tmp_path: Path) -> None:
    path = sparse(tmp_path / "a.safetensors", LARGEST_CHECKPOINT + 1)
    with pytest.raises(TooLarge, match=f"{LARGEST_CHECKPOINT + 1} bytes, at most"):
        load_any(path)


def test_a_header_larger_than_any_is_refused(tmp_path: Path) -> None:
    size = LARGEST_HEADER + 1
    path = sparse(tmp_path / "a.safetensors", size + 100, struct.pack("<Q", size))
    with pytest.raises(TooLarge, match=f"header of the checkpoint .* has {size} bytes"):
        load_any(path)


def test_a_config_and_a_history_larger_than_any_are_refused(tmp_path: Path) -> None:
    sparse(tmp_path / CONFIG, 2**40)
    with pytest.raises(TooLarge, match="config"):
        read_config(tmp_path)
    sparse(tmp_path / METRICS, 2**40)
    with pytest.raises(TooLarge, match="history"):
        is_finished(tmp_path)


def test_a_history_of_something_else_is_of_no_finished_training(tmp_path: Path) -> None:
    for content in ("", "[]", "3", "[" * 5000, json.dumps({"progress": "x"})):
        (tmp_path / METRICS).write_text(content)
        assert not is_finished(tmp_path)

"""What the metadata of an episode ask for: within bounds, or refused before there is a mesh."""

import json
from typing import Any

import pytest

from dnet.datasets.messages import LARGEST_DOCUMENT, MOST_CELLS, read_meta, read_result
from dnet.recorders.episode import _meta_record
from tests.recorders.rollout import meta


def record(**tissue: Any) -> dict[str, str]:
    told = _meta_record(meta())
    scene = json.loads(told["scene"])
    scene["tissue"] |= tissue
    return told | {"scene": json.dumps(scene)}


def test_what_dnet_writes_is_read() -> None:
    assert read_meta(record()) == meta()


@pytest.mark.parametrize(
    "cells", [[10**6, 10**6, 10**6], [MOST_CELLS + 1, 1, 1], [0, 1, 1], [-1, -1, 1], [1.5, 1, 1]]
)
def test_a_mesh_beyond_all_memory_is_refused(cells: list[float]) -> None:
    with pytest.raises(ValueError, match=f"cells, at most {MOST_CELLS}"):
        read_meta(record(cells=cells))


def test_an_object_of_less_than_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="an object of"):
        read_meta(record(size=[0.1, -0.1, 0.1]))


def test_a_document_larger_than_any_is_not_parsed() -> None:
    with pytest.raises(ValueError, match=f"at most {LARGEST_DOCUMENT} are parsed"):
        read_result({"note": " " * (LARGEST_DOCUMENT + 1)})

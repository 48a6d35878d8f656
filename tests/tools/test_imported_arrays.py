from pathlib import Path

import numpy as np
import pytest

from dnet.errors import BadArrays
from dnet.tools import imported_arrays


def test_arrays_that_inflate_beyond_the_limit_are_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(imported_arrays, "LARGEST_ARRAYS", 10**6)
    np.savez_compressed(tmp_path / "a.npz", clouds=np.zeros((1, 10**6, 3), np.float32))
    assert (tmp_path / "a.npz").stat().st_size < 10**5
    with pytest.raises(BadArrays, match="bytes when unpacked, at most"):
        imported_arrays.read_arrays(tmp_path / "a.npz")

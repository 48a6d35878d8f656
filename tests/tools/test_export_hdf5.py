"""h5py reads the frames from HDF5 bit for bit."""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from dnet.datasets.index import open_index
from dnet.errors import MissingExtra
from dnet.tools.export_hdf5 import export_hdf5
from tests.tools.exported import (
    LENGTHS,
    assert_frames,
    logged,
    logged_meta,
    plain,
    write_exportable,
)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_exportable(tmp_path_factory.mktemp("exported") / "data")


def test_h5py_reads_the_frames_bit_for_bit(tmp_path: Path, data: Path) -> None:
    done = export_hdf5(open_index(data), tmp_path / "all.h5")
    assert done.episodes == len(LENGTHS)
    with h5py.File(tmp_path / "all.h5") as file:
        assert file.attrs["schema_version"] == "1"
        assert list(file) == [f"episode-{number}" for number in range(3)]
        for name, group in file.items():
            log = data / f"{name}.mcap"
            arrays = {key: group[key][()] for key in group}
            arrays["kinds"] = group["kinds"].asstr()[()]
            assert_frames(arrays, logged(log))
            assert json.loads(group["meta"].asstr()[()]) == plain(logged_meta(log))


def test_a_frame_is_read_without_the_others(tmp_path: Path, data: Path) -> None:
    export_hdf5(open_index(data), tmp_path / "all.h5")
    frames = logged(data / "episode-2.mcap")
    with h5py.File(tmp_path / "all.h5") as file:
        clouds = file["episode-2/clouds"]
        assert clouds.chunks is None
        start, size = clouds.id.get_offset(), frames[0].cloud.nbytes
    mapped = np.memmap(tmp_path / "all.h5", "u1", "r")
    assert mapped[start + 7 * size :][:size].tobytes() == frames[7].cloud.tobytes()


def test_who_lacks_h5py_is_told_what_to_install(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingExtra, match=r'pip install "deformernet\[exchange\]"'):
        export_hdf5(open_index(data), tmp_path / "all.h5")
    assert not list(tmp_path.iterdir())

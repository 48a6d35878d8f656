"""The whole files that a fuzzer begins with: `python -m tests.fuzz.seeds` writes them anew.

Their checksums are left out where a reader allows for that: a mutation would fail at them, and the
code behind would never be reached.
"""

import io
import json
import struct
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mcap.writer import CompressionType
from numpy.typing import NDArray
from safetensors.numpy import save as save_tensors

from dnet.datasets.index import INDEX, open_index
from dnet.datasets.index_file import HEAD
from dnet.geometry.camera import Camera
from dnet.sim.urdf import psm_urdf
from dnet.weights import HU
from tests.datasets.surgery import Message, mend, rewrite
from tests.fuzz import targets
from tests.recorders import rollout

POINTS = 8


def write_seeds(corpus: Path) -> None:
    """Write all of them."""
    for write in (_episodes, _index, _checkpoints, _goals, _urdf, _arrays, _settings):
        write(corpus)


def _put(folder: Path, name: str, content: bytes) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content)


def _episodes(corpus: Path) -> None:
    camera = Camera(width=4, height=3)
    seen = [rollout.with_image(one, camera) for one in rollout.frames(2, points=4)][:2]
    with TemporaryDirectory() as place:
        source, run = Path(place) / "plain.mcap", Path(place) / "servo.mcap"
        rollout.write(source, seen, camera=camera)
        rollout.write_servo(run)
        for name, path, compression in (
            ("plain", source, CompressionType.NONE),
            ("zstd", source, CompressionType.ZSTD),
            ("lz4", source, CompressionType.LZ4),
            ("servo", run, CompressionType.ZSTD),
        ):
            copy = rewrite(
                path,
                Path(place) / "copy.mcap",
                _few_points,
                compression=compression,
                attachments={"psm.urdf": b"<robot name='r'><link name='l'/></robot>"},
                schemas=lambda schema, encoding, _data: (schema, encoding, b""),
            )
            _put(corpus / "episode", f"{name}.mcap", _unchecked(copy.read_bytes()))


def _few_points(one: Message) -> list[Message]:
    return [one]


def _unchecked(content: bytes) -> bytes:
    return mend(bytearray(content), crc=lambda _content: 0)


def _index(corpus: Path) -> None:
    with TemporaryDirectory() as place:
        root = Path(place) / "indexed"
        targets.indexed(root)
        open_index(root)
        _put(corpus / "index", "body", (root / INDEX).read_bytes()[HEAD:])


def _checkpoints(corpus: Path) -> None:
    folder = corpus / "checkpoint"
    _put(folder, "hu", HU.read_bytes())
    header = {
        "network": "DeformerNet",
        "config": {
            "size": "light",
            "norm": "group",
            "points": 512,
            "coordinates": "relative",
            "density": True,
            "motion_unit": 0.01,
        },
        "metrics": {"epoch": 1},
    }
    tensors: dict[str, NDArray[Any]] = {
        "a.weight": np.zeros((2, 3), np.float32),
        "b": np.zeros(0, np.int64),
    }
    for network in ("DeformerNet", "HuNet", "DensePredictor", "KeypointNet", "PointRegressor"):
        text = json.dumps({**header, "network": network})
        _put(folder, network, save_tensors(tensors, metadata={"dnet": text}))


def _goals(corpus: Path) -> None:
    folder = corpus / "goal"
    cloud = rollout.frames(1, points=POINTS)[0].cloud
    rows = "\n".join(" ".join(f"{value:.4f}" for value in row) for row in cloud.tolist())
    npy = io.BytesIO()
    np.save(npy, cloud)
    ply = f"ply\nformat {{}} 1.0\nelement vertex {POINTS}\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    ply += "end_header\n"
    pcd = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    pcd += f"WIDTH {POINTS}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {POINTS}\nDATA "
    raw = cloud.tobytes()
    # A run of literals is a compression, if a poor one (LZF: length less 1, then the bytes).
    literals = b"".join(
        bytes([len(part) - 1]) + part for part in (raw[at : at + 32] for at in range(0, 96, 32))
    )
    packed = struct.pack("<II", len(literals), len(raw)) + literals
    for suffix, name, content in (
        (".npy", "npy", npy.getvalue()),
        (".ply", "ply-ascii", (ply.format("ascii") + rows + "\n").encode()),
        (".ply", "ply-binary", ply.format("binary_little_endian").encode() + raw),
        (".pcd", "pcd-ascii", (pcd + "ascii\n" + rows + "\n").encode()),
        (".pcd", "pcd-binary", (pcd + "binary\n").encode() + raw),
        (".pcd", "pcd-compressed", (pcd + "binary_compressed\n").encode() + packed),
    ):
        _put(folder, name, bytes([targets.SUFFIXES.index(suffix)]) + content)


def _urdf(corpus: Path) -> None:
    folder = corpus / "urdf"
    _put(folder, "psm", psm_urdf().encode())
    small = "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='fixed'>"
    small += "<parent link='a'/><child link='b'/></joint></robot>"
    _put(folder, "small", small.encode())
    bomb = "<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;'>]>"
    _put(folder, "bomb", f"{bomb}<robot name='&b;'/>".encode())


def _arrays(corpus: Path) -> None:
    clouds = np.stack([one.cloud for one in rollout.frames(2, points=4)])
    grasps = np.zeros((len(clouds), 3))
    arrays = {"clouds": clouds, "grasps": grasps, "kinds": np.array(["rest", "way", "shape"])}
    for name, compression in (("stored", zipfile.ZIP_STORED), ("deflated", zipfile.ZIP_DEFLATED)):
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", compression) as archive:
            for key, values in arrays.items():
                member = io.BytesIO()
                np.save(member, values)
                archive.writestr(zipfile.ZipInfo(f"{key}.npy"), member.getvalue(), compression)
        _put(corpus / "arrays", name, content.getvalue())


def _settings(corpus: Path) -> None:
    entry = {"bytes": 1, "sha256": "0", "frames": 1, "rejected": {"folded": 1}}
    manifest = {"version": 1, "pairs": 1, "settings": {}, "episodes": {"episode-0-00000": entry}}
    _put(corpus / "settings", "manifest", json.dumps(manifest).encode())


if __name__ == "__main__":
    write_seeds(targets.CORPUS)

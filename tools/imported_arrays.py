"""The arrays of one .npz, whoever wrote it, as what an episode is made of, or refused."""

import json
import lzma
import math
import re
import zipfile
import zlib
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
from jaxtyping import Float64

from dnet.errors import BadArrays, MissingPath
from dnet.types import Cloud, FrameKind, Nodes

KNOWN = ("clouds", "grasps", "kinds", "times", "joints", "nodes", "meta")
LARGEST_ARRAYS = 2**30
"""Bytes of all arrays of a file together, unpacked, that are taken: those of 40,000 frames."""
MOST_ARRAYS = 100_000
"""Arrays of a file; there are two a frame where clouds differ in their number of points."""
LONGEST = 9e9
"""Seconds of simulation that a log can hold: it counts nanoseconds in 63 bits."""

_KINDS = get_args(FrameKind)
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_NUMBERED = re.compile(r"(cloud|nodes)_(\d+)")
_UNREADABLE = (
    *(OSError, ValueError, EOFError, MemoryError, zipfile.BadZipFile, zlib.error),
    # Of a way to compress that Python does not know, of passwords, and of names that are no text.
    *(NotImplementedError, RuntimeError, KeyError, lzma.LZMAError),
)


@dataclass(frozen=True, slots=True)
class ImportedArrays:
    """What an episode is made of."""

    clouds: tuple[Cloud, ...]
    grasps: Float64[np.ndarray, "f 3"]
    kinds: tuple[FrameKind, ...]
    times: Float64[np.ndarray, " f"]
    joints: Float64[np.ndarray, "f 2 6"]
    nodes: tuple[Nodes, ...]
    meta: dict[str, Any] | None
    """What the file says of itself."""
    notes: tuple[str, ...]
    """What was converted, assumed or ignored, for people."""


def read_arrays(path: Path) -> ImportedArrays:
    """Read and check the arrays of a .npz; nothing in it is ever unpickled.

    It must hold `clouds` (f, n, 3), or `cloud_000`, `cloud_001` and so on, (n, 3) each, and
    `grasps` (f, 3), in metres. It may hold `times` (f,), seconds; `kinds` (f,), of `rest`, `shape`
    and `way`; `joints` (f, 2, 6); `nodes`, in the same two ways as the clouds; and `meta`, a text
    of a JSON object. Without them times are 0, 1, 2, and so on, the first kind is `rest` and the
    others `shape`, joints are zeros and there are no nodes.

    Raises:
        MissingPath: If there is no such file.
        BadArrays: If it is no .npz, lacks what it must hold, or an array has another shape or
            type, or holds NaN or infinity.
    """
    if not path.is_file():
        raise MissingPath(path, "file", "give one or more .npz")
    with ExitStack() as opened:
        try:
            # By a path, numpy would leave open what turns out to be no .npz.
            file = opened.enter_context(path.open("rb"))
            archive = np.load(file, allow_pickle=False)
        except _UNREADABLE as error:
            raise BadArrays(path, f"is no .npz ({error})") from error
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise BadArrays(path, "is a single array, not a .npz of several")
        _require_size(path, archive)
        return _Reading(path, opened.enter_context(archive)).all()


class _Reading:
    """One .npz while it is read."""

    def __init__(self, path: Path, archive: np.lib.npyio.NpzFile) -> None:
        self._path = path
        self._archive = archive
        self._notes: list[str] = []

    def all(self) -> ImportedArrays:
        clouds = self._point_sets("clouds", "cloud")
        if clouds is None:
            raise self._bad("has neither `clouds` (f, n, 3) nor `cloud_000` (n, 3) and so on")
        if not clouds or not all(map(len, clouds)):
            raise self._bad("has no frame, or a cloud without points")
        count = len(clouds)
        if "grasps" not in self._archive:
            raise self._bad("has no `grasps` (f, 3): where the object was held at each cloud")
        nodes = self._point_sets("nodes", "nodes")
        if nodes is None:
            self._notes.append("no nodes")
            nodes = (np.zeros((0, 3), np.float32),) * count
        if len(nodes) != count:
            raise self._bad(f"has nodes of {len(nodes)} frames and clouds of {count}")
        return ImportedArrays(
            clouds=clouds,
            grasps=self._numbers("grasps", (count, 3), np.float64),
            kinds=self._kinds(count),
            times=self._times(count),
            joints=self._joints(count),
            nodes=nodes,
            meta=self._meta(),
            notes=(*self._notes, *self._ignored()),
        )

    def _point_sets(self, several: str, one: str) -> tuple[Cloud, ...] | None:
        if several in self._archive:
            return tuple(self._numbers(several, (None, None, 3), np.float32))
        numbered = {
            int(found[2]): name
            for name in self._archive
            if (found := _NUMBERED.fullmatch(name)) and found[1] == one
        }
        if not numbered:
            return None
        if sorted(numbered) != list(range(len(numbered))):
            raise self._bad(f"has {len(numbered)} arrays `{one}_...`, not numbered from 0 on")
        ordered = [numbered[number] for number in range(len(numbered))]
        return tuple(self._numbers(name, (None, 3), np.float32) for name in ordered)

    def _kinds(self, count: int) -> tuple[FrameKind, ...]:
        if "kinds" not in self._archive:
            self._notes.append("kinds assumed: rest, then shape")
            later: list[FrameKind] = ["shape"] * (count - 1)
            return ("rest", *later)
        values = self._array("kinds")
        self._require_shape("kinds", values, (count,))
        if values.dtype.kind not in "US":
            raise self._bad(f"`kinds` is of type {values.dtype}, must be text")
        kinds = values.astype("U").tolist() if values.dtype.kind == "U" else _decoded(values)
        others = sorted(set(kinds) - set(_KINDS))
        if others:
            raise self._bad(f"`kinds` has {others[0][:40]!r}, not one of {', '.join(_KINDS)}")
        return cast("tuple[FrameKind, ...]", tuple(kinds))

    def _times(self, count: int) -> Float64[np.ndarray, " f"]:
        if "times" not in self._archive:
            self._notes.append("times assumed: 0, 1, 2, ...")
            return np.arange(count, dtype=np.float64)
        times = self._numbers("times", (count,), np.float64, kinds="fiu")
        if (np.diff(times) < 0).any():
            raise self._bad("`times` run backwards")
        if times[0] < 0 or times[-1] > LONGEST:
            raise self._bad(
                f"`times` are from {times[0]:.6g} to {times[-1]:.6g} s, must be from 0 to "
                f"{LONGEST:g} s"
            )
        return times

    def _joints(self, count: int) -> Float64[np.ndarray, "f 2 6"]:
        if "joints" not in self._archive:
            self._notes.append("joints assumed: zeros")
            return np.zeros((count, 2, 6))
        return self._numbers("joints", (count, 2, 6), np.float64)

    def _meta(self) -> dict[str, Any] | None:
        if "meta" not in self._archive:
            return None
        text = self._array("meta")
        if text.dtype.kind != "U" or text.size != 1:
            raise self._bad(f"`meta` is {text.dtype} {text.shape}, must be one text")
        try:
            meta = json.loads(text.item())
        except (ValueError, RecursionError) as error:
            raise self._bad(f"`meta` is no JSON ({error})") from error
        if not isinstance(meta, dict):
            raise self._bad("`meta` is JSON, but no object")
        return meta

    def _ignored(self) -> tuple[str, ...]:
        names = [
            name for name in self._archive if name not in KNOWN and not _NUMBERED.fullmatch(name)
        ]
        return (f"ignored: {', '.join(names[:4])}{', ...' * (len(names) > 4)}",) if names else ()

    def _numbers(
        self, name: str, shape: Sequence[int | None], dtype: type[np.floating], *, kinds: str = "f"
    ) -> Any:
        values = self._array(name)
        if values.dtype.kind not in kinds:
            raise self._bad(f"`{name}` is of type {values.dtype}, must be {dtype.__name__}")
        self._require_shape(name, values, shape)
        # Too large a number becomes infinity, which is refused.
        with np.errstate(over="ignore"):
            converted = values.astype(dtype)
        if not np.isfinite(converted).all():
            bad = np.argwhere(~np.isfinite(converted))[0].tolist()
            raise self._bad(f"`{name}` at {bad} is {values[tuple(bad)]}, must be a number")
        if values.dtype.itemsize > converted.dtype.itemsize:
            self._notes.append(f"{name} converted from {values.dtype} to {converted.dtype}")
        return converted

    def _require_shape(self, name: str, values: np.ndarray, shape: Sequence[int | None]) -> None:
        fits = values.ndim == len(shape) and all(
            want in (None, got) for got, want in zip(values.shape, shape, strict=True)
        )
        if not fits:
            wanted = ", ".join("any" if want is None else str(want) for want in shape)
            raise self._bad(f"`{name}` has shape {values.shape}, must have ({wanted})")

    def _array(self, name: str) -> np.ndarray:
        try:
            _require_room(self._archive, name)
            return np.asarray(self._archive[name])
        except _UNREADABLE as error:
            raise self._bad(f"has an unreadable `{name}` ({error})") from error

    def _bad(self, why: str) -> BadArrays:
        return BadArrays(self._path, why)


def _require_size(path: Path, archive: np.lib.npyio.NpzFile) -> None:
    """Refuse a file that becomes larger than any episode when it is unpacked.

    Raises:
        BadArrays: If it says so of itself; more than it says is not unpacked.
    """
    members = _zip(archive).infolist()
    size = sum(one.file_size for one in members)
    if size > LARGEST_ARRAYS or len(members) > MOST_ARRAYS:
        raise BadArrays(
            path,
            f"holds {len(members)} arrays of {size} bytes when unpacked, at most {MOST_ARRAYS} and "
            f"{LARGEST_ARRAYS} are taken",
        )


def _require_room(archive: np.lib.npyio.NpzFile, name: str) -> None:
    """Refuse an array of more numbers than its member of the file has bytes for.

    Raises:
        ValueError: If it is such a one, or none; or another of `_UNREADABLE`.
    """
    opened = _zip(archive)
    names = opened.namelist()
    member = name if name in names else f"{name}.npy"
    with opened.open(member) as file:
        version = np.lib.format.read_magic(file)
        if version not in _HEADERS:
            raise ValueError(f"an array of version {version}")
        shape, _, dtype = _HEADERS[version](file)
    need, there = math.prod(shape) * dtype.itemsize, opened.getinfo(member).file_size
    if need > there:
        raise ValueError(f"an array of {need} bytes, of which there are {there}")


def _zip(archive: np.lib.npyio.NpzFile) -> zipfile.ZipFile:
    if archive.zip is None:
        raise ValueError("it is closed")
    return archive.zip


def _decoded(values: np.ndarray) -> list[str]:
    return [value.decode("ascii", "replace") for value in values.tolist()]

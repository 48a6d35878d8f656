"""Episodes made of .npz files: those of `dnet inspect export`, and other people's clouds."""

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dnet.datasets.messages import UNREADABLE, WORLD, read_meta
from dnet.datasets.reader import SCHEMA_VERSION
from dnet.errors import BadArrays, OccupiedOutput, Unwritten
from dnet.geometry.sampling import farthest_rows
from dnet.recorders.arms import TIP
from dnet.recorders.episode import EpisodeWriter
from dnet.sim.psm import JOINT_NAMES
from dnet.tools.imported_arrays import ImportedArrays, read_arrays
from dnet.types import Cloud, EpisodeMeta, Frame, Joints, Point, Scene, Tissue, Transform

UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Imported:
    """An episode that was made."""

    file: Path
    """The .npz."""
    episode: Path
    """The .mcap."""
    frames: int
    notes: tuple[str, ...]
    """What was converted, assumed, reordered or ignored, for people; its settings say it too."""


class TipAlone:
    """Arms of which nothing is known but where the tip of the moving one is.

    Where they stand is in no .npz, and links at made-up places would be taken for real ones.
    """

    joint_names: tuple[str, ...] = JOINT_NAMES

    def __init__(self) -> None:
        self.tip: Point = np.zeros(3)
        """Where it is now, in the world."""

    def transforms(self, joints: tuple[Joints, Joints]) -> list[Transform]:  # noqa: ARG002
        """Return the tip alone, its orientation unknown and left unturned."""
        return [Transform(WORLD, TIP, self.tip, UNTURNED)]


def import_files(
    paths: Sequence[Path],
    out: Path,
    *,
    on_file: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[Imported]:
    """Make an episode of each file.

    Args:
        paths: The .npz files.
        out: The folder of the episodes; it may hold others.
        on_file: Called with the number of files that are done and of all.

    Raises:
        MissingPath: If a file does not exist.
        BadArrays: If one does not hold what an episode is made of; those before it are imported.
        OccupiedOutput: If there is an episode of its name already.
        Unwritten: If nothing can be written there.
    """
    made = []
    for done, path in enumerate(paths, start=1):
        made.append(import_npz(path, out))
        on_file(done, len(paths))
    return made


def import_npz(path: Path, out: Path) -> Imported:
    """Make the episode `NAME.mcap` of `NAME.npz`, whose arrays `read_arrays` describes.

    A file of `dnet inspect export` gives the same frames again. Other clouds are put into
    farthest-point order, on which networks rely, and what is not known of the scene is set to
    something that the settings name.

    Args:
        path: The .npz.
        out: The folder of the episode.

    Raises:
        MissingPath: If there is no such file.
        BadArrays: If it does not hold what an episode is made of.
        OccupiedOutput: If there is an episode of its name already.
        Unwritten: If nothing can be written there.
    """
    arrays = read_arrays(path)
    name = path.name.removesuffix(".npz")
    meta, result, notes = _described(path, name, arrays)
    clouds = arrays.clouds
    if not _ours(arrays):
        clouds = tuple(cloud[farthest_rows(cloud, len(cloud))] for cloud in clouds)
        if not all(map(np.array_equal, clouds, arrays.clouds)):
            notes = (*notes, "points put into farthest-point order")
    meta.settings["imported"] = {"from": path.name, "notes": list(notes)}
    target = out / f"{name}.mcap"
    _write(target, meta, result=result, arrays=arrays, clouds=clouds)
    return Imported(path, target, len(clouds), notes)


def _write(
    target: Path,
    meta: EpisodeMeta,
    *,
    result: dict[str, Any] | None,
    arrays: ImportedArrays,
    clouds: Sequence[Cloud],
) -> None:
    part = target.with_name(f"{target.name}.part")
    if part.exists():
        raise OccupiedOutput(part, "an unfinished episode")
    arms = TipAlone()
    try:
        with EpisodeWriter(target, meta, arms=arms, attachments={}) as writer:
            for number, cloud in enumerate(clouds):
                left, right = arrays.joints[number]
                arms.tip = arrays.grasps[number]
                writer.add(
                    Frame(
                        time=float(arrays.times[number]),
                        kind=arrays.kinds[number],
                        cloud=cloud,
                        grasp=arrays.grasps[number],
                        joints=(left, right),
                        nodes=arrays.nodes[number],
                    )
                )
            if result is not None:
                writer.finish(result)
        # A recording that was cut short stays one: it gets its name without a result.
        if result is None:
            if target.exists():
                raise OccupiedOutput(target, "an episode")
            part.rename(target)
    except OccupiedOutput:
        raise
    except OSError as error:
        raise Unwritten(target.parent, error.strerror or str(error)) from error
    finally:
        with suppress(OSError):
            part.unlink()


def _ours(arrays: ImportedArrays) -> bool:
    return arrays.meta is not None and "schema_version" in arrays.meta


def _described(
    path: Path, name: str, arrays: ImportedArrays
) -> tuple[EpisodeMeta, dict[str, Any] | None, tuple[str, ...]]:
    """Return what is known of the episode: its metadata, its result, and notes for people."""
    if not _ours(arrays):
        settings = {} if arrays.meta is None else {"meta": arrays.meta}
        meta = EpisodeMeta(name, 0, 0, _assumed_scene(arrays), settings)
        unknown = "scene measured from the first frame; hold, yaw and material are not known"
        return meta, {"frames": len(arrays.clouds)}, (*arrays.notes, unknown)
    told = arrays.meta or {}
    if told["schema_version"] != SCHEMA_VERSION:
        raise BadArrays(
            path,
            f"has schema version {told['schema_version']!r}, this dnet reads {SCHEMA_VERSION!r}",
        )
    try:
        texts = {key: json.dumps(told[key]) for key in ("seed", "index", "scene", "settings")}
        meta = read_meta({"episode_id": str(told["episode_id"]), **texts})
        result = None if told["result"] is None else dict(told["result"])
    except UNREADABLE as error:
        raise BadArrays(path, f"has a `meta` that describes no episode ({error!r})") from error
    renamed = () if meta.episode_id == name else (f"was called {meta.episode_id}",)
    return replace(meta, episode_id=name), result, (*arrays.notes, *renamed)


def _assumed_scene(arrays: ImportedArrays) -> Scene:
    """Return a scene as far as the first frame shows it."""
    low, high = arrays.clouds[0].min(axis=0), arrays.clouds[0].max(axis=0)
    x, y, _ = ((low + high) / 2).tolist()
    length, width, height = (high - low).tolist()
    grasp = arrays.grasps[0].tolist()
    return Scene(
        position=(x, y),
        yaw=0.0,
        hold=(0.0, 0.0, 0.0),
        manipulation_point=(grasp[0], grasp[1], grasp[2]),
        tissue=Tissue(size=(length, width, height)),
    )

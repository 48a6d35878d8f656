"""Rerun's own loader draws an episode as it is, without a converter and without a blueprint."""

from typing import Any

import numpy as np
import pytest
from rerun.chunk import McapReader

from dnet.geometry.camera import Camera
from dnet.recorders.episode import EpisodeWriter
from dnet.types import ARMS as ARM_NAMES
from tests.recorders.rollout import ARMS, frames, meta, step, with_image

CAMERA = Camera(width=32, height=24)
SEEN = frames(3)

Columns = dict[tuple[str, str], list[Any]]


@pytest.fixture(scope="module")
def columns(tmp_path_factory: pytest.TempPathFactory) -> Columns:
    """What Rerun makes of a servo run whose frames keep images: all values by topic and name."""
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    with EpisodeWriter(path, meta(), arms=ARMS, attachments={}, camera=CAMERA) as writer:
        writer.set_goal(SEEN[-1].cloud)
        for index, one in enumerate(SEEN):
            writer.add(with_image(one, CAMERA))
            writer.add_step(step(one, SEEN[-1]), index)
        writer.finish({})
    found: Columns = {}
    for chunk in McapReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            values = batch.column(name).to_pylist()
            found.setdefault((str(chunk.entity_path), name), []).extend(values)
    return found


def test_clouds_become_points_to_the_last_bit(columns: Columns) -> None:
    for topic, wanted in (
        ("/cloud/current", [one.cloud for one in SEEN]),
        ("/cloud/nodes", [one.nodes for one in SEEN]),
        ("/cloud/goal", [SEEN[-1].cloud]),
        ("/manipulation_point", [one.grasp.astype(np.float32)[None] for one in SEEN]),
    ):
        drawn = columns[topic, "Points3D:positions"]
        for found, cloud in zip(drawn, wanted, strict=True):
            np.testing.assert_array_equal(np.array(found, np.float32), cloud)


def test_the_manipulation_point_has_a_colour_of_its_own(columns: Columns) -> None:
    colors = columns["/manipulation_point", "Points3D:colors"]
    assert colors == [[0xFF3C28FF]] * len(SEEN)


def test_every_link_of_both_arms_is_a_named_frame_that_hangs_on_the_world(
    columns: Columns,
) -> None:
    parents = dict(
        zip(
            (child for (child,) in columns["/tf", "Transform3D:child_frame"]),
            (parent for (parent,) in columns["/tf", "Transform3D:parent_frame"]),
            strict=True,
        )
    )
    wanted = {link.child for link in ARMS.transforms(SEEN[0].joints)}
    assert {name.split("/")[0] for name in wanted} == set(ARM_NAMES)
    assert wanted | {"camera"} == parents.keys()
    for link in parents:
        at = link
        for _ in parents:
            at = parents.get(at, at)
        assert at == "world"


def test_the_calibration_becomes_a_pinhole(columns: Columns) -> None:
    ((matrix,),) = columns["/camera/calibration", "Pinhole:image_from_camera"]
    # Rerun writes it column by column.
    found = np.array(matrix, np.float32).reshape(3, 3).T
    np.testing.assert_array_equal(found, CAMERA.intrinsics.astype(np.float32))
    assert columns["/camera/calibration", "Pinhole:resolution"] == [[[32.0, 24.0]]]


def test_the_log_becomes_text(columns: Columns) -> None:
    said = [text for (text,) in columns["/log", "TextLog:text"]]
    assert [line.split(":")[0] for line in said if line.startswith("step")] == [
        f"step {index}" for index in range(len(SEEN))
    ]
    assert "frame 0: rest" in said
    assert {level for (level,) in columns["/log", "TextLog:level"]} == {"INFO"}

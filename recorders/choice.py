"""Where an object is grasped and why: the point, a heat map of the cloud, matching keypoints."""

import numpy as np
import rerun as rr
from jaxtyping import Float
from matplotlib import colormaps

from dnet.recorders.rerun_scene import CURRENT_COLOR, POINT_RADIUS
from dnet.types import Cloud, KeypointPairs, Point

CHOICE = "choice"
"""Where a servo run keeps it."""
CHOSEN_COLOR = (70, 120, 255)
COUNTED_COLOR = (60, 220, 90)
RADIUS = 0.0028


def log_choice(
    recording: rr.RecordingStream,
    initial: Cloud,
    point: Point,
    *,
    heat: Float[np.ndarray, " n"] | None,
    keypoints: KeypointPairs | None,
) -> None:
    """Log where a run grasps an object that is at rest, from now on.

    Args:
        recording: Where to.
        initial: What is seen before the grasp, in metres.
        point: That was chosen.
        heat: How good each point would be, if the method tells.
        keypoints: That it was chosen by, if there are any.
    """
    recording.log(f"{CHOICE}/cloud", cloud_points(initial, heat))
    marked = rr.Points3D(
        [point], labels=["chosen"], show_labels=True, colors=CHOSEN_COLOR, radii=RADIUS
    )
    recording.log(f"{CHOICE}/point", marked)
    # A choice that has none takes away those of the one before.
    recording.log(f"{CHOICE}/keypoints", rr.Clear(recursive=True))
    if keypoints is not None:
        log_keypoint_pairs(recording, keypoints, f"{CHOICE}/keypoints")


def log_keypoint_pairs(recording: rr.RecordingStream, pairs: KeypointPairs, place: str) -> None:
    """Log keypoints in both clouds, lines between matching ones, and those that count.

    Args:
        recording: Where to.
        pairs: The farther one moves, the brighter it is; the more it counts, the larger.
        place: The entity that all hang under.
    """
    moved = np.linalg.norm(pairs.goal - pairs.initial, axis=1)
    colors = heat_colors(moved)
    labels = [str(number) for number in range(len(moved))]
    for entity, places in (("initial", pairs.initial), ("goal", pairs.goal)):
        recording.log(
            f"{place}/{entity}",
            rr.Points3D(places, colors=colors, radii=0.0012, labels=labels, show_labels=False),
        )
    strips = np.stack([pairs.initial, pairs.goal], axis=1)
    recording.log(f"{place}/lines", rr.LineStrips3D(strips, colors=colors, radii=0.0003))
    chosen = pairs.weights > 0
    sizes = 0.001 + 0.002 * pairs.weights[chosen] / pairs.weights.max()
    marked = rr.Points3D(pairs.initial[chosen], colors=COUNTED_COLOR, radii=sizes)
    recording.log(f"{place}/chosen", marked)


def cloud_points(cloud: Cloud, heat: Float[np.ndarray, " n"] | None) -> rr.Points3D:
    """Return a cloud as Rerun draws it, each point as bright as it is good."""
    # A view of a file may lie at an odd address, on which Rerun ends the process.
    points = np.require(cloud, dtype=np.float32, requirements=["C", "ALIGNED"])
    colors = CURRENT_COLOR if heat is None else heat_colors(heat)
    return rr.Points3D(points, colors=colors, radii=POINT_RADIUS)


def heat_colors(values: Float[np.ndarray, " n"]) -> np.ndarray:
    """Return a colour for each value, the brightest for the greatest."""
    top = values.max(initial=0.0)
    shares = values / top if top > 0 else values
    return (255 * colormaps["inferno"](0.25 + 0.75 * shares)[:, :3]).astype(np.uint8)

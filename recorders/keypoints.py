"""What a recording of shapes is seen against: its rest shape, and the points that are held."""

import numpy as np
import rerun as rr

from dnet.recorders.rerun_scene import POINT_RADIUS
from dnet.types import Cloud, Point

REST = "cloud/rest"
KEYPOINTS = "keypoints"
REST_COLOR = (150, 152, 160)
KEYPOINT_COLOR = (255, 196, 0)


def log_rest_shape(recording: rr.RecordingStream, cloud: Cloud) -> None:
    """Log the shape before any motion, grey and with its name, for all times."""
    # A view of a file may lie at an odd address, on which Rerun ends the process.
    points = np.require(cloud, dtype=np.float32, requirements=["C", "ALIGNED"])
    look = rr.Points3D(points, colors=REST_COLOR, radii=0.8 * POINT_RADIUS)
    recording.log(REST, look, static=True)
    if len(cloud):
        # The corner nearest to the lower right of the view, away from the arms.
        corner = points[(points[:, 0] - points[:, 2]).argmax()]
        _log_named(recording, f"{REST}/label", "rest shape", corner, color=REST_COLOR)


def log_keypoint(recording: rr.RecordingStream, name: str, point: Point) -> None:
    """Log a point that stays where it is, with its name."""
    _log_named(recording, f"{KEYPOINTS}/{name}", name, point, color=KEYPOINT_COLOR, radius=0.003)


def _log_named(
    recording: rr.RecordingStream,
    entity: str,
    name: str,
    point: np.ndarray,
    *,
    color: tuple[int, int, int],
    radius: float = POINT_RADIUS,
) -> None:
    look = rr.Points3D([point], labels=[name], show_labels=True, colors=color, radii=radius)
    recording.log(entity, look, static=True)

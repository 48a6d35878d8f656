"""What is asked of a recording: how much, of what, from which seed."""

import json
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

from dnet.laboratory import LaboratorySettings
from dnet.sim.tissue_families import TissueFamily

NODES_EXPECTED = 600
FRAME_OVERHEAD = 4000
"""Bytes of a frame besides its clouds and images: joints, transforms, indexes."""
EPISODE_OVERHEAD = 200_000
"""Bytes of an episode besides its frames: URDF, mesh, settings, schemas."""
SECONDS_A_SHAPE = 1.0
"""Of simulation on the way to a shape, at most."""


@dataclass(frozen=True)
class RecordingRequest:
    """Everything that decides the bytes of a dataset."""

    pairs: int
    """Pairs of initial configuration and manipulation point, one episode each."""
    shapes: int
    """Settled random shapes an episode, besides the rest shape."""
    seed: int = 0
    rate: float = 0.0
    """Frames on the way to each shape, a second of simulation."""
    images: bool = False
    """Whether frames carry their depth and mask image."""
    tissue: TissueFamily = field(default_factory=TissueFamily)
    """What objects are drawn from."""
    laboratory: LaboratorySettings = field(default_factory=LaboratorySettings)

    def episode_id(self, index: int) -> str:
        """Return the name of the episode of one pair."""
        return f"episode-{self.seed}-{index:05d}"

    @cached_property
    def settings(self) -> dict[str, Any]:
        """What shapes each episode, as JSON would have it: all but the number of pairs."""
        described = asdict(self) | {"laboratory": self.laboratory.describe()}
        del described["pairs"]
        ordered: dict[str, Any] = json.loads(json.dumps(described, sort_keys=True))
        return ordered

    def episode_bytes(self) -> int:
        """Return how much room an episode takes on a disk, roughly and rather too much."""
        frame = FRAME_OVERHEAD + 12 * self.laboratory.points
        frame += 12 * NODES_EXPECTED
        if self.images:
            camera = self.laboratory.bullet.camera
            frame += 5 * camera.width * camera.height
        frames = 1 + self.shapes * (1 + self.rate * SECONDS_A_SHAPE)
        return int(EPISODE_OVERHEAD + frames * frame)


def differences(old: Any, new: Any, name: str = "") -> list[str]:
    """Return what differs between two settings, one line each; what is absent is None."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = sorted(old.keys() | new.keys())
        return [
            line
            for key in keys
            for line in differences(old.get(key), new.get(key), f"{name}.{key}".lstrip("."))
        ]
    return [] if old == new else [f"{name} {old} there, {new} now"]

"""How a run looks at the world: a camera that may be noisy, lose images, or see past the arms."""

from collections.abc import Iterator
from contextlib import ExitStack, closing

import numpy as np

from dnet.errors import ShortCloud
from dnet.geometry.camera import DepthImage
from dnet.laboratory import Laboratory
from dnet.trials.request import Trial
from dnet.types import Frame, FrameKind, Scene


class Eyes:
    """Looks at the laboratory, and says what it sees as a frame."""

    def __init__(self, lab: Laboratory, scene: Scene, trial: Trial) -> None:
        """Set the camera up for a trial."""
        self._lab, self._dropped = lab, trial.dropped
        # Streams of their own: what is noisy does not decide about what is lost.
        self._noise = np.random.default_rng((trial.seed, 1))
        self._losses = np.random.default_rng((trial.seed, 2))
        self._life = ExitStack()
        self._bare = None
        if not trial.occlusion:
            self._bare = self._life.enter_context(closing(lab.portrait(scene.tissue, arms=False)))
        self._kinds = _kinds()

    def close(self) -> None:
        """Take the camera down."""
        self._life.close()

    def look(self, kind: FrameKind | None = None) -> Frame:
        """Return what is seen now.

        Args:
            kind: What the frame is; by default `rest` for the first of a run, then `shape`.

        Raises:
            ShortCloud: If the image is lost, or shows too little of the object.
        """
        world, points = self._lab.world, self._lab.settings.points
        image, number = self._image()
        if self._losses.random() < self._dropped:
            raise ShortCloud(0, points)
        cloud = self._lab.see(image, number)
        return Frame(
            time=world.time,
            kind=next(self._kinds) if kind is None else kind,
            cloud=cloud,
            grasp=world.tip,
            joints=world.joints,
            nodes=world.nodes(),
        )

    def _image(self) -> tuple[DepthImage, int]:
        world, noise = self._lab.world, self._lab.settings.noise
        if self._bare is None:
            image, number = world.look(), world.object_id
        else:
            image = self._bare.look(world.nodes(), world.joints)
            number = self._bare.object_id
        if noise is not None:
            image = noise.apply(image, random=self._noise)
        return image, number


def _kinds() -> Iterator[FrameKind]:
    """Yield what each frame of a run is: it starts from rest."""
    yield "rest"
    while True:
        yield "shape"

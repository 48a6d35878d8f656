"""`dnet record`: simulate random deformations and write them as episodes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from dnet.recording.manifest import Manifest
    from dnet.recording.request import RecordingRequest


@dataclass(frozen=True)
class Record:
    """Simulate random deformations and write each pair as an MCAP episode.

    A pair is a random pose of the object and a random manipulation point on it. For each, the
    left arm holds the object and the right arm moves the manipulation point to random places;
    every shape that comes to rest is seen by the depth camera and logged with clouds, joints,
    transforms and the true manipulation point. The same call writes the same bytes, on however
    many processes.

    Stopped by Ctrl-C or killed, the same call goes on where it stopped; with more --pairs it adds
    to what is there. OUT/manifest.json says what was asked for and what is there.

    Example: dnet record data/small --pairs 4 --shapes 20 --workers 2
    """

    out: Annotated[tyro.conf.Positional[str | Path], tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Directory for the episodes, made if need be, or a URL that fsspec can write to, such as
    s3://bucket/data (pip install "deformernet[s3]")."""
    pairs: int = 4
    """Pairs of initial configuration and manipulation point; one episode each (paper: 150)."""
    shapes: int = 20
    """Random settled shapes an episode, besides the rest shape (paper: 200)."""
    seed: int = 0
    """Of everything drawn at random."""
    workers: int = 1
    """Processes to record on; as many as there are cores is fastest."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="HOST:PORT|auto|local")] = None
    """Record on all processors of a Ray cluster instead (pip install "deformernet[ray]"): that at
    HOST:PORT, that of this machine (auto), or one for this recording alone (local). Its nodes need
    the same dnet, and OUT must be a URL or a directory that all of them share."""
    tissue: Annotated[
        Literal["box", "cylinder", "hemi_ellipsoid"], tyro.conf.arg(name="object")
    ] = "box"
    """Shape of the object; a cylinder lies, a hemi_ellipsoid has its flat side down."""
    young: float = 1000.0
    """Young's modulus of the object in pascals (paper: 1000; the follow-ups 5000 and 10000)."""
    vary: bool = False
    """Draw each object's size and Young's modulus at random, the latter about --young."""
    world: Literal["bullet", "quasistatic"] = "bullet"
    """`bullet`: dynamics in PyBullet; `quasistatic`: the equilibria of the same energy by a
    solver of our own, many times as fast."""
    drive: Literal["kinematic", "motor"] = "kinematic"
    """`kinematic`: the arms are where their path says, and what they hold goes with them;
    `motor`: motors track the path, anchors carry the object; slower. Bullet only."""
    points: int = 2048
    """Points of each cloud, by farthest point sampling (paper: 2048)."""
    rate: float = 0.0
    """Frames on the way to each shape, a second of simulation; marked `way`, 0 for none."""
    images: bool = False
    """Keep the depth image and the mask of each frame: six times the bytes."""
    depth_noise: float = 0.0
    """Noise of the depth camera; 1 is that of a Kinect, 0 none."""

    def run(self) -> None:
        """Record, with a progress bar.

        Raises:
            TooFew: If a count is below 1, or the seed below 0.
            DnetError: If the directory will not do: in use, holds something else, too small.
        """
        from rich.console import Console

        from dnet.commands.progress import progress
        from dnet.recording.dataset import record_missing, recording
        from dnet.recording.store import open_store

        self._check()
        request = self._request()
        with (
            recording(open_store(self.out, shared=self.ray is not None), request) as manifest,
            progress(Console(stderr=True), "shapes") as bars,
        ):
            begun = len(manifest.missing())
            task = bars.add_task("recording", total=begun * self.shapes)
            record_missing(
                manifest,
                workers=self.workers,
                ray=self.ray,
                progress=lambda count: bars.update(task, advance=float(count)),
            )
            seconds = bars.tasks[0].finished_time or bars.tasks[0].elapsed or 1.0
        Console().print(self._summary(manifest, begun, seconds), highlight=False)

    def _summary(self, manifest: "Manifest", recorded: int, seconds: float) -> str:
        there = len(manifest.episodes)
        episodes = f"{there} episodes with {there * self.shapes} shapes in {self.out}"
        if not recorded:
            return f"{episodes}: nothing left to record"
        speed = f"{recorded * self.shapes / seconds:.2f} shapes/s"
        if recorded < there:
            speed = f"{there - recorded} were there, {speed}"
        return f"{episodes} ({speed}, {manifest.rejected().total()} draws rejected)"

    def _request(self) -> "RecordingRequest":
        from dnet.laboratory import LaboratorySettings
        from dnet.perception.noise import DepthNoise
        from dnet.recording.request import RecordingRequest
        from dnet.sim.bullet_world import BulletSettings
        from dnet.sim.tissue_families import TissueFamily

        return RecordingRequest(
            pairs=self.pairs,
            shapes=self.shapes,
            seed=self.seed,
            rate=self.rate,
            images=self.images,
            tissue=TissueFamily(self.tissue, young=self.young, vary=self.vary),
            laboratory=LaboratorySettings(
                points=self.points,
                world=self.world,
                noise=DepthNoise(scale=self.depth_noise) if self.depth_noise else None,
                bullet=BulletSettings(drive=self.drive),
            ),
        )

    def _check(self) -> None:
        from dnet.errors import TooFew

        for what, value, least in (
            ("--pairs", self.pairs, 1),
            ("--shapes", self.shapes, 1),
            ("--points", self.points, 1),
            ("--seed", self.seed, 0),
            ("--workers", self.workers, 1),
            ("--rate", self.rate, 0),
            ("--depth-noise", self.depth_noise, 0),
        ):
            if value < least:
                raise TooFew(what, value, least)

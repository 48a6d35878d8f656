"""`dnet record`: simulate random deformations and write them as episodes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import Positional

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from dnet.commands.laboratory import Laboratory


@dataclass(frozen=True)
class Record:
    """Simulate random deformations and write each pair as an MCAP episode.

    A pair is a random pose of the soft box and a random manipulation point on it. For each, the
    left arm holds the box and the right arm moves the manipulation point to random places; every
    shape that comes to rest is seen by the depth camera and logged with clouds, joints,
    transforms and the true manipulation point. The same seed writes the same bytes.

    Example: dnet record data/small --pairs 4 --shapes 20 --seed 0
    """

    out: Positional[Path]
    """Directory for the episodes; made if need be, must hold none yet."""
    pairs: int = 4
    """Pairs of initial configuration and manipulation point; one episode each (paper: 150)."""
    shapes: int = 20
    """Random settled shapes an episode, besides the rest shape (paper: 200)."""
    seed: int = 0
    """Of everything drawn at random."""
    points: int = 2048
    """Points of each cloud, by farthest point sampling (paper: 2048)."""

    def run(self) -> None:
        """Record, with a progress bar.

        Raises:
            TooFew: If a count is below 1, or the seed below 0.
            OccupiedOutput: If the directory holds episodes already.
        """
        from rich.console import Console

        from dnet.commands.laboratory import laboratory
        from dnet.commands.progress import progress

        self._check()
        console = Console(stderr=True)
        with laboratory(self.points) as lab, progress(console, "shapes") as bars:
            task = bars.add_task("recording", total=self.pairs * self.shapes)
            rejected = sum(self._episode(lab, index, bars, task) for index in range(self.pairs))
            seconds = bars.tasks[0].finished_time or bars.tasks[0].elapsed or 1.0
        shapes = self.pairs * self.shapes
        Console().print(
            f"{self.pairs} episodes with {shapes} shapes in {self.out} "
            f"({shapes / seconds:.2f} shapes/s, {rejected} draws rejected)",
            highlight=False,
        )

    def _check(self) -> None:
        from dnet.errors import OccupiedOutput, TooFew

        for what, value, least in (
            ("--pairs", self.pairs, 1),
            ("--shapes", self.shapes, 1),
            ("--points", self.points, 1),
            ("--seed", self.seed, 0),
        ):
            if value < least:
                raise TooFew(what, value, least)
        if self.out.exists() and not self.out.is_dir():
            raise OccupiedOutput(self.out, "a file")
        held = sorted(self.out.glob("*.mcap*"))
        if held:
            raise OccupiedOutput(self.out, f"{len(held)} recordings, such as {held[0].name}")

    def _episode(self, lab: "Laboratory", index: int, bars: "Progress", task: "TaskID") -> int:
        """Record one episode; return how many draws were rejected on the way."""
        from dnet.recorders.episode import EpisodeWriter
        from dnet.sim.rollout import Rollout
        from dnet.types import EpisodeMeta

        rollout = Rollout(
            lab.world,
            lab.planner,
            lab.see,
            workspace=lab.workspace,
            box=lab.settings.box,
            seed=(self.seed, index),
        )
        name = f"episode-{self.seed}-{index:05d}"
        meta = EpisodeMeta(name, self.seed, index, rollout.scene, lab.describe())
        path = self.out / f"{name}.mcap"
        with EpisodeWriter(path, meta, arms=lab.arms, attachments=lab.attachments()) as writer:
            for frame in rollout.frames(self.shapes):
                writer.add(frame)
                bars.update(task, advance=float(frame.kind == "shape"))
            rejected = dict(sorted(rollout.rejected.items()))
            writer.finish({"frames": len(writer), "rejected": rejected})
        return sum(rejected.values())

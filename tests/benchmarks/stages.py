"""Where the time of a recording goes: a laboratory whose every part is timed."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

from dnet.geometry.camera import DepthImage
from dnet.laboratory import LaboratorySettings, laboratory
from dnet.recorders.episode import EpisodeWriter
from dnet.sim.observe import observe
from dnet.sim.rollout import Rollout
from dnet.types import Cloud, EpisodeMeta, Frame, Tissue

PHYSICS = ("reset", "restore", "follow", "settle")
SENSING = ("look",)
CHECKING = ("foresee", "deviation")


class Stages:
    """Processor seconds by stage."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        begin = process_time()
        yield
        self.seconds[stage] += process_time() - begin

    def wrap(self, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return `function`, its time added to a stage."""

        def measured(*arguments: Any, **named: Any) -> Any:
            with self.timed(stage):
                return function(*arguments, **named)

        return measured


class TimedParts:
    """A world or a planner whose named methods are timed; everything else is its own."""

    def __init__(self, inner: object, stages: Stages, **methods: str) -> None:
        self._inner, self._stages, self._methods = inner, stages, methods

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._inner, name)
        stage = self._methods.get(name)
        return found if stage is None else self._stages.wrap(stage, found)


def record(settings: LaboratorySettings, folder: Path, *, pairs: int, shapes: int) -> Stages:
    """Record episodes as `dnet record` does and return the time of each stage.

    The first pair is a rehearsal that is not counted: it compiles and loads.
    """
    stages = Stages()
    with laboratory(settings) as lab:
        names = dict.fromkeys(PHYSICS, "physics") | dict.fromkeys(CHECKING, "second opinion")
        world = TimedParts(lab.world, stages, **names, look="sensing")
        planner = TimedParts(lab.planner, stages, plan="planning")

        def see(image: DepthImage, number: int) -> Cloud:
            with stages.timed("sensing"):
                return lab.see(image, number)

        for index in range(pairs + 1):
            if index == 1:
                stages.seconds.clear()
            begin = process_time()
            rollout = Rollout(
                world,
                planner,
                partial(observe, world, see),
                workspace=settings.workspace,
                draw_tissue=lambda random: Tissue(),
                seed=(0, index),
            )
            name = f"{settings.world}-{index}"
            meta = EpisodeMeta(name, 0, index, rollout.scene, settings.describe())
            with EpisodeWriter(
                folder / f"{name}.mcap",
                meta,
                arms=lab.arms,
                attachments=lab.attachments(rollout.scene.tissue),
                camera=settings.bullet.camera,
            ) as writer:
                for frame in rollout.frames(shapes):
                    _write(writer, frame, stages)
                with stages.timed("logging"):
                    writer.finish({"frames": len(writer), "rejected": dict(rollout.rejected)})
            stages.seconds["together"] += process_time() - begin
    return stages


def _write(writer: EpisodeWriter, frame: Frame, stages: Stages) -> None:
    with stages.timed("logging"):
        writer.add(frame)

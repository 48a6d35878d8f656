"""The training loop: epoch after epoch, judged on what was held out, kept on disk as it goes."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from dnet.errors import TooFew
from dnet.training.frames import Frames
from dnet.training.progress import EpochDone, StepDone
from dnet.training.run import RunWriter
from dnet.training.showcase import Showcase
from dnet.training.tasks import task_of
from dnet.training.training import Training

SAVE_SECONDS = 300.0
"""After which a training is put down, so that a kill loses no more."""


@dataclass(frozen=True, slots=True)
class HeldOut:
    """What a network is judged by after every epoch."""

    unseen_shapes: Frames
    unseen_episodes: Frames


def _ignore(event: StepDone | EpochDone) -> None:
    del event


def _look_away(showcases: Mapping[str, Showcase]) -> None:
    del showcases


def fit(
    training: Training,
    held_out: HeldOut,
    *,
    run: RunWriter,
    on_event: Callable[[StepDone | EpochDone], None] = _ignore,
    on_judged: Callable[[Mapping[str, Showcase]], None] = _look_away,
) -> None:
    """Train until the last epoch, until time is up, or until someone asks for an end.

    The run then holds the best and the last network, and where the training can be taken up
    again, as it also does every few minutes.

    Args:
        training: New, or as it was put down.
        held_out: What the best network is chosen by.
        run: Where it is kept; written to by the first process alone.
        on_event: Told of every batch and every epoch.
        on_judged: Told after every epoch of pairs of each held-out set that are worth looking at.
    """
    first = training.process.first
    saved = time.monotonic()
    while training.progress < 1:
        for step in training.epoch():
            on_event(step)
            if first and time.monotonic() - saved > SAVE_SECONDS:
                run.save(training)
                saved = time.monotonic()
        if training.stopped and training.stream.batch and training.progress < 1:
            break  # within an epoch, which is judged when it has been gone on with
        if first:
            done, showcases = _judged(training, held_out, run)
            run.add(done, training.average)
            on_event(done)
            on_judged(showcases)
        else:
            training.close_epoch()
        # The others wait for the judgement with their next batch.
        training.process.wait()
        if training.stopped:
            break
    if first:
        run.save(training)


def _judged(
    training: Training, held_out: HeldOut, run: RunWriter
) -> tuple[EpochDone, dict[str, Showcase]]:
    loss, losses = training.close_epoch()
    network = training.average
    task = task_of(network)
    showcases = {
        "unseen shapes": Showcase(held_out.unseen_shapes, task.target),
        "unseen episodes": Showcase(held_out.unseen_episodes, task.target),
    }
    shapes, episodes = (
        task.judge(network, showcase.frames, watch=showcase.watch)
        for showcase in showcases.values()
    )
    if episodes is None:
        raise TooFew("number of pairs of unseen episodes", 0, 1)
    chosen_by = {"unseen_episodes": episodes, "unseen_shapes": shapes}[run.chosen_by]
    if chosen_by is None:
        raise TooFew("number of pairs of unseen shapes", 0, 1)
    done = EpochDone(
        epoch=len(run.history) + 1,
        steps=training.steps,
        encodings=training.encodings,
        loss=loss,
        losses=losses,
        unseen_shapes=shapes,
        unseen_episodes=episodes,
        best=chosen_by.main.mse_mm2 < run.least,
        learning_rate=training.rate,
        seconds=training.seconds,
        waited=training.waited,
        progress=training.progress,
    )
    return done, showcases

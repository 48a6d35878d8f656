"""The experiment `generalisation`: goals of other objects, cameras and clouds than were learned."""

from collections.abc import Sequence
from pathlib import Path

from dnet.commands.index_bar import read_index
from dnet.commands.paper.episodes import DATA, record
from dnet.commands.paper.goals import directories, trials_of, weights_of
from dnet.commands.paper.request import PaperRequest
from dnet.commands.servo import ServoOptions
from dnet.commands.servo_batch import finish
from dnet.datasets.frame_table import settled_frames
from dnet.evaluation.report.asked import write_asked
from dnet.evaluation.report.conditions import CONDITIONS, Condition
from dnet.evaluation.servo_goals import draw_goals
from dnet.laboratory import LaboratorySettings
from dnet.perception.noise import DepthNoise
from dnet.recording.request import RecordingRequest
from dnet.training.run import read_config
from dnet.trials.methods import points_of
from dnet.trials.request import Trial

GOALS, SHAPES, SEED = 20, 2, 2
"""Goals of each condition, from episodes of so many shapes each, recorded from a seed that no
network has learned from."""


def run_generalisation(request: PaperRequest, conditions: Sequence[Condition] = CONDITIONS) -> None:
    """Record what is missing, and carry out the runs that are not there yet.

    Args:
        request: What is asked.
        conditions: Under which.

    Raises:
        DnetError: If a directory holds other episodes or runs.
        KeyboardInterrupt: After Ctrl-C.
    """
    folder = request.out / "generalisation"
    count = request.count(GOALS)
    trials: dict[str, list[Trial]] = {}
    prints: dict[str, str] = {}
    missing: dict[str, str] = {}
    for condition in conditions:
        try:
            checkpoint = _network(condition, request)
        except LookupError:
            missing[condition.name] = f"give --runs with a `dnet train --points {condition.points}`"
            continue
        episodes = request.out / DATA / condition.folder
        record(_recording(condition, count), episodes, request)
        prints[condition.name] = settled_frames(read_index(episodes, request.console)).fingerprint
        goals = draw_goals(episodes, [], count=count, seed=request.seed)
        place = folder / condition.folder
        options = _options(condition, checkpoint, request)
        trials[condition.name] = trials_of(
            "deformernet", goals=goals, folder=place, options=options
        )
    asked = request.asked(
        GOALS,
        weights={"deformernet": weights_of(request)["deformernet"]},
        data=prints,
        options={"missing": missing},
        runs=directories(trials, folder),
    )
    write_asked(folder, asked)
    all_of_them = [one for some in trials.values() for one in some]
    finish(all_of_them, jobs=request.jobs, what="generalisation")


def _recording(condition: Condition, goals: int) -> RecordingRequest:
    return RecordingRequest(
        pairs=-(-goals // SHAPES),
        shapes=SHAPES,
        seed=SEED,
        tissue=condition.tissue,
        laboratory=LaboratorySettings(
            world=condition.world,
            points=condition.points,
            noise=DepthNoise(scale=condition.noise) if condition.noise else None,
        ),
    )


def _options(condition: Condition, checkpoint: Path | None, request: PaperRequest) -> ServoOptions:
    return ServoOptions(
        world=condition.world,
        checkpoint=checkpoint,
        depth_noise=condition.noise,
        seed=request.seed,
    )


def _network(condition: Condition, request: PaperRequest) -> Path | None:
    """Return the network to drive with: for clouds of other sizes, one of the given trainings.

    Raises:
        LookupError: If there is none.
    """
    if points_of("deformernet", request.checkpoint) == condition.points:
        return request.checkpoint
    for run in request.trainings.values():
        network = read_config(run)["network"]
        if (network["model"], network["points"]) == ("deformernet", condition.points):
            return run
    raise LookupError(condition.points)

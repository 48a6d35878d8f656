"""The experiment `goals`: a hundred unseen goals, several controllers, several ways to grasp."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from dnet.commands.paper.episodes import unseen_episodes
from dnet.commands.paper.request import PaperRequest, grasp_weights, hu_weights
from dnet.commands.servo import Controller, Grasp, ServoOptions
from dnet.commands.servo_batch import finish
from dnet.evaluation.report.asked import write_asked
from dnet.evaluation.servo_goals import draw_goals
from dnet.training.checkpoints import weights_file
from dnet.trials.request import Trial
from dnet.weights import DEFORMERNET

GOALS = 100
METHODS: tuple[tuple[Controller, Grasp], ...] = (
    ("none", "truth"),
    ("deformernet", "truth"),
    ("deformernet", "keypoints"),
    ("deformernet", "regressor"),
    ("deformernet", "dense"),
    ("oracle", "truth"),
    ("rrt", "truth"),
    ("hu", "truth"),
    ("hu-online", "truth"),
)


def run_goals(request: PaperRequest) -> None:
    """Carry out the runs that are not there yet.

    Raises:
        DnetError: If the episodes will not do, or a directory holds other runs.
        KeyboardInterrupt: After Ctrl-C.
    """
    folder = request.out / "goals"
    episodes = unseen_episodes(request, request.count(GOALS))
    goals = draw_goals(
        episodes.folder,
        episodes.unseen.episodes_seen,
        count=request.count(GOALS),
        seed=request.seed,
    )
    options = ServoOptions(
        world="quasistatic",
        checkpoint=request.checkpoint,
        hu_checkpoint=request.hu,
        seed=request.seed,
    )
    trials: dict[str, list[Trial]] = {}
    for controller, grasp in METHODS:
        own = replace(options, grasp=grasp, grasp_checkpoint=request.grasps.get(grasp))
        name = method_name(controller, grasp)
        place = folder / name.replace(" + ", "-")
        trials[name] = trials_of(controller, goals=goals, folder=place, options=own)
    asked = request.asked(
        GOALS,
        weights=weights_of(request),
        data={episodes.folder.name: episodes.unseen.fingerprint},
        options={"world": options.world, "steps": options.steps},
        runs=directories(trials, folder),
    )
    write_asked(folder, asked)
    finish([one for some in trials.values() for one in some], jobs=request.jobs, what="goals")


def method_name(controller: str, grasp: str) -> str:
    """Return what a method is called: how it grasps is said where it is not told."""
    return controller if grasp == "truth" else f"{controller} + {grasp}"


def trials_of(
    controller: Controller, *, goals: list[str], folder: Path, options: ServoOptions
) -> list[Trial]:
    """Return a run to each goal, each in a directory of its own in `folder`."""
    plain = options.trial("", folder, controller=controller)
    trials = [replace(plain, goal=goal, recording=False) for goal in goals]
    return [replace(one, out=folder / one.goal_name) for one in trials]


def directories(trials: Mapping[str, list[Trial]], folder: Path) -> dict[str, tuple[str, ...]]:
    """Return the directories of the runs of each method, from that of the experiment."""
    return {
        name: tuple(one.out.relative_to(folder).as_posix() for one in some)
        for name, some in trials.items()
    }


def weights_of(request: PaperRequest) -> dict[str, Path]:
    """Return the files of all networks that servo runs use."""
    own = request.checkpoint
    return {
        "deformernet": DEFORMERNET if own is None else weights_file(own),
        "hu": hu_weights(request),
        **grasp_weights(request),
    }

"""The experiment `importance`: one goal from a good and from a bad manipulation point."""

from dataclasses import replace

from dnet.commands.paper.cases import SEEDS
from dnet.commands.paper.goals import directories, weights_of
from dnet.commands.paper.request import PaperRequest
from dnet.commands.servo import Grasp, ServoOptions
from dnet.commands.servo_batch import finish
from dnet.evaluation.report.asked import write_asked
from dnet.trials.request import Trial

POINTS: dict[str, Grasp] = {"good": "truth", "bad": "farthest"}


def run_importance(request: PaperRequest) -> None:
    """Carry both runs out, unless they are there.

    Raises:
        DnetError: If a directory holds other runs.
        KeyboardInterrupt: After Ctrl-C.
    """
    folder = request.out / "importance"
    goal = f"random:{SEEDS[0]}"
    options = ServoOptions(world=request.world, checkpoint=request.checkpoint, seed=request.seed)
    trials: dict[str, list[Trial]] = {}
    for name, grasp in POINTS.items():
        plain = replace(options, grasp=grasp).trial(goal, folder, controller="deformernet")
        trials[name] = [replace(plain, out=folder / name)]
    asked = request.asked(
        1,
        weights={"deformernet": weights_of(request)["deformernet"]},
        data={},
        options={"world": request.world, "goal": goal},
        runs=directories(trials, folder),
    )
    write_asked(folder, asked)
    finish([one for some in trials.values() for one in some], jobs=request.jobs, what="points")

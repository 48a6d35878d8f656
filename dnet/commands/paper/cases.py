"""The experiment `cases`: the four servo cases of the paper, by each way to choose the point."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from dnet.commands.paper.goals import directories, weights_of
from dnet.commands.paper.request import PaperRequest
from dnet.commands.servo import Controller, Grasp, ServoOptions
from dnet.commands.servo_batch import finish
from dnet.evaluation.report.asked import write_asked
from dnet.evaluation.report.cases_claims import HU_TRUE_POINT
from dnet.trials.request import Trial

SEEDS = (2_000_000, 2_000_001, 2_000_002, 2_000_003)
"""Of the goals, which nothing was chosen by: the first four of a range that nothing else uses."""
METHODS: Mapping[str, tuple[Controller, Grasp]] = {
    "keypoints": ("deformernet", "keypoints"),
    "regressor": ("deformernet", "regressor"),
    HU_TRUE_POINT: ("hu", "truth"),
}
"""The paper gives the controller of Hu et al. the true point."""


def run_cases(request: PaperRequest) -> None:
    """Carry out the runs that are not there yet.

    Raises:
        DnetError: If a directory holds other runs.
        KeyboardInterrupt: After Ctrl-C.
    """
    folder = request.out / "cases"
    seeds = SEEDS[: request.count(len(SEEDS))]
    options = ServoOptions(
        world=request.world,
        checkpoint=request.checkpoint,
        hu_checkpoint=request.hu,
        seed=request.seed,
    )
    trials = {
        name: _trials(
            controller,
            seeds,
            folder / controller / grasp,
            replace(options, grasp=grasp, grasp_checkpoint=request.grasps.get(grasp)),
        )
        for name, (controller, grasp) in METHODS.items()
    }
    asked = request.asked(
        len(SEEDS),
        weights=weights_of(request),
        data={},
        options={"world": request.world, "goals": [f"random:{seed}" for seed in seeds]},
        runs=directories(trials, folder),
    )
    write_asked(folder, asked)
    finish([one for some in trials.values() for one in some], jobs=request.jobs, what="cases")


def _trials(
    controller: Controller, seeds: tuple[int, ...], folder: Path, options: ServoOptions
) -> list[Trial]:
    plain = options.trial("", folder, controller=controller)
    return [
        replace(plain, goal=f"random:{seed}", out=folder / f"case-{number}")
        for number, seed in enumerate(seeds, start=1)
    ]

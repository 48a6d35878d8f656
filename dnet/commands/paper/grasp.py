"""The experiment `grasp`: where to grasp, over a hundred cases."""

from dataclasses import replace

from dnet.commands.evaluate_grasp import Grasp
from dnet.commands.paper.episodes import unseen_episodes
from dnet.commands.paper.request import PaperRequest, grasp_weights
from dnet.evaluation.report.asked import read_asked, write_asked
from dnet.evaluation.report.grasp_section import ANSWERS, RECORDING
from dnet.evaluation.report.published import GRASP_CASES


def run_grasp(request: PaperRequest) -> None:
    """Let every method choose, unless all of them have.

    Raises:
        DnetError: If the episodes will not do.
    """
    folder = request.out / "grasp"
    episodes = unseen_episodes(request, request.count(GRASP_CASES))
    asked = request.asked(
        GRASP_CASES,
        weights=grasp_weights(request),
        data={episodes.folder.name: episodes.unseen.fingerprint},
    )
    # A report at another scale may have as many cases.
    before = read_asked(folder)
    whole = (folder / ANSWERS).is_file() and (folder / RECORDING).is_file()
    if whole and before is not None and replace(before, scale=asked.scale) == asked:
        return
    for name in (ANSWERS, RECORDING):
        (folder / name).unlink(missing_ok=True)
    Grasp(
        episodes.folder,
        folder,
        cases=asked.count,
        **request.grasps,
        validation=1.0 if request.from_mcap is None else request.validation,
        seed=request.seed,
    ).run()
    write_asked(folder, asked)

"""Pictures of chosen manipulation points, as the paper shows them: truth green, choice blue."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from dnet.evaluation.grasp import Answers, Case
from dnet.files.whole_file import write_whole
from dnet.types import Cloud, Point

_OBJECT, _GOAL, _TRUTH, _CHOICE = "#b5715a", "#5590b0", "#1d8a3a", "#1f4fd1"


def draw_cases(cases: Sequence[Case], answers: Mapping[str, Answers], path: Path) -> None:
    """Draw the best, the median and the worst case of each method into a picture, whole or not.

    A row a method, two views a case: the initial cloud with both points, and the goal.

    Args:
        cases: That were chosen for.
        answers: Of each method, by its name.
        path: A .png.
    """
    figure = Figure(figsize=(13, 2.6 * len(answers)), layout="constrained")
    for row, (name, found) in enumerate(answers.items()):
        order = np.argsort(found.distances, kind="stable")
        picked = {"best": order[0], "median": order[len(order) // 2], "worst": order[-1]}
        for place, (which, number) in enumerate(picked.items()):
            case, index = cases[int(number)], int(number)
            first = 6 * row + 2 * place + 1
            title = f"{name}\n{which}: {1e3 * found.distances[index]:.1f} mm"
            axes = [figure.add_subplot(len(answers), 6, first + k, projection="3d") for k in (0, 1)]
            _draw(axes[0], case.initial, _OBJECT, title)
            _mark(axes[0], case.truth, _TRUTH)
            _mark(axes[0], found.points[index], _CHOICE)
            _draw(axes[1], case.goal, _GOAL, case.name.removeprefix("episode-"))
    content = BytesIO()
    with rc_context({"text.parse_math": False}):
        figure.savefig(content, format="png", dpi=80)
    write_whole(path, content.getvalue())


def _draw(axes: Axes3D, cloud: Cloud, colour: str, title: str) -> None:
    axes.scatter(*cloud.T, s=2, c=colour, depthshade=True, linewidths=0)
    axes.set_title(title, fontsize=8, y=0.95)
    axes.set(xlim=(-0.08, 0.12), ylim=(-0.1, 0.1), zlim=(0, 0.12))
    # The stubs of matplotlib 3.10 have whole numbers only.
    axes.set_box_aspect((1, 1, 0.6), zoom=1.35)  # pyright: ignore[reportArgumentType]
    axes.view_init(elev=40, azim=-70)
    axes.set_axis_off()


def _mark(axes: Axes3D, point: Point, colour: str) -> None:
    axes.scatter(*point[:, None], s=40, c=colour, depthshade=False)

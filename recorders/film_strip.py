"""What stands below the scene of a film: the step, the distance to the goal, and its curve."""

import io

import numpy as np
from jaxtyping import Float64
from matplotlib.figure import Figure
from PIL import Image

from dnet.recorders.blueprint import BACKGROUND, FILM_GOAL
from dnet.recorders.goal_distance import WORST, colors_of
from dnet.recorders.rerun_scene import CURRENT_COLOR, FLOOR_COLOR

DPI = 100
PALE, LINE = (0.85, 0.86, 0.88), (0.45, 0.47, 0.52)


class Strip:
    """Draws the strip of each step of a run.

    Args:
        chamfers: Distance to the goal at each step, in millimetres.
        floor: The least that it can be expected to come to, likewise, if it is known.
        size: Width and height in pixels.
    """

    def __init__(
        self, chamfers: Float64[np.ndarray, "_"], floor: float | None, *, size: tuple[int, int]
    ) -> None:
        self._chamfers, self._floor = chamfers, floor
        self._size = size

    def draw(self, step: int, *, motion: float) -> Image.Image:
        """Return the strip at a step, from 0, and the motion asked for there, in millimetres."""
        width, height = self._size
        figure = Figure((width / DPI, height / DPI), dpi=DPI, facecolor=_share(BACKGROUND))
        self._write(figure, step, motion)
        self._plot(figure, step)
        self._scale(figure)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png")
        return Image.open(drawn).convert("RGB")

    def _write(self, figure: Figure, step: int, motion: float) -> None:
        for x, title, value in (
            (0.02, "step", f"{step}"),
            (0.10, "motion asked for", f"{motion:.1f} mm"),
            (0.29, "Chamfer distance", f"{self._chamfers[step]:.2f} mm"),
        ):
            figure.text(x, 0.70, title, fontsize=7.5, color=PALE)
            figure.text(x, 0.36, value, fontsize=13, color="white", weight="bold")
        figure.text(0.02, 0.10, "pale: the goal", fontsize=7.5, color=_share(FILM_GOAL))

    def _plot(self, figure: Figure, step: int) -> None:
        axes = figure.add_axes((0.54, 0.24, 0.44, 0.66), facecolor=_share(BACKGROUND))
        steps = np.arange(len(self._chamfers))
        axes.plot(steps, self._chamfers, color=LINE, linewidth=1)
        axes.plot(steps[: step + 1], self._chamfers[: step + 1], color=_share(CURRENT_COLOR))
        axes.plot([step], [self._chamfers[step]], "o", color="white", markersize=4)
        if self._floor is not None:
            axes.axhline(self._floor, color=_share(FLOOR_COLOR), linewidth=0.7, linestyle="--")
        axes.set_xlim(-0.5, max(len(steps) - 0.5, 0.5))
        axes.set_ylim(0, 1.08 * float(self._chamfers.max()))
        axes.tick_params(colors=PALE, labelsize=7, length=2)
        for name, spine in axes.spines.items():
            spine.set_visible(name in ("left", "bottom"))
            spine.set_color(LINE)

    def _scale(self, figure: Figure) -> None:
        """Draw which colour is which distance."""
        axes = figure.add_axes((0.20, 0.09, 0.20, 0.10))
        axes.imshow(colors_of(np.linspace(0.0, WORST, 128))[None], aspect="auto")
        axes.set_axis_off()
        figure.text(0.412, 0.10, f"0 to {1e3 * WORST:.0f} mm off", fontsize=7.5, color=PALE)


def _share(color: tuple[int, int, int]) -> tuple[float, float, float]:
    red, green, blue = color
    return red / 255, green / 255, blue / 255

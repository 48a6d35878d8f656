"""The picture of the material's validation: four panels, one a question."""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter

from dnet.files.whole_file import write_whole
from dnet.tools.material import Validation
from dnet.tools.material_agreement import Agreement
from dnet.tools.material_bending import KNOWN_RATIOS, Bending
from dnet.tools.material_checks import POISSON_LIMIT, YOUNG_LIMIT
from dnet.tools.material_meshes import LEAST_THICKNESS, MOST_NODES, Resolution, choose
from dnet.tools.material_tension import STRAIN, Tension, uniaxial
from dnet.types import Tissue

# Okabe and Ito's colours, which colour-blind people tell apart.
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#666666"


def draw_material(validation: Validation, path: Path) -> None:
    """Draw tension, bending, agreement with the independent solver, and the meshes.

    Args:
        validation: What was measured.
        path: A .png; its directory is made if need be.
    """
    # No pyplot: a figure of its own draws without a screen and leaves nothing behind.
    figure = Figure(figsize=(12, 8.5), layout="constrained")
    panels = figure.subplots(2, 2)
    _draw_tension(panels[0, 0], validation.tissue, validation.tension)
    _draw_bending(panels[0, 1], validation.bendings)
    _draw_agreement(panels[1, 0], validation.agreement)
    _draw_meshes(panels[1, 1], validation.tissue, validation.resolutions)
    for panel in panels.ravel():
        panel.grid(alpha=0.25)
        panel.spines[["top", "right"]].set_visible(False)
    content = BytesIO()
    figure.savefig(content, format="png", dpi=110)
    write_whole(path, content.getvalue())


def _draw_tension(panel: Axes, tissue: Tissue, tension: Tension) -> None:
    young, poisson = tissue.young, tissue.poisson
    strain = np.linspace(1e-3, 1.08 * tension.strain.max(), 50)
    stress, contraction = uniaxial(strain, young=young, poisson=poisson)
    percent = 100 * strain
    for name, limit, color in (("ν", POISSON_LIMIT, ORANGE), ("E", YOUNG_LIMIT, BLUE)):
        label = f"{name} within {limit:.0%}"
        panel.axhspan(1 - limit, 1 + limit, color=color, alpha=0.12, linewidth=0, label=label)
    panel.plot(percent, stress / strain / young, color=BLUE, label="E of the energy itself")
    panel.plot(
        percent, contraction / strain / poisson, color=ORANGE, label="ν of the energy itself"
    )
    measured = 100 * tension.strain
    panel.plot(
        measured, tension.stress / tension.strain / young, "o", color=BLUE, label="E in PyBullet"
    )
    panel.plot(
        measured,
        tension.contraction / tension.strain / poisson,
        "^",
        color=ORANGE,
        label="ν in PyBullet",
    )
    panel.axvline(100 * STRAIN, color=GREY, linewidth=0.8, linestyle=":")
    panel.set(
        title="Tension: a bar under its own weight",
        xlabel="strain (%)",
        ylabel="measured over asked for",
        xlim=(0, None),
        ylim=(0.91, 1.08),
    )
    panel.text(
        100 * STRAIN,
        1.055,
        f"E = {tension.young:.0f} Pa for {young:.0f} Pa\n"
        f"ν = {tension.poisson:.3f} for {poisson:.3f}",
        horizontalalignment="center",
        backgroundcolor="white",
    )
    panel.legend(loc="lower left", ncols=3, fontsize="small", framealpha=1)


def _draw_bending(panel: Axes, bendings: list[Bending]) -> None:
    cells = [bending.cells for bending in bendings]
    ratios = [bending.ratio for bending in bendings]
    places = np.arange(len(cells))
    bars = panel.bar(places, ratios, color=BLUE, width=0.6, label="PyBullet")
    panel.bar_label(bars, [f"{ratio:.2f}" for ratio in ratios], padding=6)
    known = [KNOWN_RATIOS[count] for count in cells]
    panel.plot(places, known, "D", color=ORANGE, markersize=7, label="known of such meshes")
    panel.axhline(1, color=GREY, linestyle="--")
    panel.text(places[0] - 0.3, 1.015, "Timoshenko's beam", color=GREY)
    panel.set(
        title="Bending: a cantilever under its own weight",
        xlabel="cells through the thickness",
        ylabel="deflection over Timoshenko's",
        ylim=(0, 1.15),
    )
    panel.set_xticks(places, [str(count) for count in cells])
    panel.legend(loc="lower right", framealpha=1)


def _draw_agreement(panel: Axes, agreement: Agreement) -> None:
    errors = agreement.from_rest
    panel.semilogy(
        agreement.motion_mm, errors.max(axis=1), "^", color=ORANGE, label="worst node of a shape"
    )
    panel.semilogy(
        agreement.motion_mm, errors.mean(axis=1), "o", color=BLUE, label="mean over its nodes"
    )
    panel.axhline(errors.mean(), color=BLUE, linewidth=0.8, linestyle="--")
    panel.set(
        title=f"{len(errors)} random shapes: PyBullet against an independent solver",
        xlabel="displacement of the gripper (mm)",
        ylabel="distance between nodes (mm)",
    )
    panel.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    low, high = panel.get_ylim()
    panel.set_ylim(low, 5 * high)
    panel.legend(loc="upper left", framealpha=1)


def _draw_meshes(panel: Axes, tissue: Tissue, resolutions: list[Resolution]) -> None:
    resolutions = sorted(resolutions, key=lambda resolution: -resolution.nodes)
    rows = np.arange(len(resolutions))
    faces = [resolution.face_mm for resolution in resolutions]
    jaws = [resolution.pull_mm for resolution in resolutions]
    panel.plot(faces, rows, "s", color=ORANGE, label="end face pulled: the elements alone")
    panel.plot(jaws, rows, "o", color=BLUE, label="pulled by the jaws, as in a recording")
    chosen = choose(resolutions)
    panel.plot(
        chosen.pull_mm,
        resolutions.index(chosen),
        "o",
        color=GREEN,
        markersize=15,
        fillstyle="none",
        markeredgewidth=2,
        label=f"nearest: {LEAST_THICKNESS} cells of height, {MOST_NODES} nodes at most",
    )
    panel.set_xscale("log")
    panel.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    panel.set_yticks(rows, [_mesh_name(resolution, tissue) for resolution in resolutions])
    panel.set(
        title="Random pulls: meshes against the finest",
        xlabel="mean distance between nodes (mm)",
        ylabel="cells: nodes",
        ylim=(-0.6, len(rows) + 2.4),
    )
    panel.legend(loc="upper right", framealpha=1)


def _mesh_name(resolution: Resolution, tissue: Tissue) -> str:
    cells = "×".join(str(count) for count in resolution.cells)
    default = " (default)" if resolution.cells == tissue.cells else ""
    return f"{cells}: {resolution.nodes}{default}"

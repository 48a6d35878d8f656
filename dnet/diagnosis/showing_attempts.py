"""Whether runs can be shown: a recording is written, a viewer started, a picture drawn."""

import io
import subprocess
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

from dnet.diagnosis.vulkan import devices


def write() -> str:
    """Write a Rerun recording and read it again."""
    from dnet.recorders.salvage import whole_recording  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        path = _recording(Path(folder))
        whole_recording(path, Path(folder))
        return f"a recording of {path.stat().st_size / 1e3:.0f} kB written and read"


def _recording(folder: Path) -> Path:
    from dnet.recorders.training_recording import write_training  # noqa: PLC0415
    from dnet.recorders.training_values import LossPoint  # noqa: PLC0415

    path = folder / "doctor.rrd"
    losses = [LossPoint(step, 1.0 / step) for step in (1, 2, 3)]
    write_training(path, name="doctor", losses=losses, rates=[], epochs=[], motions=[], worst=[])
    return path


def start_viewer() -> str:
    """Start the viewer's program, which says its version and ends."""
    from dnet.recorders.viewer_process import RERUN  # noqa: PLC0415

    ran = subprocess.run([*RERUN, "--version"], capture_output=True, text=True, check=False)
    if ran.returncode:
        raise RuntimeError(f"the viewer ends with {ran.returncode}: {ran.stderr.strip()[-200:]}")
    return " ".join(ran.stdout.split()[:2])


def find_screen() -> str:
    """Find a screen to open a window on."""
    from dnet.errors import NoScreen  # noqa: PLC0415
    from dnet.recorders.viewer_process import check_screen  # noqa: PLC0415

    try:
        check_screen()
    except NoScreen:
        raise RuntimeError("no screen: neither DISPLAY nor WAYLAND_DISPLAY is set") from None
    return "there is a screen"


def find_renderer() -> str:
    """Find a Vulkan device, which the viewer draws with where there is no screen."""
    found = devices()
    if not found:
        raise RuntimeError("Vulkan has no driver")
    return f"Vulkan draws on {found[0]}"


def draw_screenshot() -> str:
    """Let the viewer draw a recording."""
    from dnet.recorders.viewer import draw as draw_recording  # noqa: PLC0415

    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "doctor.png"
        draw_recording(_recording(Path(folder)), picture, seconds=None)
        return f"a picture of {picture.stat().st_size / 1e3:.0f} kB drawn without a screen"


def draw() -> str:
    """Draw a curve as a PNG, and open that."""
    from matplotlib.figure import Figure  # noqa: PLC0415
    from PIL import Image  # noqa: PLC0415

    figure = Figure(figsize=(1.0, 1.0), dpi=50)
    figure.subplots().plot([0, 1], [0, 1])
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png")
    width, height = Image.open(drawn).size
    return f"a picture of {width} x {height} pixels drawn"


def write_report() -> str:
    """Fill a template in, with a plot in it."""
    from jinja2 import Environment, StrictUndefined  # noqa: PLC0415

    plotly: Any = import_module("plotly.graph_objects")
    curve = plotly.Figure(plotly.Scatter(x=[0, 1], y=[0, 1]))
    plot = curve.to_html(full_html=False, include_plotlyjs=False)
    # Our own plot goes into our own page.
    environment = Environment(undefined=StrictUndefined)  # noqa: S701
    page = environment.from_string("<p>{{ plot }}</p>").render(plot=plot)
    return f"a page of {len(page) / 1e3:.0f} kB written"

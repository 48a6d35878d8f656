"""The figures of a recording as text: tables and bars."""

from collections.abc import Mapping, Sequence

import polars as pl
from rich.console import Console

from dnet.tools.histogram import Histogram, bar, skyline
from dnet.tools.statistics import SCENE
from dnet.tools.statistics_oddities import Oddities
from dnet.tools.statistics_speed import TIMINGS, Speed
from dnet.tools.statistics_values import Distribution, Draws, Motions, Spread, Statistics, Tissues
from dnet.tools.tables import print_table


def print_statistics(figures: Statistics) -> None:
    """Print all of `figures`."""
    console = Console(highlight=False, soft_wrap=True)
    _print_summary(figures, console)
    _head(console, "objects")
    print_table(pl.DataFrame([_tissues_row(tissues) for tissues in figures.tissues]))
    if figures.displacement_mm:
        _print_displacement(figures.displacement_mm, console)
    _print_motions(figures, console)
    _head(console, "manipulation points in the object's own frame, mm")
    rows = [_spread_row(*item) for item in figures.manipulation_point_mm.items()]
    print_table(pl.DataFrame(rows))
    _print_oddities(figures.oddities, console)
    if figures.draws is not None:
        _print_draws(figures.draws, console)
    if figures.speed is not None:
        _print_speed(figures.speed, figures.files.finished, console)


def _print_summary(figures: Statistics, console: Console) -> None:
    files = figures.files
    counts = f"{files.finished} finished, {files.unfinished} unfinished, {files.broken} broken"
    if files.unfinished or files.broken:
        counts += f" (`dnet inspect ls {figures.directory}` says more)"
    frames = sum(figures.frames.values())
    kinds = ", ".join(f"{count} {kind}" for kind, count in figures.frames.items())
    shapes = figures.frames["shape"]
    size = files.episode_bytes
    megabytes = _range(size.least / 1e6, size.greatest / 1e6, ".2f")
    simulated = f"{figures.simulated_seconds:.0f} s"
    lines = {
        "episodes": counts,
        "frames": f"{frames}: {kinds}",
        "clouds": "none",
        "size": f"{files.total_bytes / 1e6:.1f} MB, an episode {megabytes} MB",
    }
    if " to " in megabytes:
        lines["size"] += f" (mean {size.mean / 1e6:.2f} MB)"
    if figures.cloud_points is not None:
        lines["clouds"] = f"{_range(*figures.cloud_points, 'd')} points"
    if files.frame_bytes is not None:
        lines["size"] += f", a frame {files.frame_bytes / 1e3:.1f} kB"
    if shapes:
        simulated += f", a shape {figures.simulated_seconds / shapes:.2f} s"
    lines["simulated"] = simulated
    if figures.deviation is not None:
        lines["deviation"] = (
            f"mean {figures.deviation.mean_mm:.3f} mm, worst {figures.deviation.worst_mm:.2f} mm "
            "(a shape's worst node from where the same grasp takes it straight from rest)"
        )
    for name, text in lines.items():
        console.print(f"{name:<10} {text}", markup=False)


def _print_displacement(displacement: Mapping[str, Distribution], console: Console) -> None:
    _head(console, "displacement of the manipulation point from rest, mm")
    rows = []
    for name, values in displacement.items():
        counts = skyline(values.histogram.counts)
        rows.append(_spread_row(name, values.spread) | {"least to greatest": counts})
    print_table(pl.DataFrame(rows))
    length = displacement["length"].histogram
    _head(console, f"its length in bins of {length.width:g} mm")
    print_table(_bars(length))


def _bars(values: Histogram) -> pl.DataFrame:
    starts = [values.start + place * values.width for place in range(len(values.counts))]
    largest, total = max(values.counts), sum(values.counts)
    return pl.DataFrame(
        {
            "from": [f"{start:g}" for start in starts],
            "shapes": values.counts,
            "%": [100 * count / total for count in values.counts],
            "": [bar(count, largest) for count in values.counts],
        }
    )


def _print_motions(figures: Statistics, console: Console) -> None:
    kinds = {"any two": figures.any_pair, "rest to shape": figures.from_rest}
    rows = [_motions_row(name, motions) for name, motions in kinds.items() if motions is not None]
    if rows:
        _head(console, "motions between settled frames of an episode: mean length, squared error")
        print_table(pl.DataFrame(rows))


def _motions_row(name: str, motions: Motions) -> dict[str, object]:
    return {
        "frames": name,
        "pairs": motions.pairs,
        "mean mm": motions.mean_mm,
        "no motion mm²": motions.zero_mse_mm2,
        "mean motion mm²": motions.mean_mse_mm2,
    }


def _print_oddities(odd: Oddities, console: Console) -> None:
    lines = [f"{name} is the same in all shapes" for name in odd.without_variance]
    for far in odd.outliers:
        metres = far.value != "points"
        low, high = (1e3 * edge if metres else edge for edge in far.fence)
        beyond = f"{low:.1f} to {high:.1f}" + (" mm" if metres else "")
        lines.append(f"{far.count} shapes with {far.value} beyond {beyond}: {_some(far.examples)}")
    if odd.duplicate_episodes:
        lines.append(f"files that hold an episode twice: {_some(odd.duplicate_episodes)}")
    if odd.duplicate_clouds:
        lines.append(f"{odd.duplicate_clouds} settled frames have a cloud that another has too")
    if odd.leaked_clouds:
        lines.append(
            f"{odd.leaked_clouds} clouds are among those to learn from and those to judge by, "
            f"with {odd.validation:.0%} of the episodes to judge by"
        )
    _head(console, "oddities")
    for line in lines or ["none: all varies, nothing lies far out, comes twice or leaks"]:
        console.print(line, markup=False)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")


def _print_draws(draws: Draws, console: Console) -> None:
    share = draws.rejected_shapes / max(1, draws.shapes)
    _head(
        console,
        f"rejected: {draws.rejected_shapes} of {draws.shapes} draws of a shape ({share:.1%})",
    )
    rows = [
        {
            "reason": row.reason,
            "draws": row.count,
            "%": 100 * row.share,
            "of": f"{draws.scenes} scenes" if row.reason == SCENE else f"{draws.shapes} shapes",
        }
        for row in draws.rejected
    ]
    if rows:
        print_table(pl.DataFrame(rows))


def _print_speed(speed: Speed, finished: int, console: Console) -> None:
    _head(console, f"recording speed, of {speed.episodes} timed and {finished} finished episodes")
    paces = {
        "processor time": speed.cpu,
        "one worker": speed.worker,
        f"all of {len(speed.workers)} workers": speed.machine,
    }
    rows = [
        {"by": name, "hours": pace.hours, "shapes/s": pace.shapes_per_second}
        for name, pace in paces.items()
    ]
    print_table(pl.DataFrame(rows))
    for worker in speed.workers:
        if worker.episodes > 1 and worker.first_bytes and worker.last_bytes:
            console.print(
                f"memory of worker {worker.worker}: {worker.first_bytes / 1e6:.1f} MB after its "
                f"first episode, {worker.last_bytes / 1e6:.1f} MB after {worker.shapes} shapes "
                f"({worker.last_bytes / worker.first_bytes - 1:+.1%})"
            )
    if speed.unreadable_lines:
        console.print(f"{speed.unreadable_lines} cut-off lines of {TIMINGS} do not count")


def _tissues_row(tissues: Tissues) -> dict[str, object]:
    edges = (_range(round(edge.least), round(edge.greatest), "d") for edge in tissues.size_mm)
    return {
        "object": tissues.shape,
        "size mm": " x ".join(edges),
        "Young's modulus kPa": _range(tissues.young_kpa.least, tissues.young_kpa.greatest, ".3g"),
        "episodes": tissues.episodes,
        "shapes": tissues.shapes,
    }


def _spread_row(name: str, values: Spread) -> dict[str, object]:
    return {
        "axis": name,
        "mean": values.mean,
        "std": values.std,
        "least": values.least,
        "greatest": values.greatest,
    }


def _range(least: float | int, greatest: float | int, form: str) -> str:
    low, high = f"{least:{form}}", f"{greatest:{form}}"
    return low if low == high else f"{low} to {high}"


def _head(console: Console, text: str) -> None:
    console.print()
    console.print(text, style="bold", markup=False)

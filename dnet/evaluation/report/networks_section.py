"""DeformerNet against the network of Hu et al.: losses on many shapes and on a few."""

from collections.abc import Sequence
from pathlib import Path

from dnet.errors import BadReport
from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.published import TEST_MSE_MM2, TRAIN_MSE_MM2
from dnet.evaluation.report.trainings import Errors, Training, read_trainings
from dnet.evaluation.report.values import Bar, BarPlot, Cell, Claim, Column, Section, Sheet
from dnet.files.sizes import read_json

ARCHITECTURE = "architecture.json"
PARTS = ("training", "unseen shapes", "unseen episodes")
_COLUMNS = (
    Column("network"),
    Column("run"),
    Column("trained on"),
    Column("frames of"),
    Column("pairs"),
    Column("count", 0),
    Column("MSE, mean over xyz, mm²", 2),
    Column("MSE, sum over xyz, mm²", 2),
    Column("mean error, mm", 2),
    Column("MSE of no motion, mm²", 0),
    Column("paper, mm²", 1),
    Column("its reduction"),
)
_CALLED = {"deformernet": "DeformerNet", "hu": "Hu et al."}


def networks_section(folder: Path, asked: Asked | None, *, title: str, out: Path) -> Section:
    """Return how the trainings in a directory compare.

    Args:
        folder: Of the experiment.
        asked: What was asked of it; None if it was not run.
        title: Of the section.
        out: Directory of the report.

    Raises:
        BadReport: If a training cannot be read.
    """
    del out  # What lies here are copies of other people's files.
    found = [] if asked is None else read_trainings(folder)
    about = (
        "Squared errors of the predicted motion, over all ordered pairs of settled frames of an "
        "episode. The authors' training loss is a mean over x, y and z, their test loss a sum; "
        "both are told here of every network. Their test is on unseen shapes of pairs that were "
        "trained on: `unseen shapes`. `unseen episodes` are of other poses and grasps, which the "
        "paper does not test.",
        "Hu et al. is Hu-style, offline: features made by hand (extended FPFH of the same partial "
        "clouds), with ReLU or as a linear map; not their own code, which is not public.",
    )
    claims = (_architecture(folder, asked), *_losses(found, asked), _few(found, asked))
    if not found:
        return Section("networks", title, about, claims=claims)
    sheet = Sheet(
        "networks",
        "Errors of the networks",
        _COLUMNS,
        tuple(row for one in found for row in _rows(one)),
    )
    return Section("networks", title, about, claims=claims, sheets=(sheet,), plots=(_plot(found),))


def _rows(one: Training) -> list[tuple[Cell, ...]]:
    return [
        (
            _CALLED.get(one.model, one.model),
            one.name,
            one.detail,
            errors.part,
            errors.pairs,
            errors.count,
            errors.mse_mm2,
            errors.sum_mm2,
            errors.mean_mm,
            errors.zero_mse_mm2,
            *_published(one, errors),
        )
        for errors in one.errors
    ]


def _published(one: Training, errors: Errors) -> tuple[float | None, str | None]:
    if one.few or errors.pairs != "any two":
        return None, None
    if errors.part == "training":
        return TRAIN_MSE_MM2.get(one.model), "mean"
    if errors.part == "unseen shapes":
        return TEST_MSE_MM2.get(one.model), "sum"
    return None, None


def _plot(found: Sequence[Training]) -> BarPlot:
    bars = tuple(
        Bar(f"{one.name}: {part}", errors.mse_mm2, errors.mse_mm2, errors.mse_mm2, one.model)
        for one in found
        for part in PARTS
        if (errors := one.error(part)) is not None
    )
    return BarPlot(
        "networks-errors",
        "Squared error on any two frames",
        "MSE, mean over xyz, mm²",
        bars,
        logarithmic=True,
    )


def best_of(found: Sequence[Training], model: str, *, few: bool) -> Training | None:
    """Return the training of a model that is best on unseen shapes, of those judged on them.

    Of trainings on clouds of different sizes, those on the largest count: sparser ones are another
    condition.
    """
    known = [
        (-one.points, errors.mse_mm2, one.name, one)
        for one in found
        if one.model == model and one.few == few
        if (errors := one.error("unseen shapes")) is not None
    ]
    return min(known, default=(0, 0.0, "", None))[3]


def _architecture(folder: Path, asked: Asked | None) -> Claim:
    what = "the network: three PointConv levels, 256 features, FC 128-64-32-3"
    paper = "drawn"
    path = folder / ARCHITECTURE
    if asked is None:
        return Claim("figure 1", what, paper, "", None, "not run")
    try:
        counts = read_json(path, what="table of networks")
    except (OSError, ValueError) as error:
        raise BadReport(path, f"is unreadable ({error!r})", "run the experiment again") from error
    ours = f"{counts['paper']:,} weights with --size paper, {counts['shipped']:,} in what ships"
    same = "the same levels and layers; GroupNorm where the paper says batch normalisation"
    return Claim("figure 1", what, paper, ours, True, f"{same}, as in the authors' scripts")


def _losses(found: Sequence[Training], asked: Asked | None) -> list[Claim]:
    claims = []
    for model in ("deformernet", "hu"):
        one = best_of(found, model, few=False)
        for kind, part, reduction, paper in (
            ("train", "training", "mean", TRAIN_MSE_MM2[model]),
            ("test", "unseen shapes", "sum", TEST_MSE_MM2[model]),
        ):
            what = f"{_CALLED[model]}, {kind} MSE ({reduction} over xyz)"
            value = None if one is None else _value(one, part, reduction)
            if value is None:
                reason = _why_not(model) if asked is not None else "not run"
                claims.append(Claim("section III", what, f"{paper} mm²", "", None, reason))
                continue
            met, reason = _judged(
                found, model, part=part, reduction=reduction, value=value, paper=paper
            )
            if asked is not None and asked.reduced and one is not None and one.shipped:
                few = f"judged on {asked.count} frames of {asked.full}, many of them rest shapes"
                reason = f"{few}; {reason}"
            claims.append(
                Claim("section III", what, f"{paper} mm²", f"{value:.2f} mm²", met, reason)
            )
    return claims


def _judged(
    found: Sequence[Training], model: str, *, part: str, reduction: str, value: float, paper: float
) -> tuple[bool, str]:
    """Return whether an error is as published, or, of the baseline, as far behind."""
    if model == "deformernet":
        return value <= paper, "any two frames of an episode, here of many poses and grasps"
    ahead = best_of(found, "deformernet", few=False)
    ours = None if ahead is None else _value(ahead, part, reduction)
    published = (TRAIN_MSE_MM2 if part == "training" else TEST_MSE_MM2)["deformernet"]
    times = paper / published
    if ours is None:
        return value >= paper, "a baseline: met if it errs as much as in the paper"
    return (
        value >= times * ours,
        f"a baseline: met if it is as far behind DeformerNet as in the paper, {times:.0f} times; "
        f"here {value / ours:.0f} times",
    )


def _few(found: Sequence[Training], asked: Asked | None) -> Claim:
    what = "Hu et al. on a few shapes: much smaller losses than on all"
    few, full = best_of(found, "hu", few=True), best_of(found, "hu", few=False)
    if few is None or full is None:
        reason = "not run" if asked is None else _why_not("hu")
        return Claim("section III", what, "much smaller", "", None, reason)
    values = [_value(one, "unseen shapes", "mean") or 0.0 for one in (few, full)]
    return Claim(
        "section III",
        what,
        "much smaller",
        f"{values[0]:.1f} against {values[1]:.1f} mm²",
        values[0] < values[1] / 2,
        "on unseen shapes, mean over xyz; met if it is less than half",
    )


def _value(one: Training, part: str, reduction: str) -> float | None:
    errors = one.error(part)
    if errors is None:
        return None
    return errors.sum_mm2 if reduction == "sum" else errors.mse_mm2


def _why_not(model: str) -> str:
    asked = "--model hu" if model == "hu" else "--model deformernet"
    return f"give --runs with a finished `dnet train {asked}`, or the episodes that it learned from"

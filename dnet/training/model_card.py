"""The card of a trained network: what it learned from, how, and how far off it is."""

from collections.abc import Mapping

from dnet.errors import TooFew
from dnet.files.whole_file import write_whole
from dnet.training.run import RunWriter
from dnet.training.scores import Errors, Scores
from dnet.training.tasks import Task

CARD = "MODEL_CARD.md"

_ROW = "| {} | {} | {} | {:.2f} | {:.2f} | {:.2f} | {} | {:.1f} |"


def write_card(run: RunWriter, errors: Mapping[str, Errors | None], task: Task) -> None:
    """Write the card of the best network of a run into its directory, whole or not at all.

    Args:
        run: Of the training.
        errors: Of that network on each set of frames, by its name.
        task: That the network is for.
    """
    write_whole(run.path / CARD, card(run, errors, task).encode())


def card(run: RunWriter, errors: Mapping[str, Errors | None], task: Task) -> str:
    """Return the card as Markdown."""
    content = run.content
    network, settings, data = content["network"], content["training"], content["data"]
    best = run.best
    if best is None:
        raise TooFew(f"number of epochs of {run.path}", 0, 1)
    frames = data["frames"]
    lines = [
        f"# {task.network.__name__}",
        "",
        task.does,
        "",
        f"- **Network**: {_listed(network)}",
        f"- **Data**: {len(data['training'])} episodes with {frames['training']} frames to learn "
        f"from, {frames['unseen_shapes']} frames of these episodes and {frames['unseen_episodes']} "
        f"of {len(data['unseen_episodes'])} others to be judged by; fingerprints "
        f"{', '.join(data['fingerprints'].values())}",
        f"- **Training**: {_listed(settings)}",
        f"- **Best epoch**: {best['epoch']} of {len(run.history)}, on "
        f"{run.chosen_by.replace('_', ' ')}, after {best['steps']} batches "
        f"and {best['seconds'] / 3600:.2f} hours",
        f"- **Versions**: {_listed(content['versions'])}",
        "",
        "| frames of | pairs | count | MSE, mm² | sum over xyz, mm² | error, mm | R² | "
        f"MSE of {task.zero}, mm² |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, of in errors.items():
        if of is not None:
            if of.any_pair is not None:
                lines.append(_row(name, "any two of an episode", of.any_pair))
            if of.from_rest is not None:
                lines.append(_row(name, "rest to shape", of.from_rest))
    lines += [
        "",
        "MSE is the squared error, mean over pairs and over x, y, z; error is the mean Euclidean "
        "distance. Unseen shapes are of episodes that were trained on, unseen episodes are of "
        "other poses and grasps.",
        "",
        "Clouds are in metres in the world frame, seen from one side, and have "
        f"{network['points']} points. Objects, cameras and arms unlike those of the training are "
        "beyond what this network was tried on; it is for research, not for surgery.",
        "",
    ]
    return "\n".join(lines)


def _listed(values: Mapping[str, object]) -> str:
    return ", ".join(f"{name} {value}" for name, value in values.items())


def _row(name: str, pairs: str, scores: Scores) -> str:
    r2 = "-" if scores.r2 is None else f"{scores.r2:.4f}"
    numbers = (scores.pairs, scores.mse_mm2, scores.sum_mm2, scores.mean_mm)
    return _ROW.format(name, pairs, *numbers, r2, scores.zero_mse_mm2)

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from dnet.recorders.training_recording import write_training
from dnet.recorders.training_values import (
    EpochPoint,
    LossPoint,
    Motions,
    RatePoint,
    SetErrors,
    WorstSample,
)
from dnet.recorders.viewer import draw
from dnet.recorders.viewer_process import RERUN
from tests.recorders.rollout import frames
from tests.recorders.rrd import entities, rows

FIGURES = ("mse_mm2", "sum_mm2", "mean_mm", "r2")
SHAPES, EPISODES = "unseen shapes", "unseen episodes"
LOSSES = [LossPoint(10 * step, 200.0 / step) for step in range(1, 41)]
RATES = [RatePoint(100 * epoch, 1e-3 / epoch) for epoch in range(1, 5)]
EPOCHS = [
    EpochPoint(
        100 * epoch,
        {
            SHAPES: SetErrors(mse_mm2=90.0 / epoch, mean_mm=12.0 / epoch, r2=1 - 0.3 / epoch),
            EPISODES: SetErrors(mse_mm2=120.0 / epoch, mean_mm=15.0 / epoch, r2=1 - 0.4 / epoch),
        },
    )
    for epoch in range(1, 5)
]


def motions(name: str, *, noise: float) -> Motions:
    rng = np.random.default_rng(3)
    true = rng.uniform(-0.04, 0.04, (200, 3)).astype(np.float32)
    return Motions(name, true + rng.normal(0, noise, true.shape).astype(np.float32), true)


def sample(seed: int) -> WorstSample:
    *_, current, _, goal = frames(3, seed=seed, points=800)
    true = goal.grasp - current.grasp
    predicted = true + np.array([0.0, 0.02, 0.0])
    return WorstSample(
        f"box-{seed} 1 → 2", current.cloud, goal.cloud, current.grasp, true, predicted, 20.0
    )


MOTIONS = [motions(SHAPES, noise=0.002), motions(EPISODES, noise=0.004)]
WORST = [sample(seed) for seed in range(4)]


def write(path: Path, **other: Any) -> Path:
    """Write a training of four epochs, or one that differs from it."""
    given: dict[str, Any] = {
        "name": "a training",
        "losses": LOSSES,
        "rates": RATES,
        "epochs": EPOCHS,
        "motions": MOTIONS,
        "worst": WORST,
    }
    write_training(path, **{**given, **other})
    return path


def curve(path: Path, entity: str) -> list[tuple[float, float]]:
    found = rows(path, entity, "Scalars:scalars", timeline="step")
    return [(step, value) for step, (value,) in found]


def content(path: Path) -> tuple[str, list[str]]:
    """Return a recording's id and all that it holds, but for the ids that Rerun gives rows."""
    (entry,) = RrdReader(path).recordings()
    held = [
        f"{chunk.entity_path} {name} {batch.column(name).to_pylist()!r}"
        for chunk in RrdReader(path).stream().to_chunks()
        for batch in [chunk.to_record_batch()]
        for name in batch.schema.names
        if name != "rerun.controls.RowId"
    ]
    return str(entry.recording_id), sorted(held)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("training") / "new" / "training.rrd")


def test_rerun_verifies_it(recording: Path) -> None:
    command = [*RERUN, "rrd", "verify", str(recording)]
    verified = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert verified.returncode == 0, verified.stdout + verified.stderr


def test_it_brings_its_layout_along(recording: Path) -> None:
    assert [entry.application_id for entry in RrdReader(recording).blueprints()] == ["dnet train"]


def test_losses_are_a_curve_and_a_curve_of_logarithms(recording: Path) -> None:
    assert curve(recording, "/loss") == [(point.step, point.loss) for point in LOSSES]
    logarithms = curve(recording, "/log10/loss")
    assert [step for step, _ in logarithms] == [point.step for point in LOSSES]
    np.testing.assert_allclose(
        [10**value for _, value in logarithms], [point.loss for point in LOSSES]
    )


def test_the_learning_rate_is_a_curve(recording: Path) -> None:
    assert curve(recording, "/learning_rate") == [(point.step, point.rate) for point in RATES]


@pytest.mark.parametrize("name", [SHAPES, EPISODES])
def test_errors_of_each_set_are_curves(recording: Path, name: str) -> None:
    escaped = name.replace(" ", r"\ ")
    judged = [(epoch.step, epoch.errors[name]) for epoch in EPOCHS]
    for entity, want in (
        ("errors/mse_mm2", [error.mse_mm2 for _, error in judged]),
        ("errors/sum_mm2", [3 * error.mse_mm2 for _, error in judged]),
        ("errors/mean_mm", [error.mean_mm for _, error in judged]),
        ("errors/r2", [error.r2 for _, error in judged]),
        ("log10/mse_mm2", [np.log10(error.mse_mm2) for _, error in judged]),
    ):
        steps = [step for step, _ in judged]
        assert curve(recording, f"/{entity}/{escaped}") == list(zip(steps, want, strict=True))


def test_a_set_that_only_some_epochs_have_is_a_shorter_curve(tmp_path: Path) -> None:
    last = EpochPoint(500, {SHAPES: EPOCHS[0].errors[SHAPES]})
    path = write(tmp_path / "a.rrd", epochs=[*EPOCHS, last])
    assert len(curve(path, r"/errors/r2/unseen\ shapes")) == 5
    assert len(curve(path, r"/errors/r2/unseen\ episodes")) == 4


def test_the_last_errors_are_a_table(recording: Path) -> None:
    ((_, (text,)),) = rows(recording, "/summary", "TextDocument:text", timeline=None)
    heading, _, first, second = text.splitlines()
    assert "after step 400" in heading
    assert first == "| unseen shapes | **3.00 mm** | 22.5 mm² | 67.5 mm² | 0.925 |"
    assert second == "| unseen episodes | **3.75 mm** | 30 mm² | 90 mm² | 0.900 |"


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_motions_are_points_in_millimetres_true_to_the_right_and_predicted_upwards(
    recording: Path, axis: int
) -> None:
    root = f"/motions/{'xyz'[axis]}"
    for one in MOTIONS:
        entity = rf"{root}/pairs/{one.name}".replace(" ", r"\ ")
        ((_, points),) = rows(recording, entity, "Points2D:positions", timeline=None)
        want = 1e3 * np.stack([one.true[:, axis], one.predicted[:, axis]], axis=1)
        np.testing.assert_allclose(points, want, rtol=1e-5)
    ((_, (scale,)),) = rows(recording, root, "Transform3D:scale", timeline=None)
    assert scale[0] > 0 > scale[1]
    ((_, (diagonal,)),) = rows(recording, f"{root}/diagonal", "LineStrips2D:strips", timeline=None)
    assert all(true == predicted for true, predicted in diagonal)


def test_all_true_motions_lie_in_the_frame(recording: Path) -> None:
    ((_, (scale,)),) = rows(recording, "/motions/x", "Transform3D:scale", timeline=None)
    assert max(np.abs(1e3 * one.true).max() for one in MOTIONS) < 1 / scale[0]


def test_a_set_has_one_colour_in_curves_and_scatters(recording: Path) -> None:
    found = {}
    for name in (SHAPES, EPISODES):
        escaped = name.replace(" ", r"\ ")
        places = (
            (f"/errors/mean_mm/{escaped}", "SeriesLines:colors"),
            (f"/log10/mse_mm2/{escaped}", "SeriesLines:colors"),
            (f"/motions/x/pairs/{escaped}", "Points2D:colors"),
        )
        ((_, first),), *others = (rows(recording, *place, timeline=None) for place in places)
        assert all(color == first for ((_, color),) in others)
        found[name] = first
    assert found[SHAPES] != found[EPISODES]


def test_worst_pairs_are_both_clouds_and_both_motions_from_the_grasp(recording: Path) -> None:
    for number, pair in enumerate(WORST):
        root = f"/worst/{number}"
        for entity, cloud in (("current", pair.current), ("goal", pair.goal)):
            ((_, points),) = rows(
                recording, f"{root}/{entity}", "Points3D:positions", timeline=None
            )
            np.testing.assert_array_equal(points, cloud)
        for entity, motion in (("true", pair.true), ("predicted", pair.predicted)):
            arrow = f"{root}/{entity}"
            ((_, origins),) = rows(recording, arrow, "Arrows3D:origins", timeline=None)
            ((_, vectors),) = rows(recording, arrow, "Arrows3D:vectors", timeline=None)
            np.testing.assert_allclose(origins, [pair.grasp], atol=1e-7)
            np.testing.assert_allclose(vectors, [motion], atol=1e-7)
        ((_, caption),) = rows(recording, f"{root}/name", "Points3D:labels", timeline=None)
        assert caption == [f"box-{number} 1 → 2: 20.0 mm off"]


def test_a_training_without_an_epoch_is_a_recording_that_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "a.rrd", losses=[], rates=[], epochs=[], motions=[], worst=[])
    ((_, (text,)),) = rows(path, "/summary", "TextDocument:text", timeline=None)
    assert text == "No epoch is done yet."
    assert not [one for one in entities(path) if one.startswith(("/loss", "/errors", "/worst"))]


def test_what_is_not_finite_is_a_gap(tmp_path: Path) -> None:
    bad = [LossPoint(step, value) for step, value in enumerate((np.nan, np.inf, 0.0, 100.0))]
    errors = SetErrors(mse_mm2=np.nan, mean_mm=np.inf, r2=None)
    wild = replace(MOTIONS[0], predicted=MOTIONS[0].predicted.copy())
    wild.predicted[:3] = [[np.nan] * 3, [np.inf] * 3, [3e38] * 3]
    lost = replace(WORST[0], predicted=np.full(3, np.nan), error_mm=np.nan)
    path = write(
        tmp_path / "a.rrd",
        losses=bad,
        epochs=[*EPOCHS, EpochPoint(500, {SHAPES: errors})],
        motions=[wild],
        worst=[lost],
    )
    np.testing.assert_array_equal(
        [value for _, value in curve(path, "/loss")], [np.nan, np.nan, 0.0, 100.0]
    )
    np.testing.assert_array_equal(
        [value for _, value in curve(path, "/log10/loss")], [np.nan, np.nan, np.nan, 2.0]
    )
    assert np.isnan([curve(path, rf"/errors/{one}/unseen\ shapes")[-1][1] for one in FIGURES]).all()
    ((_, points),) = rows(
        path, r"/motions/x/pairs/unseen\ shapes", "Points2D:positions", timeline=None
    )
    assert len(points) == len(wild.true) - 3
    ((_, arrows),) = rows(path, "/worst/0/predicted", "Arrows3D:vectors", timeline=None)
    assert not arrows


def test_a_diverged_network_leaves_the_frame_as_it_is(tmp_path: Path, recording: Path) -> None:
    diverged = [replace(one, predicted=1000 * one.predicted) for one in MOTIONS]
    path = write(tmp_path / "a.rrd", motions=diverged)
    place = ("/motions/x", "Transform3D:scale")
    assert rows(path, *place, timeline=None) == rows(recording, *place, timeline=None)


def test_the_same_values_are_the_same_recording(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    first = content(write(path))
    assert content(write(path)) == first


def test_trainings_at_other_places_are_other_recordings(tmp_path: Path) -> None:
    (one, held), (other, also) = (content(write(tmp_path / f"{name}.rrd")) for name in "ab")
    assert one != other
    assert held == also


def test_what_was_learned_since_replaces_the_older_recording_under_the_same_id(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.rrd"
    before, _ = content(write(path, losses=LOSSES[:20], epochs=EPOCHS[:2]))
    after, _ = content(write(path))
    assert before == after
    assert len(curve(path, "/loss")) == len(LOSSES)
    assert [file.name for file in tmp_path.iterdir()] == ["a.rrd"]


def test_a_training_that_cannot_be_written_leaves_the_older_recording(tmp_path: Path) -> None:
    path = write(tmp_path / "a.rrd")
    older = path.read_bytes()
    with pytest.raises(OverflowError):
        write(path, rates=[RatePoint(2**70, 1e-3)])
    assert path.read_bytes() == older
    assert [file.name for file in tmp_path.iterdir()] == ["a.rrd"]


def test_a_picture_shows_curves_scatters_and_worst_pairs(recording: Path, tmp_path: Path) -> None:
    picture = tmp_path / "training.png"
    draw(recording, picture, seconds=None)
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    width = pixels.shape[1]
    columns = np.split(pixels, [int(0.35 * width), int(0.55 * width)], axis=1)

    def share(column: int, color: tuple[int, int, int]) -> float:
        return float((np.abs(columns[column] - color) < 40).all(axis=2).mean())

    amber, violet, blue, green = (255, 176, 0), (214, 110, 255), (80, 140, 225), (56, 165, 84)
    for column in (0, 1):
        assert share(column, amber) > 0.001
        assert share(column, violet) > 0.001
    assert share(2, blue) > 0.01
    assert share(2, green) > 0.01

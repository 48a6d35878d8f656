from pathlib import Path

import numpy as np
import torch

from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import open_index
from dnet.nets.hu import HuNet, HuNetConfig, features_of
from dnet.training.examples import stream_of
from dnet.training.feature_tables import FeatureTables
from dnet.training.parallel import Process
from dnet.training.settings import TrainingSettings
from dnet.training.tasks import TASKS, task_of
from dnet.training.training import Training
from tests.training.deforming_box import SMALL, BoxEpisode, box_frames, write_boxes

CONFIG = HuNetConfig(points=SMALL.points, components=12)


def test_features_are_found_once_and_are_those_of_the_cloud(tmp_path: Path) -> None:
    table = settled_frames(open_index(write_boxes(tmp_path, [BoxEpisode(0), BoxEpisode(1)])))
    tables = FeatureTables(table, CONFIG)
    done: list[int] = []
    tables.build(on_clouds=done.append)
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npy")}
    tables.build(on_clouds=done.append)
    assert len(made) == 2
    assert made == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npy")}
    assert done == [6, 6, 6, 6]
    found = tables.of(np.array([2, 7]))
    for features, cloud in zip(
        found.features, (BoxEpisode(0).frame(2).cloud, BoxEpisode(1).frame(1).cloud), strict=True
    ):
        np.testing.assert_array_equal(features.numpy(), features_of(cloud, CONFIG))


def test_another_camera_has_features_of_its_own(tmp_path: Path) -> None:
    table = settled_frames(open_index(write_boxes(tmp_path, [BoxEpisode(0)])))
    for eye in ((0.0, -0.3, 0.42), (0.0, 0.3, -0.42)):
        FeatureTables(table, HuNetConfig(points=SMALL.points, eye=eye)).build()
    assert len(list(tmp_path.rglob("*.npy"))) == 2


def test_motions_are_learned_from_features_and_frames_stay_where_they_are(tmp_path: Path) -> None:
    frames, task = box_frames(tmp_path, [0, 1, 2], config=CONFIG), TASKS["hu"]
    network = task.new(CONFIG, seed=0)
    assert isinstance(network, HuNet)
    assert task_of(network) is task
    task.fit(network, frames)
    settings = TrainingSettings(groups=2, frames=6, epochs=150, learning_rate=0.02)
    stream = stream_of(frames, settings, process=Process())
    examples = next(iter(stream))
    motions = {tuple(np.round(motion, 6)) for motion in examples.motions.numpy()}
    table = frames.table
    apart = table.grasps[None].astype(np.float32) - table.grasps[:, None].astype(np.float32)
    assert motions <= {tuple(np.round(motion, 6)) for motion in apart.reshape(-1, 3)}
    training = Training(
        task.objective(network), stream_of(frames, settings, process=Process()), settings
    )
    before = task.judge(network, frames)
    while training.progress < 1:
        list(training.epoch())
        training.close_epoch()
    after = task.judge(training.average, frames)
    assert isinstance(training.average, HuNet)
    assert before is not None
    assert after is not None
    assert after.any_pair is not None
    assert after.any_pair.mse_mm2 < 0.5 * after.any_pair.zero_mse_mm2
    assert torch.equal(training.average.basis, network.basis)

"""Where a goal comes from: a frame of an episode, somebody's cloud, or a random displacement."""

from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.geometry.camera import DepthImage, unproject
from dnet.geometry.sampling import farthest_points
from dnet.laboratory import Laboratory
from dnet.perception.cloud_file import READERS, read_cloud
from dnet.sim.observe import observe
from dnet.sim.rollout import Rollout
from dnet.sim.tissue import tissue_mesh
from dnet.sim.tissue_families import TissueFamily
from dnet.trials.request import Trial, is_random, split_goal
from dnet.types import Cloud, Frame, Goal, Scene


@dataclass(frozen=True, slots=True)
class Task:
    """What a run starts from, and what it is to reach."""

    goal: Goal
    scene: Scene


def read_task(trial: Trial, lab: Laboratory) -> Task:
    """Return what a trial is to reach.

    Raises:
        DnetError: If there is no such goal, or it has other points than the laboratory's clouds.
    """
    path, number = split_goal(trial.goal)
    if is_random(trial.goal):
        return _drawn(trial, lab)
    if path.suffix.lower() in READERS:
        return _from_file(path, trial, lab)
    return _from_episode(path, number, lab)


def _from_episode(path: Path, number: int | None, lab: Laboratory) -> Task:
    with EpisodeReader(path) as episode:
        number = len(episode) - 1 if number is None else number
        frame = episode.frame(number)
        goal = _goal_of(frame, f"{path.name}:{number}", episode.meta.scene, lab)
        return Task(goal, episode.meta.scene)


def _drawn(trial: Trial, lab: Laboratory) -> Task:
    _, number = split_goal(trial.goal)
    seed = trial.seed if number is None else number
    rollout = _rollout(lab, seed)
    *_, frame = rollout.frames(1)
    return Task(_goal_of(frame, f"random:{seed}", rollout.scene, lab), rollout.scene)


def _from_file(path: Path, trial: Trial, lab: Laboratory) -> Task:
    cloud = read_cloud(path, points=lab.settings.points)
    if trial.scene is None:
        scene = _rollout(lab, trial.seed).scene
    else:
        with EpisodeReader(trial.scene) as episode:
            scene = episode.meta.scene
    return Task(Goal(cloud, path.name), scene)


def _rollout(lab: Laboratory, seed: int) -> Rollout:
    """Return the episode that `dnet record --seed SEED` begins with."""
    return Rollout(
        lab.world,
        lab.planner,
        partial(observe, lab.world, lab.see),
        workspace=lab.settings.workspace,
        draw_tissue=TissueFamily("box").draw,
        seed=(seed, 0),
    )


def _goal_of(frame: Frame, source: str, scene: Scene, lab: Laboratory) -> Goal:
    goal = Goal(frame.cloud.copy(), source, grasp=frame.grasp, nodes=frame.nodes.copy())
    if len(frame.nodes) != len(tissue_mesh(scene.tissue).nodes):
        return replace(goal, nodes=None)
    with closing(lab.portrait(scene.tissue, arms=True)) as portrait:
        image = portrait.look(frame.nodes, frame.joints)
        return replace(goal, again=_seen_again(image, portrait.object_id, lab))


def _seen_again(image: DepthImage, object_id: int, lab: Laboratory) -> Cloud | None:
    """Return another sample of what an image shows of the object, as a network would get it."""
    noise = lab.settings.noise
    if noise is not None:
        image = noise.apply(image, random=np.random.default_rng(0))
    points = unproject(image, image.mask == object_id)
    count = lab.settings.points
    if len(points) < count:
        return None
    # Another first point is another sample throughout.
    return farthest_points(points, count, start=len(points) // 2)

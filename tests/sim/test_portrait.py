"""A portrait shows what the world's own camera shows, and what is behind the arms if they go."""

from contextlib import closing

import numpy as np

from dnet.geometry.camera import Camera
from dnet.sim.arms import Placement
from dnet.sim.portrait import Portrait
from dnet.sim.quasistatic_world import QuasistaticWorld
from dnet.types import Scene

SCENE = Scene((0.006, -0.004), 0.15, (-0.04, 0.0, 0.04), (0.04, 0.0, 0.04))


def test_it_sees_what_the_world_sees_and_without_arms_more() -> None:
    camera, placement = Camera(), Placement()
    with closing(QuasistaticWorld()) as world:
        world.reset(SCENE)
        seen, number = world.look(), world.object_id
        nodes, joints = world.nodes(), world.joints
    counts = {}
    for arms in (True, False):
        drawn = Portrait(SCENE.tissue, camera=camera, placement=placement, arms=arms)
        with closing(drawn):
            image = drawn.look(nodes, joints)
            shown = image.mask == drawn.object_id
        counts[arms] = int(shown.sum())
        if arms:
            np.testing.assert_array_equal(shown, seen.mask == number)
            np.testing.assert_allclose(image.depth, seen.depth, atol=1e-6)
    assert counts[False] > counts[True]

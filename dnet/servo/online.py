"""The network of Hu et al. as a controller that goes on learning from what its motions do."""

from collections.abc import Callable
from copy import deepcopy

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from dnet.nets.hu import HuNet
from dnet.types import Cloud, Point

STEPS = 50
"""Of Adam, before each prediction but the first."""
LEARNING_RATE = 2e-3
BEYOND = 0.005
"""Metres that a tip may go beyond what it was asked to; farther, it has grasped anew."""


class OnlineHu:
    """Begins as a trained network; before each motion it learns from what it has seen by itself.

    Any two shapes of the run so far, and how far the tip went between them, are an example, as they
    are of an episode in training. Hu et al. 2019 update their network at every step likewise; they
    begin without one, by small motions at random, while here what was learned before is where the
    run begins, for principal components must be known anyway. The steps, their rate, and learning
    from all pairs alike are decided here.

    Args:
        network: To begin with; it is copied, and stays as it is.
        tip: Returns where the grasp is now, in metres, (3,).
    """

    def __init__(self, network: HuNet, tip: Callable[[], Point]) -> None:
        self.network = deepcopy(network)
        self._tip = tip
        self._optimizer = torch.optim.Adam(self.network.parameters(), lr=LEARNING_RATE)
        self._seen: list[tuple[Float[Tensor, " c"], Point]] = []
        """Principal components of each shape, and where the tip was."""
        self._asked: Point = np.zeros(3)

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Learn from what the last motion did, and return the next.

        Raises:
            ShortCloud: If a cloud has fewer points than the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        here, tip = self.network.describe(current, "current cloud"), self._tip().copy()
        if self._seen:
            gone = float(np.linalg.norm(tip - self._seen[-1][1]))
            if gone > float(np.linalg.norm(self._asked)) + BEYOND:
                self._seen.clear()
        self._seen.append((here[0], tip))
        if len(self._seen) > 1:
            self._learn()
        there = self.network.describe(goal, "goal cloud")
        with torch.no_grad():
            motion = self.network.motion(here, there)[0]
        self._asked = motion.cpu().numpy().astype(np.float64)
        return self._asked

    def _learn(self) -> None:
        """Learn from all pairs of shapes seen since the grasp."""
        shapes = torch.stack([shape for shape, _ in self._seen])
        tips = torch.from_numpy(np.array([tip for _, tip in self._seen], np.float32))
        current, goal = np.nonzero(~np.eye(len(tips), dtype=bool))
        true = (tips[goal] - tips[current]).to(shapes.device)
        for _ in range(STEPS):
            found = self.network.motion(shapes[current], shapes[goal])
            loss = ((found - true) / self.network.config.motion_unit).square().mean()
            self._optimizer.zero_grad(set_to_none=True)
            torch.autograd.backward(loss)
            self._optimizer.step()

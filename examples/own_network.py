"""Plug in a network of your own: train it on recorded episodes, then let it drive a servo run."""

import sys
from pathlib import Path

import torch
from torch import Tensor, nn

from dnet.datasets.loading import load_samples
from dnet.laboratory import LaboratorySettings, laboratory
from dnet.trials.request import Trial
from dnet.trials.trial import run_trial
from dnet.types import Cloud, Point

UNIT = 0.1
"""Metres that the network calls 1."""


class PointNet(nn.Module):
    """Two clouds, each pooled to its largest features, and a motion between them."""

    def __init__(self) -> None:
        super().__init__()
        self.points = nn.Sequential(nn.Linear(3, 64), nn.ReLU(), nn.Linear(64, 128))
        self.motion = nn.Linear(2 * 128, 3)

    def forward(self, current: Tensor, goal: Tensor) -> Tensor:
        """Return the motions of the grasp for pairs of clouds, in metres."""
        seen = [self.points(clouds / UNIT).amax(dim=1) for clouds in (current, goal)]
        return UNIT * self.motion(torch.cat(seen, dim=1))

    @torch.no_grad()
    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return one motion: all that the servo loop asks of a controller."""
        one, other = (torch.from_numpy(cloud)[None] for cloud in (current, goal))
        return self(one, other)[0].double().numpy()


data, goal, out = sys.argv[1], sys.argv[2], Path(sys.argv[3])
torch.manual_seed(0)
network = PointNet()
optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)
stream = load_samples(data, pairs="any", batch=16)
for _ in range(10):
    for batch in stream:  # one epoch, each in an order of its own
        error = (network(batch.current, batch.goal) - batch.motion).square().mean()
        optimiser.zero_grad()
        error.backward()
        optimiser.step()
print(f"{error.item() * 1e6:.0f} mm² off in the last batch")
with laboratory(LaboratorySettings(world="quasistatic")) as lab:
    trial = Trial(goal=goal, out=out, laboratory=lab.settings)
    trace = run_trial(trial, lab, say=print, controller=network)
print(trace.outcome)

"""The network of Hu et al.: from how the surfaces of two clouds are turned to the motion between.

Hu, Han, Sun, Pan and Manocha, 3-D Deformable Object Manipulation Using Deep Neural Networks, 2019,
the work that DeformerNet was compared with. Taken from it: a feature vector made by hand, the
extended FPFH of a cloud (135 numbers, `dnet.geometry.extended_fpfh`); that its difference between
the goal and the current shape is what the motion is computed from, by a few fully connected layers;
and that the robot may go on learning while it works (`dnet.servo.online`). Taken from the public
scripts with which Thach et al. 2021 compared: 30 principal components, and layers of 30, 16, 8, 8
and 3. What those scripts came out as fits a network without ReLU, a linear map; both are here.

Decided here: principal components are those of the differences between frames of one episode, which
are what the network sees, each divided by its standard deviation.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float, Float32, Int64, Integer
from torch import Tensor, nn

from dnet.errors import LongCloud, TooFew
from dnet.geometry.camera import Camera
from dnet.geometry.extended_fpfh import FEATURES, extended_fpfh
from dnet.geometry.sampling import farthest_points
from dnet.nets.deformernet import checked
from dnet.types import Cloud, Point

WIDTHS = (16, 8, 8)
"""Of the hidden layers."""


@dataclass(frozen=True, slots=True)
class HuNetConfig:
    """All that is needed to build a network, its weights aside."""

    points: int = 2048
    """Points of a cloud."""
    components: int = 30
    """Principal components of the features."""
    relu: bool = True
    """Whether there is a ReLU after each layer but the last; a linear map otherwise."""
    eye: tuple[float, float, float] = Camera.eye
    """Where the camera stands, towards which normals point, in metres."""
    motion_unit: float = 0.01
    """Metres that the network's output of 1 stands for: a typical motion."""

    def __post_init__(self) -> None:
        for what, got, least in (
            ("points of a cloud", self.points, 3),
            ("number of principal components", self.components, 1),
        ):
            if got < least:
                raise TooFew(what, got, least)
        if self.components > FEATURES:
            raise LongCloud("vector of principal components", self.components, FEATURES)


@dataclass(frozen=True, slots=True)
class Described:
    """A batch of clouds, of which only their features are left."""

    features: Float[Tensor, "b 135"]

    def __len__(self) -> int:
        return len(self.features)

    def to(self, device: torch.device) -> "Described":
        """Return the same features on `device`."""
        return Described(self.features.to(device, non_blocking=True))

    def pin_memory(self) -> "Described":
        """Return the same features in memory from which a GPU reads fastest."""
        return Described(self.features.pin_memory())

    def take(self, clouds: Integer[Tensor, " k"]) -> "Described":
        """Return some clouds of a batch, in this order."""
        return Described(self.features[clouds])


class HuNet(nn.Module):
    """Principal components of a cloud's extended FPFH, their difference, fully connected layers.

    It is asked as DeformerNet is. Its principal components are not learned step by step: `fit`
    finds them before.
    """

    basis: Float[Tensor, "135 c"]
    """What features are multiplied with."""

    def __init__(self, config: HuNetConfig | None = None) -> None:
        super().__init__()
        self.config = config or HuNetConfig()
        self.register_buffer("basis", torch.zeros(FEATURES, self.config.components))
        layers: list[nn.Module] = []
        for below, above in pairwise((self.config.components, *WIDTHS)):
            layers += [nn.Linear(below, above), *([nn.ReLU()] if self.config.relu else [])]
        self.layers = nn.Sequential(*layers, nn.Linear(WIDTHS[-1], 3))

    def fit(
        self, features: Float32[np.ndarray, "n 135"], episodes: Int64[np.ndarray, " n"]
    ) -> None:
        """Find the principal components.

        Args:
            features: Of the clouds to learn from.
            episodes: Which episode each is of.
        """
        found = principal_components(features, episodes, count=self.config.components)
        self.basis.copy_(torch.from_numpy(found))

    @property
    def fitted(self) -> bool:
        """Whether there are principal components."""
        return bool((self.basis != 0).any())

    def encode(self, clouds: Described) -> Float[Tensor, "b c"]:
        """Return the principal components of each cloud of a batch."""
        components: Tensor = clouds.features @ self.basis
        return components

    def motion(
        self, current: Float[Tensor, "p c"], goal: Float[Tensor, "p c"]
    ) -> Float[Tensor, "p 3"]:
        """Return the motion between clouds of these components, in metres."""
        motion: Tensor = self.layers(goal - current)
        return motion * self.config.motion_unit

    @torch.no_grad()
    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the motion of the grasp that would turn `current` into `goal`, in metres.

        Of a cloud with more points than the network takes, the farthest from each other are taken.

        Args:
            current: What is seen, in metres in the world frame.
            goal: What should be seen, likewise.

        Raises:
            ShortCloud: If a cloud has fewer points than the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        here, there = self.describe(current, "current cloud"), self.describe(goal, "goal cloud")
        return self.motion(here, there)[0].cpu().numpy().astype(np.float64)

    @torch.no_grad()
    def describe(self, cloud: Cloud, what: str = "cloud") -> Float[Tensor, "1 c"]:
        """Return the principal components of a cloud that is seen; `what` it is in an error."""
        if len(cloud) > self.config.points:
            cloud = farthest_points(cloud, self.config.points)
        features = features_of(cloud, self.config, what=what)
        return self.encode(Described(torch.from_numpy(features[None]).to(self.basis.device)))


def features_of(
    cloud: Cloud, config: HuNetConfig, *, what: str = "cloud"
) -> Float32[np.ndarray, " 135"]:
    """Return the features of a cloud as a network of `config` takes it.

    Raises:
        ShortCloud: If the cloud has fewer points than the network takes.
        LongCloud: If it has more.
        BadCloud: If a coordinate is NaN or infinite.
    """
    return extended_fpfh(checked(cloud, config.points, what=what), np.array(config.eye))


def principal_components(
    features: Float32[np.ndarray, "n 135"], episodes: Int64[np.ndarray, " n"], *, count: int
) -> Float32[np.ndarray, "135 {count}"]:
    """Return what differences of features are multiplied with, so that their variance is one.

    Those of differences between any two frames of an episode are those of what is left when the
    mean of the episode is taken away. Where frames do not vary, columns are zero.

    Args:
        features: Of each frame.
        episodes: Which episode each frame is of.
        count: Of components, those of most variance.
    """
    _, of = np.unique(episodes, return_inverse=True)
    values = features.astype(np.float64)
    sums = np.zeros((of.max() + 1, values.shape[1]))
    np.add.at(sums, of, values)
    values -= (sums / np.bincount(of)[:, None])[of]
    # A difference of two has twice the variance of each.
    variances, axes = np.linalg.eigh(2 * values.T @ values / len(values))
    variances, axes = variances[::-1][:count], axes[:, ::-1][:, :count]
    # An axis may as well point the other way: its largest part is made positive.
    axes = axes * np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(count)])
    varying = variances > 1e-9 * max(float(variances[0]), 1e-30)
    scales = np.where(varying, 1 / np.sqrt(np.where(varying, variances, 1.0)), 0.0)
    return (axes * scales).astype(np.float32)

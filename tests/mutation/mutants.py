"""Ten lines of arithmetic, each with a plausible mistake that the tests must not let pass."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mutant:
    """One line, what it is changed to, and the tests that must fail for it."""

    name: str
    file: str
    line: str
    """As it stands in the file, without its indentation; only once."""
    mistake: str
    """What stands there instead."""
    tests: tuple[str, ...]
    """Quick ones."""


MUTANTS = (
    Mutant(
        "the Chamfer distance is one-sided",
        "dnet/geometry/chamfer.py",
        "return float((there + back) / 2)",
        "return float(there)",
        ("tests/geometry/test_chamfer.py",),
    ),
    Mutant(
        "farthest points forget an axis",
        "dnet/geometry/sampling.py",
        "dx, dy, dz = x[i] - at_x, y[i] - at_y, z[i] - at_z",
        "dx, dy, dz = x[i] - at_x, y[i] - at_y, np.float32(0.0)",
        ("tests/geometry/test_sampling.py",),
    ),
    Mutant(
        "the density of a point misses those that come before it",
        "dnet/nets/neighbourhoods.py",
        "sums[last:] += kernel[:, last - first :].sum(axis=0)",
        "sums[last:] += 0",
        ("tests/nets/test_neighbourhoods.py",),
    ),
    Mutant(
        "a pixel looks past where Bullet draws it",
        "dnet/geometry/camera.py",
        "return np.array("
        "[[f, 0.0, self.width / 2], [0.0, f, self.height / 2 - 1], [0.0, 0.0, 1.0]])",
        "return np.array("
        "[[f, 0.0, self.width / 2], [0.0, f, self.height / 2 + 1], [0.0, 0.0, 1.0]])",
        ("tests/sim/test_soft_picture.py", "tests/geometry/test_camera.py"),
    ),
    Mutant(
        "a joint of the arm turns the wrong way",
        "dnet/geometry/pose.py",
        "result[..., 1] = frames[..., 1] * c - frames[..., 0] * s",
        "result[..., 1] = frames[..., 1] * c + frames[..., 0] * s",
        ("tests/sim/test_psm.py",),
    ),
    Mutant(
        "forces within the tissue miss the change of volume",
        "dnet/sim/elastic_energy.py",
        "across = volume * body.lam * excess",
        "across = volume * body.lam * excess / 2",
        ("tests/sim/test_elastic_energy.py",),
    ),
    Mutant(
        "motions are turned the other way than the clouds",
        "dnet/training/augment.py",
        "return torch.bmm(placement.turns[groups], motions[..., None])[..., 0]",
        "return torch.bmm(placement.turns[groups].transpose(1, 2), motions[..., None])[..., 0]",
        ("tests/training/test_augment.py",),
    ),
    Mutant(
        "the rest shape joins the groups that it should not",
        "datasets/groups.py",
        "if chance >= self.rest_share or rest < 0 or rest in rows:",
        "if chance < self.rest_share or rest < 0 or rest in rows:",
        ("tests/datasets/test_stream.py",),
    ),
    Mutant(
        "a fit is pulled as much by one point as by many",
        "dnet/geometry/fit.py",
        "np.add.at(counts, back, 1.0)",
        "np.add.at(counts, back, 3.0)",
        ("tests/geometry/test_fit.py",),
    ),
    Mutant(
        "a short motion is as fast as a long one",
        "dnet/planning/timing.py",
        "speed = min(speed, float(np.sqrt(total * acceleration)))",
        "speed = min(speed, float(np.sqrt(4 * total * acceleration)))",
        ("tests/planning/test_timing.py",),
    ),
)

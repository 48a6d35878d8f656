"""What a package is needed for is said where it is missing; training needs none of a laboratory."""

import re
import sys
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from dnet.errors import MissingPackage
from dnet.packages import is_installed, needed_for, packages, require
from tests import lean
from tests.recorders import rollout

LABORATORY = ("pybullet", "pybullet_data", "ompl", "rerun", "rerun_cli", "rerun_sdk", "open3d")
"""What simulates, plans and shows."""


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("episodes")
    for index in range(2):
        seen = rollout.frames(4, seed=index, points=136)
        rollout.write(directory / f"episode-{index}.mcap", seen)
    return directory


def test_a_machine_without_a_laboratory_trains_judges_and_inspects(
    episodes: Path, tmp_path: Path
) -> None:
    ran = lean.run(
        ["train", "--from-mcap", episodes, "--out", "run", "--epochs", 1],
        ["evaluate", "network", "--from-mcap", episodes, "--checkpoint", "run"],
        ["inspect", "ls", episodes],
        without=LABORATORY,
        directory=tmp_path,
    )
    assert "errors of the best network" in ran.stdout
    assert "2 of 2 episodes finished" in ran.stdout
    assert "goes on without a recording: training.rrd, which `dnet play` shows" in ran.stderr
    assert 'needs rerun-sdk, which is not installed; pip install "rerun-sdk' in ran.stderr
    assert "dnet:" not in ran.stderr
    assert (tmp_path / "run" / "best.safetensors").is_file()
    assert not (tmp_path / "run" / "training.rrd").exists()


def test_what_needs_the_laboratory_names_it_and_the_command_that_brings_it(tmp_path: Path) -> None:
    ran = lean.run(
        ["record", "data", "--pairs", "1"],
        ["servo", "--goal", "random", "--out", "out"],
        ["play", "run.rrd"],
        ["evaluate", "grasp", "--from-mcap", "data", "--out", "out"],
        without=LABORATORY,
        directory=tmp_path,
    )
    laboratory = r'dnet: .* needs (ompl|pybullet), which is not installed; pip install "\1>='
    rerun = r'dnet: {} needs rerun-sdk, which is not installed; pip install "rerun-sdk[<>]'
    refusals = ran.stderr.splitlines()
    expected = laboratory, laboratory, rerun.format("dnet play"), rerun.format("out/grasp.rrd")
    for refusal, pattern in zip(refusals, expected, strict=True):
        assert re.match(pattern, refusal)
    assert not ran.stdout
    assert [path.name for path in tmp_path.iterdir()] == [".hiding"]


def test_every_requirement_is_known_with_the_extras_that_bring_it() -> None:
    found = {package.name: package for package in packages()}
    lines = [Requirement(line) for line in requires("deformernet") or ()]
    assert {line.name for line in lines} - {"deformernet"} == set(found)
    for line in lines:
        if line.marker is None:
            assert not found[line.name].extras
            assert SpecifierSet(found[line.name].versions) == line.specifier
    assert "ray" in found["ray"].extras
    assert found["ray"].remedy == 'pip install "deformernet[ray]"'
    assert found["pybullet"].remedy == f'pip install "pybullet{found["pybullet"].versions}"'
    assert all(is_installed(package.module) for package in packages() if not package.extras)


def test_a_module_that_is_none_of_ours_is_missed_as_ever() -> None:
    with pytest.raises(ModuleNotFoundError), needed_for("a test"):
        __import__("no_such_module")
    require("json", "a test")


def test_the_missing_package_of_a_module_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)
    for missing in (lambda: require("trimesh", "a test"), lambda: __import__("trimesh.base")):
        with (
            pytest.raises(MissingPackage, match=r'a test needs trimesh.*"deformernet\[clouds\]"'),
            needed_for("a test"),
        ):
            missing()

"""`dnet doctor` tells what works, what is missing, and the command that brings it."""

import json
from pathlib import Path

import pytest

from tests import lean

LACKING = ("ompl", "rerun", "rerun_cli", "matplotlib", "ray", "s3fs", "onnx", "tensorboard")


def test_a_machine_that_lacks_packages_is_told_what_brings_them(tmp_path: Path) -> None:
    ran = lean.run(["doctor", "--json"], without=LACKING, directory=tmp_path)
    told = json.loads(ran.stdout)
    abilities = {one["name"]: one for one in told["abilities"]}
    for name in ("physics", "logs", "networks", "training"):
        assert abilities[name]["status"] == "works", abilities[name]
    for name, package in (("planning", "ompl"), ("recordings", "rerun-sdk")):
        assert abilities[name]["status"] == "missing"
        assert abilities[name]["remedy"].startswith(f'pip install "{package}')
    assert abilities["Ray"]["remedy"] == 'pip install "deformernet[ray]"'
    versions = {one["name"]: one["version"] for one in told["packages"]}
    assert not versions["ompl"]
    assert versions["torch"]
    assert not told["works"]
    assert ran.stderr.startswith("dnet: planning, recordings, viewer, pictures will not work here")
    assert {one["name"] for one in told["machine"]} >= {"processors", "memory", "open files"}


@pytest.mark.slow
def test_where_all_is_installed_all_works_that_a_machine_needs_no_device_for(
    tmp_path: Path,
) -> None:
    ran = lean.run(["doctor", "--thorough", "--json"], without=(), directory=tmp_path)
    told = json.loads(ran.stdout)
    failing = {one["name"]: one["note"] for one in told["abilities"] if one["status"] != "works"}
    assert failing.keys() <= {"window", "GPU"}, failing
    assert told["works"]

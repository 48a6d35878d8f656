"""The version stands in one place, and the changelog knows it."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import dnet

ROOT = Path(__file__).parents[1]
RELEASE = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - \d{4}-\d{2}-\d{2}$", re.MULTILINE)


def declared() -> str:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return str(project["version"])


def test_what_is_installed_says_the_version_that_is_declared() -> None:
    assert dnet.__version__ == version("deformernet") == declared()


def test_the_changelog_has_what_comes_and_no_release_beyond_the_declared_one() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert changelog.count("## [Unreleased]") == 1
    releases = [tuple(map(int, one.split("."))) for one in RELEASE.findall(changelog)]
    assert releases == sorted(releases, reverse=True)
    now = tuple(map(int, declared().split(".")))
    assert not releases or releases[0] == now
    assert len(re.findall(r"^## \[", changelog, re.MULTILINE)) == 1 + len(releases)

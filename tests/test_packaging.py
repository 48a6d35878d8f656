"""What is installed is dnet and nothing else: from a clone, and from the sdist of one."""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory with an sdist, and with the wheel that was made of it alone."""
    out = tmp_path_factory.mktemp("built")
    subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", out, ROOT],
        check=True,
        capture_output=True,
    )
    return out


@pytest.fixture(scope="module")
def names(built: Path) -> list[str]:
    (wheel,) = built.glob("*.whl")
    return zipfile.ZipFile(wheel).namelist()


def test_the_wheel_holds_only_dnet(names: list[str]) -> None:
    top = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    assert top == {"dnet"}


def test_the_wheel_holds_every_file_of_the_tree(names: list[str]) -> None:
    """Modules, weights and their cards, the template of the report, the typing marker."""
    inside = {
        f"dnet/{folder}{path.relative_to(base)}"
        for folder, base in (
            ("", ROOT / "dnet"),
            ("recorders/", ROOT / "recorders"),
            ("datasets/", ROOT / "datasets"),
            ("tools/", ROOT / "tools"),
        )
        for path in base.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert inside == {name for name in names if ".dist-info/" not in name}
    assert {"dnet/py.typed", "dnet/evaluation/report/page.html.j2"} < inside
    assert not [name for name in names if "test" in name.lower()]


def test_the_sdist_holds_no_part_of_the_tests(built: Path) -> None:
    """They need data beside them; whoever tests has a clone."""
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert {"constraints.txt", "CHANGELOG.md", "LICENSE", "README.md"} < inside
    assert not [name for name in inside if name.startswith("tests/")]


def test_the_linked_folders_are_relative_links() -> None:
    for name in ("recorders", "datasets", "tools"):
        link = ROOT / "dnet" / name
        assert link.is_symlink()
        assert str(link.readlink()) == f"../{name}"
        assert not (link / "__init__.py").exists()

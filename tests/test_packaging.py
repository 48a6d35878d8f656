"""What is installed is dnet and nothing else, with its typing marker and its linked folders."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    out = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", out, ROOT],
        check=True,
        capture_output=True,
    )
    (wheel,) = out.glob("*.whl")
    return zipfile.ZipFile(wheel).namelist()


def test_the_wheel_holds_only_dnet(names: list[str]) -> None:
    top = {name.split("/")[0] for name in names if ".dist-info/" not in name}
    assert top == {"dnet"}


def test_the_wheel_holds_every_module_of_the_tree(names: list[str]) -> None:
    inside = {
        f"dnet/{folder}{path.relative_to(base)}"
        for folder, base in (
            ("", ROOT / "dnet"),
            ("recorders/", ROOT / "recorders"),
            ("datasets/", ROOT / "datasets"),
            ("tools/", ROOT / "tools"),
        )
        for path in base.rglob("*.py")
    }
    assert inside <= set(names)
    assert "dnet/py.typed" in names
    assert "dnet/evaluation/report/page.html.j2" in names
    assert not [name for name in names if "test" in name.lower()]


def test_the_linked_folders_are_relative_links() -> None:
    for name in ("recorders", "datasets", "tools"):
        link = ROOT / "dnet" / name
        assert link.is_symlink()
        assert str(link.readlink()) == f"../{name}"
        assert not (link / "__init__.py").exists()

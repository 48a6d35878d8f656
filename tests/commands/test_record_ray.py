"""`dnet record` writes to an object store and records on Ray, or says what it lacks for that."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest

from dnet.cli import main
from tests.recording import cloud

SMALL = ["--pairs", "2", "--shapes", "1", "--points", "64", "--world", "quasistatic"]


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    with cloud.object_store() as url:
        yield url


def run(
    *arguments: object, without: str = "nothing", directory: Path
) -> "subprocess.CompletedProcess[str]":
    """Run the command as if a package were not installed."""
    script = (
        f"import sys; sys.modules[{without!r}] = None; from dnet.cli import main\n"
        "if __name__ == '__main__': main()"
    )
    return subprocess.run(
        [sys.executable, "-c", script, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=directory,
    )


def test_a_url_takes_what_a_folder_would(
    bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["record", f"{bucket}/data", *SMALL, "--workers", "2"])
    assert f"2 episodes with 2 shapes in {bucket}/data" in capsys.readouterr().out
    main(["record", str(tmp_path), *SMALL])
    files = fsspec.filesystem("s3")
    for path in [*tmp_path.glob("*.mcap"), tmp_path / "manifest.json"]:
        assert files.cat_file(f"{bucket}/data/{path.name}") == path.read_bytes()
    capsys.readouterr()
    main(["record", f"{bucket}/data", *SMALL])
    assert "nothing left to record" in capsys.readouterr().out


def test_a_cluster_for_one_recording_adds_nothing_to_what_is_printed(tmp_path: Path) -> None:
    here, ray = tmp_path / "here", tmp_path / "ray"
    ran = run("record", "ray", *SMALL, "--ray", "local", directory=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("2 episodes with 2 shapes in ray (")
    assert ran.stdout.count("\n") == 1
    assert "raylet" not in ran.stderr
    main(["record", str(here), *SMALL])
    for path in [*here.glob("*.mcap"), here / "manifest.json"]:
        assert (ray / path.name).read_bytes() == path.read_bytes()


def test_a_bucket_that_is_not_there_is_refused_before_anything_is_recorded(
    bucket: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["record", "s3://no-such-bucket/data", *SMALL])
    assert str(ended.value.code).startswith("dnet: s3://no-such-bucket/data fails: ")
    assert "bucket does not exist" in str(ended.value.code)
    assert not fsspec.filesystem("s3").exists("no-such-bucket")


def test_a_scheme_that_nobody_knows_is_refused() -> None:
    with pytest.raises(SystemExit) as ended:
        main(["record", "nowhere://bucket/data", *SMALL])
    assert "nowhere://bucket/data is no store that can be written to" in str(ended.value.code)


@pytest.mark.parametrize(
    ("without", "arguments"),
    [("s3fs", ["s3://bucket/data"]), ("ray", ["data", "--ray", "auto"])],
)
def test_a_missing_extra_is_named_with_how_to_install_it(
    tmp_path: Path, without: str, arguments: list[str]
) -> None:
    ran = run("record", *arguments, *SMALL, without=without, directory=tmp_path)
    assert ran.returncode == 1
    extra = {"s3fs": "s3", "ray": "ray"}[without]
    remedy = f'pip install "deformernet[{extra}]"'
    assert f"needs {without}, which is not installed; {remedy}" in ran.stderr
    assert "Traceback" not in ran.stderr

"""The command answers fast, teaches, and refuses in one line."""

import subprocess
import sys
from pathlib import Path

import pytest

from dnet.cli import COMMANDS, main


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Return the one line with which dnet refuses."""
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    message = caught.value.code
    assert isinstance(message, str), "SystemExit with a text prints it on stderr and exits with 1"
    assert message.startswith("dnet: ")
    assert "\n" not in message
    assert "Traceback" not in capsys.readouterr().err
    return message


def helped(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with pytest.raises(SystemExit) as caught:
        main([*arguments, "--help"])
    assert caught.value.code == 0
    return " ".join(capsys.readouterr().out.replace("│", " ").split())


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    text = helped(capsys)
    for name, command in COMMANDS.items():
        assert name in text
        assert (command.__doc__ or "").split("\n")[0] in text


@pytest.mark.parametrize(
    "path",
    [
        ["record"],
        ["train"],
        ["servo"],
        ["play"],
        ["inspect", "ls"],
        ["inspect", "info"],
        ["demo"],
        ["doctor"],
        ["reproduce"],
        ["evaluate", "servo"],
    ],
)
def test_the_help_of_every_command_teaches_it(
    capsys: pytest.CaptureFixture[str], path: list[str]
) -> None:
    text = helped(capsys, *path)
    assert f"Example: dnet {' '.join(path)}" in text
    assert "None" not in text.split("Example")[0]


def test_help_loads_nothing_heavy() -> None:
    """That is why it answers within a second; the clock itself would make a shaky test."""
    script = (
        "import sys\nfrom dnet.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'torch', 'pybullet', 'ompl', 'rerun', 'open3d', 'polars', 'numpy', 'scipy'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))"
    )
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert ran.stdout.strip().endswith("HEAVY []")


def test_the_installed_command_refuses_with_exit_code_1(tmp_path: Path) -> None:
    ran = subprocess.run(
        [Path(sys.executable).parent / "dnet", "record", tmp_path / "data", "--pairs", "0"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 1
    assert ran.stderr == "dnet: --pairs is 0, must be at least 1\n"
    assert ran.stdout == ""
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("option", ["--pairs", "--shapes", "--points"])
@pytest.mark.parametrize("count", [0, -3])
def test_recording_nothing_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, option: str, count: int
) -> None:
    message = refused(capsys, "record", tmp_path / "data", option, count)
    assert f"{option} is {count}, must be at least 1" in message


def test_recording_over_a_recording_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    kept = tmp_path / "episode-0-00000.mcap.part"
    kept.write_bytes(b"precious")
    message = refused(capsys, "record", tmp_path)
    assert "already holds 1 recordings, such as episode-0-00000.mcap.part" in message
    assert kept.read_bytes() == b"precious"


def test_recording_into_a_file_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "data"
    file.write_text("mine")
    assert "already holds a file" in refused(capsys, "record", file)
    assert file.read_text() == "mine"


def test_training_from_nowhere_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    gone, empty = tmp_path / "gone", tmp_path / "empty"
    empty.mkdir()
    out = tmp_path / "run"
    assert f"{gone} does not exist" in refused(capsys, "train", "--from-mcap", gone, "--out", out)
    message = refused(capsys, "train", "--from-mcap", empty, "--out", out)
    assert f"{empty} holds no .mcap episode" in message
    assert "dnet record" in message
    assert not out.exists()


def test_servoing_without_a_checkpoint_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    message = refused(
        capsys, "servo", "--checkpoint", tmp_path / "run", "--goal", "x.mcap", "--out", tmp_path
    )
    assert str(tmp_path / "run") in message


def test_servoing_over_a_run_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    kept = tmp_path / "run.rrd"
    kept.write_bytes(b"precious")
    message = refused(
        capsys, "servo", "--checkpoint", tmp_path, "--goal", "x.mcap", "--out", tmp_path
    )
    assert "already holds a run (run.rrd)" in message
    assert kept.read_bytes() == b"precious"


def test_servoing_needs_one_goal_or_a_directory_of_them(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for goals in ((), ("--goal", "random", "--goals", tmp_path)):
        message = refused(capsys, "servo", *goals, "--out", tmp_path / "run")
        assert message == "dnet: give either --goal or --goals, and not both"
    message = refused(capsys, "servo", "--goals", tmp_path, "--out", tmp_path / "run")
    assert f"{tmp_path} holds no goal" in message


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--steps", 0),
        ("--patience", -1),
        ("--waypoints", -1),
        ("--dropped", 1.5),
        ("--chamfer", -1),
    ],
)
def test_servoing_with_an_option_out_of_range_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, option: str, value: float
) -> None:
    message = refused(capsys, "servo", "--goal", "random", "--out", tmp_path, option, value)
    assert f"{option} is {value}" in message
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["info", "ls"])
def test_inspecting_what_is_not_there_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, command: str
) -> None:
    gone = tmp_path / "gone.mcap"
    assert f"{gone} does not exist" in refused(capsys, "inspect", command, gone)


def test_a_file_that_is_no_episode_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "notes.mcap"
    file.write_text("Dear diary, " * 100)
    for arguments in (("inspect", "info", file), ("play", file, "--save", tmp_path / "x.rrd")):
        assert str(file) in refused(capsys, *arguments)
    assert not (tmp_path / "x.rrd").exists()


def test_a_demo_over_another_demo_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "demo.json").write_text('{"options": {"pairs": 99}, "seconds": {}}')
    message = refused(capsys, "demo", "--out", tmp_path)
    assert "already holds a demo with other options ({'pairs': 99})" in message


def test_a_name_cannot_steer_the_terminal(tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as refused:
        main(["inspect", "info", str(tmp_path / "\x1b[2J.mcap")])
    assert str(refused.value.code).startswith("dnet: ")
    assert "\\x1b[2J.mcap does not exist" in str(refused.value.code)
    assert "\x1b" not in str(refused.value.code)

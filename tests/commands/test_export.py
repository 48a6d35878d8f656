"""`dnet export` writes a network that servo and Python can use in place of the checkpoint."""

import re
from pathlib import Path

import numpy as np
import pytest

import dnet
from dnet.cli import main
from dnet.nets.onnx_network import OnnxDeformerNet
from dnet.training.checkpoints import save
from tests.nets.test_deformernet import clouds
from tests.nets.test_onnx_network import MODEL
from tests.test_cli import helped, refused


def test_a_checkpoint_is_exported_and_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, out = tmp_path / "run", tmp_path / "a.onnx"
    save(run / "best.safetensors", MODEL)
    main(["export", "--checkpoint", str(run), "--out", str(out)])
    told = capsys.readouterr().out
    assert "12 pairs of random clouds" in told
    assert re.search(r"a prediction takes [\d.]+ ms, with PyTorch [\d.]+ ms", told)
    assert f"wrote {out} (5.9 MB)" in told
    network = dnet.load(out)
    assert isinstance(network, OnnxDeformerNet)
    current, goal = clouds(2)
    want = MODEL.predict(current, goal)
    np.testing.assert_allclose(network.predict(current, goal), want, atol=1e-5 * np.abs(want).max())

    message = refused(capsys, "export", "--checkpoint", run, "--out", out)
    assert f"{out} already holds a file" in message
    message = refused(capsys, "evaluate", "network", "--checkpoint", out, "--from-mcap", tmp_path)
    assert f"checkpoint {out} is not a whole safetensors file" in message


def test_a_file_of_another_kind_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    message = refused(capsys, "export", "--out", tmp_path / "a.pt")
    assert "a.pt ends in .pt, must end in .onnx" in message
    assert not list(tmp_path.iterdir())


def test_its_help_teaches_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert "Example: dnet export --checkpoint runs/paper --out paper.onnx" in helped(
        capsys, "export"
    )

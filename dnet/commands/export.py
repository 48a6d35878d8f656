"""`dnet export`: a trained network as an ONNX file."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Export:
    """Write a trained network as an ONNX file, proven to agree with the original.

    The file holds one graph: a batch of clouds with their neighbours and densities and the
    features of each one's goal go in, the features of the clouds and the motions to the goals, in
    metres, come out. `dnet servo --checkpoint OUT` and `dnet.load(OUT)` take it. It gets its name
    only if ONNX Runtime and PyTorch agree on a few random clouds to a hundred thousandth of the
    largest output. Needs deformernet[onnx].

    Example: dnet export --checkpoint runs/paper --out paper.onnx
    """

    out: Path
    """The new file, named *.onnx."""
    checkpoint: Path | None = None
    """Directory of `dnet train`, or one of its .safetensors files; the network that ships, unless
    given."""

    def run(self) -> None:
        """Export, compare, and print how far both are from each other and how fast they are.

        Raises:
            DnetError: If the checkpoint or the file will not do, a package is missing, or the
                exported network is not the original.
        """
        from dnet.errors import NotOnnx, OccupiedOutput
        from dnet.nets.onnx_agreement import LIMIT, seconds_a_prediction
        from dnet.training.checkpoints import load, read_metrics
        from dnet.training.onnx_files import SUFFIX, export
        from dnet.weights import DEFORMERNET

        if self.out.suffix != SUFFIX:
            raise NotOnnx(self.out)
        if self.out.exists():
            raise OccupiedOutput(self.out, "a file")
        checkpoint = self.checkpoint or DEFORMERNET
        model = load(checkpoint)
        exported, found = export(model, self.out, metrics=read_metrics(checkpoint))
        print(
            f"largest difference on {found.pairs} pairs of random clouds: {found.features:.1e} of "
            f"the features, {found.motion:.1e} of the motions ({LIMIT:.0e} is allowed)"
        )
        before, now = seconds_a_prediction(model), seconds_a_prediction(exported)
        print(f"a prediction takes {now * 1e3:.1f} ms, with PyTorch {before * 1e3:.1f} ms")
        print(f"wrote {self.out} ({self.out.stat().st_size / 1e6:.1f} MB)")

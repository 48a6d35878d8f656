"""Networks, their trainings and what these read."""

from pathlib import Path

from dnet.errors.root import DnetError


class BadCheckpoint(DnetError, ValueError):
    """A checkpoint that does not hold the network that was asked for."""

    def __init__(self, path: Path, why: str, hint: str) -> None:
        super().__init__(f"checkpoint {path} {why}; {hint}")


class NotOnnx(DnetError, ValueError):
    """A file to export to by whose name nobody could tell what it is."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"output {path} ends in {path.suffix or 'nothing'}, must end in .onnx")


class Disagreement(DnetError, ArithmeticError):
    """An exported network that is not the original."""

    def __init__(self, path: Path, got: float, limit: float) -> None:
        super().__init__(
            f"{path} was not written: the exported network differs from the original by {got:.1e} "
            f"of its largest output, {limit:.0e} is allowed; try another version of onnxruntime, "
            "or use the checkpoint itself"
        )


class BadTables(DnetError, RuntimeError):
    """Tables of clouds that went missing or are damaged while a training reads them."""

    def __init__(self, folder: Path, why: str) -> None:
        super().__init__(
            f"the tables of clouds in {folder}: {why}; remove that folder, it can be found anew, "
            "and run the same command again"
        )


class Uneven(DnetError, ValueError):
    """A batch that the processes of a training cannot share evenly."""

    def __init__(self, batch: int, processes: int) -> None:
        super().__init__(
            f"a batch of {batch} cannot be shared evenly by {processes} processes; "
            f"choose --groups that {processes} divides"
        )


class OtherStream(DnetError, ValueError):
    """A state of a loader that is not of this loader."""

    def __init__(self, what: str, got: object, want: object) -> None:
        super().__init__(
            f"the loader's {what} is {got}, that of the state to go on from is {want}; go on with "
            "the same data, seed and division, or begin anew"
        )

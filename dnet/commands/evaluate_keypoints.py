"""`dnet evaluate keypoints`: how good keypoints are, beside methods that learn nothing."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from dnet.datasets.index import Index
    from dnet.types import Place


@dataclass(frozen=True)
class EvaluateKeypoints:
    """Judge keypoints, and the manipulation points chosen by them, by the simulator's mesh.

    Cases go from the rest shape to a random shape of episodes that were held out of training.
    Alignment: from where a keypoint is put in the goal to where that point of the object is.
    Coverage: from a point of the cloud to the nearest keypoint. Resampled, and 1 mm noise: how much
    a displacement changes if both clouds are sampled anew, or have noise. Manipulation point: from
    the one chosen to the true one; by unmoved keypoints, the middle of what can be reached.

    Example: dnet evaluate keypoints --from-mcap data/paper --checkpoint runs/keypoints.safetensors
    """

    from_mcap: Annotated[str | Path, tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Episodes."""
    checkpoint: Path | None = None
    """Run of `dnet train --model keypoints`, or one of its files; the network that ships, unless
    given."""
    cases: int = 100
    """Pairs of a rest shape and a goal."""
    most: int = 20
    """Keypoints, those pulled out most, that a manipulation point is the mean of."""
    validation: float = 0.1
    """Share of the episodes that are held out, as in the training of the network; 1 for all."""
    seed: int = 0
    """Of the division into episodes to train on and to hold out, and of the cases."""
    drift: tyro.conf.FlagCreatePairsOff[bool] = False
    """Judge coherent point drift too, which takes seconds a case and needs pycpd."""

    def run(self) -> None:
        """Judge each method, with a progress bar, and print a table.

        Raises:
            DnetError: If the network or the episodes will not do.
        """
        from functools import partial

        import numpy as np
        from rich.console import Console
        from rich.markdown import Markdown

        from dnet.commands.index_bar import read_index
        from dnet.commands.progress import progress
        from dnet.datasets.stores import as_place
        from dnet.errors import TooFew
        from dnet.evaluation.keypoints import judge, read_cases, table_of
        from dnet.evaluation.registration import coherent, rigid, unmoved
        from dnet.nets.keypoints import KeypointNet
        from dnet.servo.displacement_heuristic import FindKeypoints
        from dnet.training.checkpoints import load_kind
        from dnet.weights import KEYPOINTS

        if self.cases < 1:
            raise TooFew("--cases", self.cases, 1)
        if self.most < 1:
            raise TooFew("--most", self.most, 1)
        methods: dict[str, FindKeypoints] = {"unmoved": unmoved, "rigid registration": rigid}
        if self.drift:
            methods["coherent point drift"] = coherent
        methods["learned"] = load_kind(self.checkpoint or KEYPOINTS, KeypointNet).keypoints
        console = Console(stderr=True)
        places = self._held_out(read_index(as_place(self.from_mcap), console))
        cases = list(read_cases(places, self.cases, random=np.random.default_rng(self.seed)))
        scores = {}
        with progress(console, "cases") as bar:
            for name, find in methods.items():
                task = bar.add_task(name, total=len(cases))
                scores[name] = judge(
                    find,
                    cases,
                    most=self.most,
                    random=np.random.default_rng(self.seed),
                    on_case=partial(bar.advance, task),
                )
        Console().print(Markdown(table_of(scores)))
        print(f"{len(cases)} cases from {len(places)} episodes, M = {self.most}")

    def _held_out(self, index: "Index") -> "list[Place]":
        from dnet.datasets.frame_table import settled_frames
        from dnet.datasets.split import split
        from dnet.datasets.stores import join

        table = settled_frames(index)
        usable = [n for n, length in enumerate(table.lengths.tolist()) if length > 1]
        ids = sorted(table.episodes[number] for number in usable)
        _, chosen = split(ids, fraction=self.validation, seed=self.seed)
        return [
            join(table.root, table.names[number])
            for number in usable
            if table.episodes[number] in chosen
        ]

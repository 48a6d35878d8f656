"""`dnet evaluate importance`: one goal from a good and from a bad manipulation point."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from dnet.commands.servo import Controller, ServoOptions


@dataclass(frozen=True)
class Importance:
    """Servo to one goal from a good and from a bad manipulation point, and show both.

    The good one is that at which the goal was made, unless --grasp names a method; the bad one is
    the reachable point farthest from the truth. OUT/good and OUT/bad are runs like those of
    `dnet servo`; OUT/importance.md compares them, and `dnet play OUT/good OUT/bad` shows them side
    by side. It is figure 2 of the paper. Stopped, the same call goes on.

    Example: dnet evaluate importance --goal data/episode-0-00001.mcap:7 --out importance
    """

    goal: Annotated[str, tyro.conf.arg(metavar="EPISODE[:FRAME]|random[:SEED]")]
    """Episode file and the number of the frame to reach, or a displacement drawn at random."""
    out: Path
    """Directory for the runs and the table."""
    controller: Controller = "deformernet"
    """What decides the motions."""
    options: tyro.conf.OmitArgPrefixes[ServoOptions] = field(default_factory=ServoOptions)

    def run(self) -> None:
        """Carry both runs out, and print the table.

        Raises:
            DnetError: If the goal, the network or the directory will not do.
        """
        from dataclasses import replace

        from rich.console import Console

        from dnet.commands.servo_batch import finish
        from dnet.evaluation.servo_table import servo_table
        from dnet.files.whole_file import write_whole

        plain = self.options.trial(self.goal, self.out, controller=self.controller)
        good = replace(plain, out=self.out / "good")
        bad = replace(plain, out=self.out / "bad", grasp="farthest")
        scores = finish([good, bad], jobs=1, what="servoing")
        names = (f"good ({good.grasp})", f"bad ({bad.grasp})")
        table = servo_table([(name, [score]) for name, score in zip(names, scores, strict=True)])
        write_whole(self.out / "importance.md", table.encode())
        print(table, end="")
        Console().print(
            f"see both with `dnet play {good.out} {bad.out}`", highlight=False, soft_wrap=True
        )

"""One round of everyday work: record in both worlds, check, train, servo in both worlds."""

from pathlib import Path
from typing import Literal

from dnet.commands.inspect_validate import Validate
from dnet.commands.record import Record
from dnet.commands.servo import Servo, ServoOptions
from dnet.commands.train import Train

POINTS = 512
"""Of each cloud: a quarter of the usual number, for more rounds an hour."""


def work(folder: Path, *, number: int) -> None:
    """Do what the commands do, in this process and, where they have workers, in children.

    Args:
        folder: For what is written; must not exist.
        number: Of the round: each is of other objects, weights and goals.

    Raises:
        KeyboardInterrupt: If it was stopped.
    """
    soft, bullet, network = folder / "quasistatic", folder / "bullet", folder / "network"
    Record(
        soft, pairs=3, shapes=4, seed=number, workers=2, points=POINTS, world="quasistatic",
        vary=True,
    ).run()  # fmt: skip
    Record(bullet, pairs=1, shapes=2, seed=number, points=POINTS, images=True).run()
    Validate((soft, bullet)).run()
    Train(soft, network, epochs=3, seed=number).run()
    worlds: dict[Literal["quasistatic", "bullet"], Path] = {"quasistatic": soft, "bullet": bullet}
    for world, data in worlds.items():
        options = ServoOptions(checkpoint=network, steps=2, world=world, seed=number)
        goal = data / f"episode-{number}-00000.mcap"
        Servo(folder / f"servo-{world}", goal=str(goal), options=options).run()

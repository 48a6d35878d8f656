"""How fast LeRobot reads the clouds of a dataset that was exported for it.

    cd tests; python -m benchmarks.lerobot_reader ROOT ROWS

Prints MB and random clouds a CPU-second as JSON. It runs in a Python of its own: LeRobot asks for
other versions of torch than dnet does.
"""

import json
import sys
from pathlib import Path
from typing import Any

from .pace import at_random, sequential


def main(root: str, rows: Path) -> None:
    """Measure and print."""
    from lerobot.datasets.lerobot_dataset import (  # noqa: PLC0415  # in its own Python alone
        LeRobotDataset,
    )

    dataset = LeRobotDataset("dnet/episodes", root=root)

    def cloud(row: int) -> Any:
        return dataset[row]["observation.cloud"].numpy()

    speeds = (
        sequential(lambda: (cloud(row) for row in range(len(dataset)))),
        at_random(cloud, json.loads(rows.read_text(encoding="utf-8"))),
    )
    print(json.dumps(speeds))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))

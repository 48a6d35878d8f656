"""A Bullet server keeps none of the files that it reads, and what it prints to itself."""

import os
import subprocess
import sys
from pathlib import Path

from dnet.sim.bullet import pybullet, start_server

PRINTING = """
import ctypes
from dnet.sim.bullet import quiet

with quiet():
    ctypes.CDLL(None).puts(b"Nodes: 405")
print("a result")
"""


def corners(path: Path, text: str) -> int:
    """Return how many corners Bullet finds in a surface, in a server of its own."""
    path.write_text(text)
    client = start_server()
    pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
    body = pybullet.loadSoftBody(str(path), physicsClientId=client)
    # Without the flag, those that it draws: a triangle does not share its own.
    flags = pybullet.MESH_DATA_SIMULATION_MESH
    count: int = pybullet.getMeshData(body, -1, flags=flags, physicsClientId=client)[0]
    pybullet.disconnect(physicsClientId=client)
    return count


def test_a_file_that_was_read_is_not_kept(tmp_path: Path) -> None:
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    square = triangle + "v 1 1 0\nf 2 4 3\n"
    path = tmp_path / "surface.obj"
    # Kept by its name, as PyBullet would have it, the second would be the first.
    assert (corners(path, triangle), corners(path, square)) == (3, 4)


def test_what_c_code_prints_goes_nowhere_though_it_prints_into_a_pipe() -> None:
    # Where this is set, C keeps nothing back.
    buffering = {name: text for name, text in os.environ.items() if name != "PYTHONUNBUFFERED"}
    printed = subprocess.run(
        [sys.executable, "-c", PRINTING],
        capture_output=True,
        text=True,
        check=True,
        env=buffering,
    )
    assert (printed.stdout, printed.stderr) == ("a result\n", "")

"""A Bullet server reads its files, and keeps none of them."""

from pathlib import Path

from dnet.sim.bullet import pybullet, start_server


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

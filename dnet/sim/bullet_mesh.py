"""Moving the nodes of a soft body of Bullet's without keeping what was handed over."""

from collections.abc import Sequence

from dnet.sim.bullet import pybullet

_HANDED: list[list[float]] = []
"""PyBullet never lets go of a list that it was given, nor of a row of it. All bodies of the process
use this one and its rows: a new one for each body, or for each call, would be a leak."""
_SPARE: list[list[float]] = []
"""Rows that a larger body will need again."""


def reset_nodes(body: int, positions: Sequence[Sequence[float]], *, client: int) -> None:
    """Put each node of a soft body somewhere, in metres."""
    while len(_HANDED) > len(positions):
        _SPARE.append(_HANDED.pop())
    while len(_HANDED) < len(positions):
        _HANDED.append(_SPARE.pop() if _SPARE else [])
    for row, position in zip(_HANDED, positions, strict=True):
        row[:] = position
    pybullet.resetMeshData(body, _HANDED, physicsClientId=client)

"""The parts of dnet and which imports which, drawn from the imports themselves.

    python -m tests.architecture

Writes docs/pictures/architecture.svg. A test fails if that file is not what the imports make.
"""

import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import grimp

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "pictures" / "architecture.svg"
WIDTH, HEIGHT, GAP, RISE = 118, 30, 14, 74
"""Of a box, between boxes, and from row to row, in pixels."""
COLOURS = ("#35608d", "#b9770e", "#4b8b5b", "#8d4b6f", "#5f6b75")
"""Of the arrows, by the row that they come from."""

Edge = tuple[str, str]


class Box(NamedTuple):
    """Where a part is drawn."""

    left: float
    top: float

    @property
    def middle(self) -> float:
        """Where arrows begin and end."""
        return self.left + WIDTH / 2


def layers() -> list[list[str]]:
    """Return the parts in rows, highest first, as the contract of pyproject.toml has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    (rows,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [[part.strip(" ()").removeprefix("dnet.") for part in row.split("|")] for row in rows]


def imports() -> set[Edge]:
    """Return which part imports which."""
    graph = grimp.build_graph("dnet", "dnet.recorders", "dnet.datasets", "dnet.tools")
    parts = {part for row in layers() for part in row}
    found = set()
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            one, other = (name.split(".")[1] for name in (f"{module}.", f"{imported}."))
            if one != other and {one, other} <= parts:
                found.add((one, other))
    return found


def reduced(edges: set[Edge]) -> set[Edge]:
    """Return the edges without those that follow from others."""

    def reaches(start: str, end: str) -> bool:
        return any(there == end or reaches(there, end) for here, there in edges if here == start)

    return {
        (one, other)
        for one, other in edges
        if not any(there != other and reaches(there, other) for here, there in edges if here == one)
    }


def picture(rows: Sequence[Sequence[str]], edges: set[Edge]) -> str:
    """Return the diagram as SVG: a row a layer, an arrow from a part to each that it needs."""
    widest = max(map(len, rows)) * (WIDTH + GAP)
    boxes: dict[str, Box] = {}
    level: dict[str, int] = {}
    for number, row in enumerate(rows):
        left = (widest - len(row) * (WIDTH + GAP) + GAP) / 2 + GAP
        for place, part in enumerate(row):
            boxes[part] = Box(left + place * (WIDTH + GAP), GAP + number * RISE)
            level[part] = number
    size = f"{widest + 2 * GAP:g} {(len(rows) - 1) * RISE + HEIGHT + 2 * GAP:g}"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" '
        'font-family="sans-serif" font-size="13" text-anchor="middle">',
        "<title>The parts of dnet; each imports those that its arrows lead to</title>",
        '<rect width="100%" height="100%" fill="#ffffff"/>',
        *(_arrow(boxes[one], boxes[other], level[one]) for one, other in sorted(edges)),
        *_boxes(boxes),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _arrow(one: Box, other: Box, level: int) -> str:
    begin, end = one.top + HEIGHT, other.top
    # An arrow past other rows swings aside, so that it is not hidden by their boxes.
    bend = (end - begin) / 2
    colour = COLOURS[level % len(COLOURS)]
    way = (
        f"M{one.middle:g} {begin:g} C{one.middle:g} {begin + bend:g} "
        f"{other.middle:g} {end - bend:g} {other.middle:g} {end - 5:g}"
    )
    tip = f"M{other.middle - 4:g} {end - 7:g} l4 7 l4 -7 z"
    return (
        f'<path d="{way}" fill="none" stroke="{colour}" stroke-width="1.3"/>'
        f'<path d="{tip}" fill="{colour}"/>'
    )


def _boxes(boxes: dict[str, Box]) -> Iterator[str]:
    for part, box in boxes.items():
        yield (
            f'<rect x="{box.left:g}" y="{box.top:g}" width="{WIDTH}" height="{HEIGHT}" rx="5" '
            'fill="#eef3f8" stroke="#35608d"/>'
            f'<text x="{box.middle:g}" y="{box.top + 20:g}" fill="#1f2d3a">{part}</text>'
        )


def main() -> None:
    """Draw the diagram."""
    PICTURE.write_text(picture(layers(), reduced(imports())), encoding="utf-8")
    print(f"wrote {PICTURE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()

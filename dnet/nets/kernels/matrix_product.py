"""The product of two matrices that lie in the cache, compiled."""

from typing import Any, no_type_check

import numpy as np

from dnet.compiled import compiled_part
from dnet.nets.kernels.lanes import LANES, at, load, multiply_add, spread, spread_from, store

ROWS = 4
"""What the rows of a product must be a multiple of."""

COLUMNS = 2 * LANES
"""What its columns must be a multiple of."""


@compiled_part
@no_type_check
def matrix_product(
    out: Any,
    step: int,
    left: Any,
    row_step: int,
    inner_step: int,
    right: Any,
    stride: int,
    shape: tuple[int, int, int],
) -> None:
    """Write the product of a matrix, either way round, and one whose rows lie together.

    Where a step is 1, say so with a literal: the product is then compiled for that.

    Args:
        out: Pointer to the product, (rows, columns).
        step: From one row of it to the next.
        left: Pointer to the first matrix, (rows, inner).
        row_step: From one row of it to the next.
        inner_step: From one column of it to the next.
        right: Pointer to the second one, (inner, columns).
        stride: From one row of it to the next.
        shape: Rows, inner and columns.
    """
    rows, inner, columns = shape
    for column in range(0, columns, COLUMNS):
        for row in range(0, rows, ROWS):
            # Four rows of sixteen columns: eight sums at once keep the multipliers busy.
            zero = spread(np.float32(0))
            a0, a1, a2, a3 = zero, zero, zero, zero
            b0, b1, b2, b3 = zero, zero, zero, zero
            here, there = at(left, row * row_step), at(right, column)
            for _ in range(inner):
                a, b = load(there, 0), load(there, LANES)
                factor = spread_from(here, 0)
                a0, b0 = multiply_add(factor, a, a0), multiply_add(factor, b, b0)
                factor = spread_from(here, row_step)
                a1, b1 = multiply_add(factor, a, a1), multiply_add(factor, b, b1)
                factor = spread_from(here, 2 * row_step)
                a2, b2 = multiply_add(factor, a, a2), multiply_add(factor, b, b2)
                factor = spread_from(here, 3 * row_step)
                a3, b3 = multiply_add(factor, a, a3), multiply_add(factor, b, b3)
                here, there = at(here, inner_step), at(there, stride)
            place = row * step + column
            store(out, place, a0)
            store(out, place + LANES, b0)
            store(out, place + step, a1)
            store(out, place + step + LANES, b1)
            store(out, place + 2 * step, a2)
            store(out, place + 2 * step + LANES, b2)
            store(out, place + 3 * step, a3)
            store(out, place + 3 * step + LANES, b3)

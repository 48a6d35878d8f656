"""Cholesky's factorisation of a sparse matrix within its envelope, compiled.

Each row of the lower triangle is kept from its first non-zero to the diagonal. Elimination fills
nothing outside of that (George and Liu 1981, Computer Solution of Large Sparse Positive Definite
Systems, chapter 4), and with nodes in the reverse Cuthill-McKee order it is narrow.
"""

from typing import NamedTuple, no_type_check

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array

from dnet.compiled import compiled


class Envelope(NamedTuple):
    """A lower triangular matrix, row by row from each row's first non-zero to the diagonal."""

    values: Float64[np.ndarray, "_"]
    start: Int64[np.ndarray, "_"]
    """Where in the values column 0 of a row would be: entry (i, j) is `values[start[i] + j]`."""
    first: Int64[np.ndarray, "_"]
    """The column of a row's first entry."""


def factorised(matrix: csr_array) -> Envelope:
    """Return L, with L L^T the given symmetric positive definite matrix."""
    size = matrix.shape[0]
    entries = matrix.tocoo()
    row, column = (axis.astype(np.int64) for axis in entries.coords)
    first = np.arange(size)
    np.minimum.at(first, row, column)
    ends = np.cumsum(np.arange(size) - first + 1)
    start = ends - np.arange(size) - 1
    values = np.zeros(ends[-1] if size else 0)
    lower = column <= row
    values[start[row[lower]] + column[lower]] = entries.data[lower]
    factor = Envelope(values, start, first)
    factorise(factor)
    return factor


@compiled
@no_type_check
def factorise(lower: Envelope) -> None:
    """Replace the lower triangle of a matrix by its Cholesky factor."""
    values, start, first = lower
    for i in range(first.shape[0]):
        for j in range(first[i], i + 1):
            done = 0.0
            for k in range(max(first[i], first[j]), j):
                done += values[start[i] + k] * values[start[j] + k]
            rest = values[start[i] + j] - done
            if j < i:
                values[start[i] + j] = rest / values[start[j] + j]
            else:
                values[start[i] + i] = np.sqrt(rest)


@compiled
@no_type_check
def solve(factor: Envelope, right: Float64[np.ndarray, "3 _"]) -> None:
    """Replace three right-hand sides b by the x of L L^T x = b."""
    values, start, first = factor
    x, y, z = right[0], right[1], right[2]
    for i in range(first.shape[0]):
        row = start[i]
        a, b, c = 0.0, 0.0, 0.0
        for k in range(first[i], i):
            entry = values[row + k]
            a += entry * x[k]
            b += entry * y[k]
            c += entry * z[k]
        diagonal = values[row + i]
        x[i] = (x[i] - a) / diagonal
        y[i] = (y[i] - b) / diagonal
        z[i] = (z[i] - c) / diagonal
    for i in range(first.shape[0] - 1, -1, -1):
        row = start[i]
        diagonal = values[row + i]
        x[i] /= diagonal
        y[i] /= diagonal
        z[i] /= diagonal
        a, b, c = x[i], y[i], z[i]
        for k in range(first[i], i):
            entry = values[row + k]
            x[k] -= entry * a
            y[k] -= entry * b
            z[k] -= entry * c

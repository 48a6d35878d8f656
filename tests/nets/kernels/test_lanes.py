"""Kernels in eights compute what numpy computes."""

from typing import no_type_check

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.compiled import compiled
from dnet.nets.kernels.lanes import (
    add,
    at,
    load,
    multiply,
    multiply_add,
    spread,
    spread_from,
    store,
    subtract,
    sum_of,
    transpose,
    where_positive,
)
from dnet.nets.kernels.matrix_product import matrix_product


@compiled
@no_type_check
def compute(out, a, b):
    x, y = load(a, 0), load(at(b, 1), -1)
    store(out, 0, add(x, y))
    store(out, 8, subtract(x, y))
    store(out, 16, multiply(x, y))
    store(out, 24, multiply_add(x, y, spread(np.float32(0.5))))
    store(out, 32, where_positive(x, y))
    store(at(out, 32), 8, spread_from(a, 3))
    return sum_of(x)


@compiled
@no_type_check
def turn(out, step, a, stride):
    transpose(at(out, 0), step, at(a, 0), stride)


@compiled
@no_type_check
def product(out, left, right, turned):
    inner, columns = right.shape
    shape = (out.shape[0], inner, columns)
    target, source = at(out, 0), at(right, 0)
    if turned:
        matrix_product(target, columns, at(left, 0), 1, out.shape[0], source, columns, shape)
    else:
        matrix_product(target, columns, at(left, 0), inner, 1, source, columns, shape)


def numbers(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_each_operation_is_applied_to_eight_numbers(seed: int) -> None:
    a, b = numbers(seed, 8), numbers(seed + 1, 8)
    out = np.zeros((6, 8), np.float32)
    total = compute(out, a, b)
    want = [a + b, a - b, a * b, a * b + 0.5, np.where(a > 0, b, 0), np.full(8, a[3])]
    np.testing.assert_allclose(out, want, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(total, a.sum(), rtol=1e-5, atol=1e-5)


def test_what_is_no_number_passes_as_through_relu_of_torch() -> None:
    a = np.array([np.nan, -1, 0, -0.0, 1, np.inf, -np.inf, np.nan], np.float32)
    out = np.zeros((6, 8), np.float32)
    compute(out, a, np.arange(8, dtype=np.float32))
    np.testing.assert_array_equal(out[4], [0, 0, 0, 0, 4, 5, 0, 7])


@given(seed=st.integers(0, 2**32 - 1), step=st.integers(8, 20), stride=st.integers(8, 20))
@settings(max_examples=20, deadline=None)
def test_eight_rows_become_eight_columns(seed: int, step: int, stride: int) -> None:
    a, out = numbers(seed, 8, stride), np.zeros((8, step), np.float32)
    turn(out, step, a, stride)
    np.testing.assert_array_equal(out[:, :8], a[:, :8].T)
    assert not out[:, 8:].any()


@pytest.mark.parametrize("turned", [True, False])
@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 5),
    inner=st.integers(0, 40),
    columns=st.integers(1, 3),
)
@settings(max_examples=20, deadline=None)
def test_a_product_is_that_of_numpy_either_way_round(
    turned: bool, seed: int, rows: int, inner: int, columns: int
) -> None:
    left, right = numbers(seed, 4 * rows, inner), numbers(seed + 1, inner, 16 * columns)
    out = numbers(seed, 4 * rows, 16 * columns)
    product(out, np.ascontiguousarray(left.T) if turned else left, right, turned)
    np.testing.assert_allclose(out, left @ right, rtol=1e-4, atol=1e-4)

"""The factorisation within the envelope solves as a dense one does."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array

from dnet.sim.envelope import factorised, solve


@settings(max_examples=50, deadline=None)
@given(size=st.integers(1, 40), links=st.integers(0, 80), seed=st.integers(0, 2**32 - 1))
def test_it_solves_any_network_of_springs(size: int, links: int, seed: int) -> None:
    """A graph's Laplacian plus a little of the identity: positive definite, sparse, any order."""
    random = np.random.default_rng(seed)
    matrix = np.eye(size) * random.uniform(0.01, 1.0, size)
    for i, j in random.integers(size, size=(links, 2)):
        stiffness = random.uniform(0.1, 10.0)
        matrix[[i, j], [i, j]] += stiffness
        matrix[[i, j], [j, i]] -= stiffness
    right = random.normal(size=(3, size))
    solution = right.copy()
    solve(factorised(csr_array(matrix)), solution)
    np.testing.assert_allclose(matrix @ solution.T, right.T, atol=1e-9)


def test_nothing_outside_of_the_envelope_is_kept() -> None:
    chain = 2 * np.eye(100) - np.eye(100, k=1) - np.eye(100, k=-1)
    assert len(factorised(csr_array(chain)).values) == 2 * 100 - 1

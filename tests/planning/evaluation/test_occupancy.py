from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.sparse import csr_array

from lcorpp.planning.evaluation.occupancy import solve_gmres, solve_lu


@given(st.integers(1, 40), st.sampled_from([0.5, 0.95, 0.9999]), st.integers(0, 10**6))
@settings(max_examples=30)
def test_gmres_and_lu_agree_with_the_dense_solution(n, gamma, seed):
    rng = np.random.default_rng(seed)
    moves = rng.dirichlet(np.ones(n), size=n) * (rng.random((n, n)) < 0.3)
    begin = np.eye(n)[0]
    exact = np.linalg.solve(np.eye(n) - gamma * moves.T, begin)
    inner = csr_array(gamma * moves.T)
    assert solve_gmres(inner, begin) == pytest.approx(exact, rel=1e-7, abs=1e-9)
    assert solve_lu(inner, begin) == pytest.approx(exact, rel=1e-9, abs=1e-12)


def test_a_path_is_solved_in_one_sweep():
    n, gamma = 5_000, 0.999
    inner = csr_array((np.full(n - 1, gamma), (np.arange(1, n), np.arange(n - 1))), shape=(n, n))
    found = solve_gmres(inner, np.eye(1, n)[0])
    assert found == pytest.approx(gamma ** np.arange(n), rel=1e-9)

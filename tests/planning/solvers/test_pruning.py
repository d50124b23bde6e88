from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import linprog

from lcorpp.planning.solvers.exact.dominance_lp import DeadlineExceeded, dominance_margins
from lcorpp.planning.solvers.exact.pruning import excess, prune

NO_BELIEFS = np.empty((0, 2))

sets = st.integers(1, 4).flatmap(
    lambda states: arrays(
        np.float64, st.tuples(st.integers(1, 12), st.just(states)), elements=st.integers(-9, 9)
    )
)


def grid(states: int) -> np.ndarray:
    """Beliefs in steps of a sixth."""
    parts = np.stack(np.meshgrid(*[np.arange(7)] * states), axis=-1).reshape(-1, states)
    return parts[parts.sum(axis=1) == 6] / 6


def test_the_margin_of_a_line_above_two():
    # max(b0, b1) is lowest at the middle, where 0.6 is above it by a tenth
    margin = dominance_margins(np.array([[0.6, 0.6], [0.4, 0.4]]), np.eye(2), np.eye(2), tolerance=0.0)
    assert margin.beliefs[0] == pytest.approx([0.5, 0.5])
    assert margin.lower[0] == pytest.approx(0.1)
    assert margin.upper[0] == pytest.approx(0.1)
    assert margin.upper[1] == pytest.approx(-0.1)


def test_dominated_vectors_are_dropped():
    vectors = np.array([[1, 0], [0, 1], [0.4, 0.4], [0.6, 0.6], [-1, -1], [1, 0]])
    kept = prune(vectors, NO_BELIEFS, tolerance=1e-9)
    assert {tuple(row) for row in vectors[kept.rows]} == {(1, 0), (0, 1), (0.6, 0.6)}
    assert len(kept.rows) == 3
    assert kept.loss <= 1e-9


def test_a_mixture_alone_can_dominate():
    # at every belief one of the first two is better than the third, though neither is everywhere
    vectors = np.array([[1.0, 0], [0, 1], [0.49, 0.49]])
    assert sorted(prune(vectors, NO_BELIEFS, tolerance=1e-9).rows) == [0, 1]


def test_the_loss_is_reported():
    vectors = np.array([[1.0, 0], [0, 1], [0.55, 0.55]])
    kept = prune(vectors, NO_BELIEFS, tolerance=0.06)
    assert sorted(kept.rows) == [0, 1]
    assert kept.loss == pytest.approx(0.05)


@given(sets, st.sampled_from([1e-9, 0.3]))
@settings(max_examples=20)
def test_no_belief_loses_more_than_the_reported_loss(vectors, tolerance):
    kept = prune(vectors, np.empty((0, vectors.shape[1])), tolerance=tolerance)
    beliefs = grid(vectors.shape[1])
    lost = (beliefs @ vectors.T).max(axis=1) - (beliefs @ vectors[kept.rows].T).max(axis=1)
    assert lost.max() <= kept.loss + 1e-12  # the rounding of the products
    assert kept.loss <= tolerance
    assert len(set(kept.rows.tolist())) == len(kept.rows)


@given(sets)
@settings(max_examples=20)
def test_every_kept_vector_is_needed(vectors):
    """Without any one of the kept vectors, some belief has a loss."""
    kept = prune(vectors, np.empty((0, vectors.shape[1])), tolerance=1e-9)
    if len(kept.rows) > 1:
        chosen = vectors[kept.rows]
        for k in range(len(chosen)):
            others = np.delete(chosen, k, axis=0)
            margin = dominance_margins(chosen[k : k + 1], others, kept.witnesses, tolerance=0.0)
            assert margin.lower[0] > 0


@given(sets, sets)
@settings(max_examples=10)
def test_excess_is_a_bound_and_close(left, right):
    states = min(left.shape[1], right.shape[1])
    left, right = left[:, :states], right[:, :states]
    beliefs = grid(states)
    found = excess(left, right, np.empty((0, states)), tolerance=1e-6)
    seen = ((beliefs @ left.T).max(axis=1) - (beliefs @ right.T).max(axis=1)).max()
    assert found >= max(0.0, seen) - 1e-12
    exact = max(solve_margin(vector, right) for vector in left)
    assert max(0.0, exact) - 1e-9 <= found <= 1.1 * max(0.0, exact) + 1e-5


def solve_margin(vector, others):
    """Return how far a vector exceeds the others at any belief, by scipy's linear programming."""
    states = len(vector)
    above = np.column_stack([others - vector, np.ones(len(others))])  # margin <= (vector - other).b
    found = linprog(
        [*np.zeros(states), -1.0], A_ub=above, b_ub=np.zeros(len(others)),
        A_eq=[[*np.ones(states), 0.0]], b_eq=[1.0], bounds=[(0, 1)] * states + [(None, None)],
    )  # fmt: skip
    return -found.fun


def test_a_deadline_in_the_past():
    rng = np.random.default_rng(0)
    with pytest.raises(DeadlineExceeded):
        prune(rng.random((50, 4)), np.empty((0, 4)), tolerance=1e-9, deadline=0.0)

from __future__ import annotations

from time import monotonic

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.planning import Pomdp, solve
from lcorpp.planning.sarsop.bounds import blind_policies, fast_informed_bound, mdp_bound
from lcorpp.planning.sarsop.dynamics import Dynamics
from lcorpp.planning.sarsop.lower import AlphaVectors
from lcorpp.planning.sarsop.upper import Sawtooth
from tests.planning.models import pomdps


def ring(size: int) -> Pomdp:
    """A ring with a goal at 0, steps that may fail and the parity of the place seen; sparse when long."""
    step = 0.9 * np.roll(np.eye(size), 1, axis=1) + 0.1 * np.eye(size)
    parity = np.eye(2)[np.arange(size) % 2]
    reward = np.zeros((2, size))
    reward[:, 0] = 1.0
    return Pomdp(
        tuple(f"s{i}" for i in range(size)),
        ("on", "back"),
        ("even", "odd"),
        np.array([step, step.T]),
        np.array([parity, parity]),
        reward,
        0.9,
        np.full(size, 1 / size),
    )


@pytest.mark.parametrize(("size", "sparse"), [(10, False), (80, True)])
def test_initial_bounds_in_both_memory_orders(size, sparse):
    pomdp = ring(size)
    dynamics = Dynamics(pomdp)
    assert dynamics.is_sparse is sparse
    blind, Q = blind_policies(dynamics), mdp_bound(dynamics)
    again = pomdp.reward + 0.9 * np.einsum("ast,at->as", pomdp.transition, blind)
    assert blind == pytest.approx(again)
    value = np.zeros(size)
    for _ in range(500):
        value = (pomdp.reward + 0.9 * pomdp.transition @ value).max(axis=0)
    assert Q.max(axis=0) == pytest.approx(value)
    assert (Q.max(axis=0) >= value - 1e-12).all()
    informed = fast_informed_bound(dynamics, Q, tolerance=1e-9, deadline=monotonic() + 60)
    assert (informed <= Q).all()
    assert (informed >= blind.max(axis=0) - 0.2).all()  # one wrong step costs at most a tenth twice


def test_a_sparse_model_is_solved():
    solution = solve(ring(80), precision=0.05, time_limit=5)
    assert solution.lower <= solution.upper <= solution.history[0][2]


@given(pomdps())
@settings(max_examples=25, deadline=None)
def test_the_informed_bound_is_between_lower_bound_and_mdp(pomdp):
    dynamics = Dynamics(pomdp)
    Q = mdp_bound(dynamics)
    informed = fast_informed_bound(dynamics, Q, tolerance=1e-6, deadline=monotonic() + 5)
    assert (informed <= Q + 1e-9).all()
    assert (informed.max(axis=0) >= blind_policies(dynamics).max(axis=0) - 1e-9).all()


def test_sawtooth_by_hand():
    sawtooth = Sawtooth(np.array([[10.0, 0.0], [0.0, 10.0]]))
    assert sawtooth.value(np.array([0.5, 0.5])) == 5  # the informed planes, below the corners' 10
    stamp = sawtooth.add(np.array([0.5, 0.5]), 2.0)
    # at (.75, .25): phi = .5, so 10 + .5 * (2 - 10)
    assert sawtooth.value(np.array([0.75, 0.25])) == 6
    assert sawtooth.value(np.array([1.0, 0.0])) == 10  # the point's support is not inside the corner
    assert sawtooth.bound(np.array([[1.5, 0.5]])).tolist() == [12]  # homogeneous
    assert sawtooth.add(np.array([1.0, 0.0]), 6.0) == -1
    # the corners' plane is 9 at (.75, .25) less 2: 7 + .5 * (2 - 8)
    assert sawtooth.value(np.array([0.75, 0.25])) == 4
    sawtooth.drop({stamp})
    assert sawtooth.value(np.array([0.5, 0.5])) == 5


def test_stamps_outlive_pruning():
    alphas = AlphaVectors(np.eye(3), np.array([0, 1, 2]))
    for i in range(100):
        alphas.add(np.full(3, float(i)), i % 3)
    alphas.keep(alphas.stamps % 2 == 0)
    assert alphas.rows(np.array([0, 1, 2, 102])).tolist() == [0, -1, 1, 51]
    assert alphas.vectors[alphas.first_since(101)].tolist() == [99.0, 99.0, 99.0]
    assert alphas.value(np.array([1.0, 0, 0])) == 99

"""Blocks, belief updates and the three initial bounds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import Pomdp, _native, observation_probabilities, parse_pomdp, update
from lcorpp.planning.sarsop.kernel_model import build_model
from tests.planning.models import TIGER, pomdps
from tests.planning.sarsop.kernels import bounds, make_tree, random_model, random_models
from tests.planning.sarsop.reference import initial_bounds

models = pomdps() | random_models()


def ring(size: int) -> Pomdp:
    """A ring with a goal at 0, steps that may fail and observed parity."""
    step = 0.9 * np.roll(np.eye(size), 1, axis=1) + 0.1 * np.eye(size)
    parity = np.eye(2)[np.arange(size) % 2]
    reward = np.zeros((2, size))
    reward[:, 0] = 1.0
    names = tuple(f"s{i}" for i in range(size))
    table, seen = np.array([step, step.T]), np.array([parity, parity])
    return Pomdp(names, ("on", "back"), ("even", "odd"), table, seen, reward, 0.9, np.full(size, 1 / size))


def blocks_by_definition(pomdp: Pomdp) -> list[int]:
    """Merge the blocks of states that one action reaches and one observation follows."""
    block = list(range(len(pomdp.states)))
    for a in range(len(pomdp.actions)):
        reached = pomdp.transition[a].max(axis=0) > 0
        for o in range(len(pomdp.observations)):
            together = {block[s] for s in np.flatnonzero(reached & (pomdp.observation[a][:, o] > 0))}
            block = [min(together) if b in together else b for b in block]
    return [sorted(set(block)).index(b) for b in block]


@given(pomdp=models)
@settings(max_examples=20)
def test_blocks_agree_with_their_definition(pomdp):
    assert build_model(pomdp).export_blocks().tolist() == blocks_by_definition(pomdp)


def test_blocks_of_known_models():
    assert build_model(ring(6)).export_blocks().tolist() == [0, 1, 0, 1, 0, 1]
    assert build_model(parse_pomdp(TIGER)).export_blocks().tolist() == [0, 0]
    blocks = build_model(random_model(1, seen=4, hidden=3)).export_blocks()
    assert set(blocks.tolist()) == {0, 1, 2, 3}


@given(pomdp=models)
@settings(max_examples=15)
def test_children_follow_bayes_rule(pomdp):
    tree, _, _ = make_tree(pomdp)
    root = tree.find_or_add_node(pomdp.start)
    assert tree.belief(root) == pytest.approx(pomdp.start)
    assert tree.expected_rewards(root) == pytest.approx(pomdp.reward @ pomdp.start)
    tree.refresh(root)
    action = tree.select_action(root, False)
    observation, probability, _, _, link = tree.children(root, action)
    expected = observation_probabilities(pomdp, pomdp.start, action)
    assert observation.tolist() == np.flatnonzero(expected).tolist()
    assert probability == pytest.approx(expected[observation])
    assert (link == -1).all()
    for k, o in enumerate(observation.tolist()):
        child = tree.find_or_add_child(root, action, k)
        assert tree.belief(child) == pytest.approx(update(pomdp, pomdp.start, action, o))
        assert tree.find_or_add_child(root, action, k) == child


@given(pomdp=models)
@settings(max_examples=12)
def test_bounds_are_ordered_and_close_to_their_equations(pomdp):
    blind, above, informed = bounds(build_model(pomdp), tolerance=1e-6)
    exact, mdp, fixed_point = initial_bounds(pomdp, sweeps=1000)  # .97^1000 is 1e-13
    rounding = 1e-9 * max(1.0, float(np.abs(mdp).max()))
    assert (blind <= exact + rounding).all()
    assert (blind >= exact - 1.1e-6).all()
    for found, limit in ((above, mdp), (informed, fixed_point)):
        assert (found >= limit - rounding).all()
        assert (found <= limit + 1.1e-6).all()
    assert (informed <= above).all()
    assert (informed.max(axis=0) >= blind.max(axis=0) - 1e-9).all()


@given(pomdp=models)
@settings(max_examples=10)
def test_more_sweeps_are_never_worse(pomdp):
    """Every sweep yields a bound that is at least as tight as the one before."""
    model = build_model(pomdp)
    rounding = 1e-9 * max(1.0, float(np.abs(pomdp.reward).max()))
    ladder = [(1e9, 0.0), (1.0, 60.0), (1e-2, 60.0), (1e-4, 60.0)]
    blind = [_native.blind_policies(model, *limits) for limits in ladder]
    above = [_native.mdp_bound(model, *limits) for limits in ladder]
    start = above[0]
    informed = [start, *(_native.fast_informed_bound(model, start, *limits) for limits in ladder)]
    assert informed[1].tolist() == start.tolist()  # no time, no sweep
    for worse, better in pairwise(blind):
        assert (better >= worse - rounding).all()
    for bound in (above, informed):
        for worse, better in pairwise(bound):
            assert (better <= worse + rounding).all()
    assert (blind[-1].max(axis=0) <= informed[-1].max(axis=0) + rounding).all()


def test_a_slow_discount_takes_few_sweeps():
    """All values change by similar amounts: the shift replaces 1 / (1 - gamma) sweeps."""
    n = 30
    T = np.full((2, n, n), 1 / n)
    reward = np.linspace(-1, 1, 2 * n).reshape(2, n)
    names = tuple(map(str, range(n)))
    pomdp = Pomdp(names, ("a", "b"), ("o",), T, np.ones((2, n, 1)), reward, 1 - 1e-9, np.full(n, 1 / n))
    # without the shift, the sweeps would not converge within the time of any test
    blind, above, informed = bounds(build_model(pomdp), tolerance=1.0)
    best = reward[1].mean() * 1e9
    assert blind[1].mean() == pytest.approx(best, rel=1e-6)
    assert (above.max(axis=0) >= best).all()
    assert informed.max(axis=0) == pytest.approx(best, rel=1e-6)


def test_rows_that_miss_one_by_rounding_do_not_cross_the_bounds():
    """Nine digits of a third: over an infinite horizon, the missing probability would exceed the gap."""
    third = np.full((2, 3, 3), 0.333333333)
    reward = np.array([[1.0, 1, 1], [0, 0, 0]])
    names = ("a", "b", "c")
    pomdp = Pomdp(names, ("x", "y"), ("o",), third, np.ones((2, 3, 1)), reward, 0.999, np.full(3, 1 / 3))
    blind, above, informed = bounds(build_model(pomdp), tolerance=1e-9)
    assert blind[0] == pytest.approx(1000, abs=1e-6)
    assert (blind.max(axis=0) <= informed.max(axis=0) + 1e-9).all()
    assert above.max() == pytest.approx(1000, abs=1e-6)


@given(st.integers(0, 10**6))
@settings(max_examples=6)
def test_vectors_are_stored_by_block(seed):
    """An observed state is a block of its own."""
    pomdp = random_model(seed, seen=5, hidden=1, signals=1)
    tree, _, _ = make_tree(pomdp)
    assert tree.group_count == 6
    assert [tree.vectors(g)[1].shape for g in range(6)] == [(2, 1)] * 5 + [(2, 5)]

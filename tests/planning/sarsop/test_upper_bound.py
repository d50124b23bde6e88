"""The upper bound: points, sawtooth interpolation, and the bound without its tree."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import Pomdp, _native, parse_pomdp
from lcorpp.planning.sarsop.kernel_model import build_model
from lcorpp.planning.upper_bounds import SawtoothBound
from tests.planning.models import TIGER
from tests.planning.sarsop.kernels import close, make_tree, random_models, search


def sawtooth_by_hand() -> tuple[Any, Any]:
    """A tree whose informed bound is 10 in each of two states, by different actions."""
    tiger = parse_pomdp(TIGER)
    model = build_model(tiger)
    informed = np.array([[10.0, 0], [0, 10], [0, 0]])
    return _native.Tree(model, informed, np.full((3, 2), -100.0)), informed


def point(*weights: float) -> tuple[Any, Any, Any]:
    inside = np.flatnonzero(weights)
    return np.array([0, len(inside)]), inside.astype(np.int32), np.array(weights)[inside]


def test_the_sawtooth_by_hand():
    tree, informed = sawtooth_by_hand()
    even, uneven, sure = (tree.find_or_add_node(np.array(b)) for b in ([0.5, 0.5], [0.75, 0.25], [1.0, 0.0]))
    assert tree.upper_bound(even) == 5  # the informed planes, below the corners' 10
    assert tree.upper_bound(uneven) == 7.5
    tree.add_points(*point(0.5, 0.5), np.array([2.0]))
    # at (.75, .25): phi = .5, so 10 + .5 * (2 - 10)
    assert [tree.upper_bound(node) for node in (even, uneven, sure)] == [2, 6, 10]
    tree.add_points(*point(1, 0), np.array([6.0]))
    assert tree.point_count == 1  # the second became a corner
    # an updated node considers only the newer corner: 7 at (.75, .25), above its bound
    assert [tree.upper_bound(node) for node in (even, uneven, sure)] == [2, 6, 6]
    # a new node considers both: the corners' plane is 7.6, so 7.6 + .8 * (2 - 8)
    assert tree.upper_bound(tree.find_or_add_node(np.array([0.6, 0.4]))) == pytest.approx(2.8, abs=1e-12)
    corners, begins, states, weights, values = tree.points()
    assert (corners.tolist(), begins.tolist(), states.tolist()) == ([6, 10], [0, 2], [0, 1])
    assert (weights.tolist(), values.tolist()) == ([0.5, 0.5], [2])
    bound = SawtoothBound(informed, *tree.points())
    assert [bound.value(np.array(b)) for b in ([0.5, 0.5], [0.75, 0.25], [1.0, 0], [0, 1.0])] == [2, 4, 6, 10]


@given(pomdp=random_models(), seed=st.integers(0, 1000))
@settings(max_examples=7)
def test_the_upper_bound_outlives_its_tree(pomdp, seed):
    tree, predictor, informed = make_tree(pomdp)
    search(tree, predictor, tree.find_or_add_node(pomdp.start), 5)
    bound = SawtoothBound(informed, *tree.points())
    again = pickle.loads(pickle.dumps(bound))
    heir, _, _ = make_tree(pomdp)
    heir.add_points(*bound.points())
    blocks = build_model(pomdp).export_blocks()
    slack = 1e-9 * max(1.0, float(np.abs(informed).max()))
    sampled = np.random.default_rng(seed).dirichlet(np.ones(len(pomdp.states)), size=5)
    for belief in [*sampled, *map(tree.belief, range(tree.node_count))]:
        value = bound.value(belief)
        assert value == again.value(belief)
        assert tree.lower_bound(tree.find_or_add_node(belief)) - slack <= value <= (informed @ belief).max()
        if len(set(blocks[belief > 0].tolist())) == 1:
            # the tree considers the points of the block, the bound all points, of which others have no effect
            assert heir.upper_bound(heir.find_or_add_node(belief)) == close(value)


def test_nearly_equal_beliefs_share_a_node_but_not_its_bound():
    """The value of a belief that differs in the eleventh digit may be larger, by the Lipschitz slack."""
    T = np.array([[[0, 0.3, 0.7], [0, 1, 0], [0, 0, 1]]])
    worth = np.array([0.9 * 0.7, 0, 1]) * 1e6
    reward = np.array([[0.0, 0, 1e5]])
    pomdp = Pomdp(("s", "t", "u"), ("go",), ("o",), T, np.ones((1, 3, 1)), reward, 0.9, np.array([1.0, 0, 0]))
    tree = _native.Tree(build_model(pomdp), worth[None] + 1, worth[None])
    near = np.array([0, 0.3 + 4e-11, 0.7 - 4e-11])
    tree.add_points(*point(*near), np.array([float(near @ worth)]))
    first = tree.find_or_add_node(near)
    root = tree.find_or_add_node(pomdp.start)
    tree.select_action(root, False)
    assert tree.find_or_add_child(root, 0, 0) == first
    tree.add_points(*point(0, 0.5, 0.5), np.array([0.5e6 + 1]))  # a new point, so that the root is updated
    tree.select_action(root, False)
    assert worth[0] - 1e-9 <= tree.q_upper(root)[0] <= worth[0] + 1e-3


def flat_tree(states: int) -> _native.Tree:
    """A tree without effect of its only action, whose upper bound is 10 everywhere."""
    names = tuple(f"s{i}" for i in range(states))
    rows, seen = np.eye(states)[None], np.ones((1, states, 1))
    start = np.full(states, 1 / states)
    pomdp = Pomdp(names, ("wait",), ("o",), rows, seen, np.zeros((1, states)), 0.9, start)
    return _native.Tree(build_model(pomdp), np.full((1, states), 10.0), np.zeros((1, states)))


def test_removed_points_have_no_effect():
    tree = flat_tree(4)
    pairs = [(k % 4, (k + 1) % 4) for k in range(40)]
    states = np.sort(np.array(pairs, dtype=np.int32)).ravel()
    # each half of the points has another lowest value: 0, later 5
    values = np.concatenate([np.arange(20) % 7, 5 + np.arange(20) % 3]).astype(float)
    tree.add_points(np.arange(41, dtype=np.int64) * 2, states, np.full(80, 0.5), values)
    even = np.full(4, 0.25)
    assert tree.upper_bound(tree.find_or_add_node(even)) == pytest.approx(5)  # half of 10 and of 0
    tree.drop_older_points()
    tree.clear_nodes()
    assert tree.point_count == 20
    assert tree.upper_bound(tree.find_or_add_node(even)) == pytest.approx(7.5)
    tree.add_points(*point(1, 0, 0, 0), np.array([6.0]))  # lowers the plane of the corners
    tree.clear_nodes()
    corners, _, _, _, values = tree.points()
    assert (corners.tolist(), values.tolist()) == ([6, 10, 10, 10], (5 + np.arange(20) % 3).tolist())
    # the best point is between corners of 10: the plane is 9, half of the excess of -5 lowers it
    assert tree.upper_bound(tree.find_or_add_node(even)) == pytest.approx(6.5)


def test_a_subnormal_weight_is_support():
    """1 / p overflows; the point must not count at beliefs without that state."""
    tree = flat_tree(3)
    tree.add_points(*point(1 - 1e-16, 1e-310, 0), np.array([0.0]))
    for state in range(3):
        assert tree.upper_bound(tree.find_or_add_node(np.eye(3)[state])) == 10

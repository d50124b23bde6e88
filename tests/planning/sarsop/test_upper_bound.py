"""The upper bound: points, sawtooth interpolation, and the bound without its tree."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import Pomdp, parse_pomdp
from lcorpp.planning.sarsop.kernels import build_model
from lcorpp.planning.sarsop.numpy_kernels import sawtooth
from lcorpp.planning.upper_bounds import SawtoothBound
from tests.planning.models import TIGER
from tests.planning.sarsop.kernels import BOTH, close, make_tree, random_models, search


def sawtooth_by_hand(kernels: Any) -> tuple[Any, Any]:
    """A tree whose informed bound is 10 in each of two states, by different actions."""
    tiger = parse_pomdp(TIGER)
    model = build_model(kernels, tiger)
    informed = np.array([[10.0, 0], [0, 10], [0, 0]])
    return kernels.Tree(model, informed, np.full((3, 2), -100.0)), informed


def point(*weights: float) -> tuple[Any, Any, Any]:
    inside = np.flatnonzero(weights)
    return np.array([0, len(inside)]), inside.astype(np.int32), np.array(weights)[inside]


@pytest.mark.parametrize("kernels", BOTH)
def test_the_sawtooth_by_hand(kernels):
    tree, informed = sawtooth_by_hand(kernels)
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


@pytest.mark.parametrize("kernels", BOTH)
@given(pomdp=random_models(), seed=st.integers(0, 1000))
@settings(max_examples=15)
def test_the_upper_bound_outlives_its_tree(kernels, pomdp, seed):
    tree, predictor, informed = make_tree(kernels, pomdp)
    search(tree, predictor, tree.find_or_add_node(pomdp.start), 5)
    bound = SawtoothBound(informed, *tree.points())
    again = pickle.loads(pickle.dumps(bound))
    heir, _, _ = make_tree(kernels, pomdp)
    heir.add_points(*bound.points())
    blocks = build_model(kernels, pomdp).export_blocks()
    slack = 1e-9 * max(1.0, float(np.abs(informed).max()))
    sampled = np.random.default_rng(seed).dirichlet(np.ones(len(pomdp.states)), size=5)
    for belief in [*sampled, *map(tree.belief, range(tree.node_count))]:
        value = bound.value(belief)
        assert value == again.value(belief)
        assert tree.lower_bound(tree.find_or_add_node(belief)) - slack <= value <= (informed @ belief).max()
        if len(set(blocks[belief > 0].tolist())) == 1:
            # the tree considers the points of the block, the bound all points, of which others have no effect
            assert heir.upper_bound(heir.find_or_add_node(belief)) == close(value)


@pytest.mark.parametrize("kernels", BOTH)
def test_nearly_equal_beliefs_share_a_node_but_not_its_bound(kernels):
    """The value of a belief that differs in the eleventh digit may be larger, by the Lipschitz slack."""
    T = np.array([[[0, 0.3, 0.7], [0, 1, 0], [0, 0, 1]]])
    worth = np.array([0.9 * 0.7, 0, 1]) * 1e6
    reward = np.array([[0.0, 0, 1e5]])
    pomdp = Pomdp(("s", "t", "u"), ("go",), ("o",), T, np.ones((1, 3, 1)), reward, 0.9, np.array([1.0, 0, 0]))
    tree = kernels.Tree(build_model(kernels, pomdp), worth[None] + 1, worth[None])
    near = np.array([0, 0.3 + 4e-11, 0.7 - 4e-11])
    tree.add_points(*point(*near), np.array([float(near @ worth)]))
    first = tree.find_or_add_node(near)
    root = tree.find_or_add_node(pomdp.start)
    tree.select_action(root, False)
    assert tree.find_or_add_child(root, 0, 0) == first
    tree.add_points(*point(0, 0.5, 0.5), np.array([0.5e6 + 1]))  # a new point, so that the root is updated
    tree.select_action(root, False)
    assert worth[0] - 1e-9 <= tree.q_upper(root)[0] <= worth[0] + 1e-3


def test_removed_points_have_no_effect():
    points = sawtooth.Points.empty(4)
    corners = np.full(4, 10.0)
    for stamp in range(40):
        inside = np.array([stamp % 4, (stamp + 1) % 4])
        inside.sort()
        points = points.append(inside, np.array([0.5, 0.5]), float(stamp % 7), corners, stamp)
    belief = np.full((1, 4), 0.25)
    lowest = points.compute_correction(belief, 0)
    assert lowest == pytest.approx(-5)  # a point of value 0 has half of the belief
    assert points.compute_correction(belief, 36) == pytest.approx(-0.5 * 9)  # stamp 36 has value 1
    for stamp in range(0, 40, 7):
        assert points.remove(stamp)
        assert not points.remove(stamp)
    assert not points.remove(77)
    before = points.compute_correction(belief, 0)
    assert before == pytest.approx(-0.5 * 9)
    points = points.compact()
    assert len(points.stamps) == 34
    assert points.compute_correction(belief, 0) == before
    assert [points.get_point(k)[0] for k in range(3)] == [1, 2, 3]
    points = points.lower_corners(np.full(4, 5.0))
    assert points.compute_correction(belief, 0) == pytest.approx(-0.5 * 4)


def test_a_subnormal_weight_is_support():
    """1 / p overflows; the point must not count at beliefs without that state."""
    points = sawtooth.Points.empty(3)
    points = points.append(np.array([0, 1]), np.array([1 - 1e-16, 1e-310]), 0.0, np.full(3, 10.0), 0)
    assert points.compute_correction(np.array([[1.0, 0, 0], [0, 1, 0]]), 0).tolist() == [0, 0]

"""The tree and its two bounds: both kernels agree, and the bounds are valid."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import Pomdp, parse_pomdp
from lcorpp.planning.sarsop import numpy_kernels
from lcorpp.planning.sarsop.numpy_kernels import alpha_vectors
from lcorpp.planning.sarsop.path_sampling import sample
from tests.planning.models import LCORPP, TIGER, pomdps
from tests.planning.sarsop.kernels import (
    BOTH,
    NATIVE,
    PRUNE,
    SECONDS,
    close,
    make_tree,
    needs_native,
    random_model,
    random_models,
    search,
)


def assert_same(left: Any, right: Any, actions: int) -> None:
    """Compare every node, vector and point of two trees."""
    counts = [(t.node_count, t.vector_count, t.point_count, t.group_count, t.discount) for t in (left, right)]
    assert counts[0] == counts[1]
    for n in range(left.node_count):
        assert left.belief(n) == close(right.belief(n))
        for ask in ("cached_lower", "cached_upper", "q_lower", "q_upper", "expected_rewards"):
            assert getattr(left, ask)(n) == close(getattr(right, ask)(n)), (ask, n)
        for a in range(actions):
            mine, others = left.children(n, a), right.children(n, a)
            assert [mine[0].tolist(), mine[4].tolist()] == [others[0].tolist(), others[4].tolist()]
            assert np.concatenate(mine[1:4]) == close(np.concatenate(others[1:4]))
    for group in range(left.group_count):
        for with_pruned in (False, True):
            mine, others = left.vectors(group, with_pruned), right.vectors(group, with_pruned)
            assert [mine[0].tolist(), mine[2].tolist()] == [others[0].tolist(), others[2].tolist()]
            assert mine[1] == close(others[1])
    mine, others = left.points(), right.points()
    assert [mine[1].tolist(), mine[2].tolist()] == [others[1].tolist(), others[2].tolist()]
    for k in (0, 3, 4):
        assert mine[k] == close(others[k])


CALLS = st.lists(
    st.tuples(
        st.sampled_from(
            (
                "find_or_add_node",
                "select_action",
                "find_or_add_child",
                "refresh",
                "backup",
                "values",
                "sample",
                "prune",
                "clear",
                "drop",
                "vectors",
                "points",
            )
        ),
        st.integers(0, 10**6),
    ),
    min_size=1,
    max_size=25,
)


def call(tree: Any, predictor: Any, pomdp: Pomdp, name: str, number: int) -> Any:
    """Make a call that depends only on the tree and the number; return its result."""
    rng = np.random.default_rng(number)
    node = int(rng.integers(tree.node_count))
    below = bool(rng.integers(2))
    if name == "find_or_add_node":
        inside = rng.random(len(pomdp.states)) < 0.5
        inside[rng.integers(len(inside))] = True
        belief = rng.random(len(inside)) * inside
        return tree.find_or_add_node(belief / belief.sum())
    if name == "select_action":
        return tree.select_action(node, below)
    if name == "find_or_add_child":
        action = tree.select_action(node, below)
        return tree.find_or_add_child(node, action, int(rng.integers(len(tree.children(node, action)[0]))))
    if name == "values":
        return round(tree.lower_bound(node), 6), round(tree.upper_bound(node), 6)
    if name == "sample":
        return tree.sample(predictor, node, 0.1, 8, SECONDS, below)
    if name == "prune":
        return tree.prune([0, node], 1e-3, 2.0, 0.0)
    if name == "clear":
        tree.clear_nodes()
        return tree.find_or_add_node(pomdp.start)
    if name == "drop":
        return tree.drop_older_points()
    if name == "vectors":  # dominated vectors, enough for pruning
        group = int(rng.integers(tree.group_count))
        states, vectors, _ = tree.vectors(group)
        if not len(vectors):
            return None
        worse = vectors[rng.integers(len(vectors), size=80)] - rng.exponential(size=(80, len(states)))
        return tree.add_vectors(group, worse, rng.integers(2, size=80).astype(np.int32) % len(pomdp.actions))
    if name == "points":  # a point at the current upper bound
        belief = tree.belief(node)
        inside = np.flatnonzero(belief).astype(np.int32)
        return tree.add_points(
            np.array([0, len(inside)]), inside, belief[inside], np.array([tree.cached_upper(node) + 1e-3])
        )
    return getattr(tree, name)(node)


@needs_native
@given(random_models(), CALLS)
@settings(max_examples=40)
def test_any_sequence_of_calls_has_the_same_effect(pomdp, calls):
    trees = [make_tree(kernels, pomdp)[:2] for kernels in (NATIVE, numpy_kernels)]
    for tree, _ in trees:
        tree.find_or_add_node(pomdp.start)
    for name, number in calls:
        given_back = [call(tree, predictor, pomdp, name, number) for tree, predictor in trees]
        assert given_back[0] == given_back[1], name
    assert_same(trees[0][0], trees[1][0], len(pomdp.actions))


@needs_native
@pytest.mark.parametrize("seed", range(6))
def test_three_implementations_of_the_search_agree(seed):
    """Compiled, in Python on the compiled tree, and in numpy, node by node."""
    pomdp = random_model(seed, seen=1 + seed % 3, hidden=4, actions=3, signals=2, absorbing=seed % 2 == 1)
    ways = [(NATIVE, None), (NATIVE, sample), (numpy_kernels, None)]
    trees, found = [], []
    for kernels, run in ways:
        tree, predictor, _ = make_tree(kernels, pomdp)
        found.append(search(tree, predictor, tree.find_or_add_node(pomdp.start), 12, run))
        trees.append(tree)
    assert found[0] == found[1] == found[2]
    assert found[0][-1][1] >= 5  # enough nodes to compare
    for tree in trees[1:]:
        assert_same(trees[0], tree, 3)


@needs_native
def test_value_predictors_agree():
    answers = []
    for kernels in (NATIVE, numpy_kernels):
        tree, predictor, _ = make_tree(kernels, random_model(3, hidden=5))
        rng = np.random.default_rng(0)
        nodes = [tree.find_or_add_node(rng.dirichlet(np.ones(5) / 2)) for _ in range(40)]
        for node in nodes[:20]:
            tree.refresh(node)
            predictor.learn(tree, node)
        answers.append([predictor.predict(tree, node) for node in nodes])
    assert answers[0] == close(answers[1])


@pytest.mark.parametrize("kernels", BOTH)
def test_the_prediction_for_an_empty_bin_is_the_upper_bound(kernels):
    tree, predictor, _ = make_tree(kernels, parse_pomdp(TIGER))
    sure, unsure = tree.find_or_add_node(np.array([1.0, 0])), tree.find_or_add_node(np.array([0.5, 0.5]))
    tree.refresh(sure)
    tree.backup(sure)
    predictor.learn(tree, sure)
    assert predictor.predict(tree, sure) == tree.cached_lower(sure)
    assert predictor.predict(tree, unsure) == tree.cached_upper(unsure)


@pytest.mark.parametrize("kernels", BOTH)
@pytest.mark.parametrize(("text", "least", "most"), [(TIGER, 19.371, 19.372), (LCORPP, 51.656, 51.658)])
def test_known_values_are_between_the_bounds(kernels, text, least, most):
    pomdp = parse_pomdp(text)
    tree, predictor, _ = make_tree(kernels, pomdp)
    root = tree.find_or_add_node(pomdp.start)
    search(tree, predictor, root, 40)
    assert tree.lower_bound(root) <= most
    assert tree.upper_bound(root) >= least
    assert tree.upper_bound(root) - tree.lower_bound(root) < 3


def value_of(pomdp: Pomdp, belief: Any, steps: int) -> float:
    """An upper bound on the value by enumeration of `steps` steps from an unnormalised belief."""
    if steps == 0:
        return float(belief.sum() * pomdp.reward.max() / (1 - pomdp.discount))
    return max(
        float(belief @ pomdp.reward[a])
        + pomdp.discount
        * sum(
            value_of(pomdp, belief @ pomdp.transition[a] * seen, steps - 1) for seen in pomdp.observation[a].T
        )
        for a in range(len(pomdp.actions))
    )


@pytest.mark.parametrize("kernels", BOTH)
@given(pomdp=pomdps(discounts=(0.3,)) | random_models(hidden=2, actions=2, signals=2, discount=0.3))
@settings(max_examples=10)
def test_bounds_contain_the_value(kernels, pomdp):
    """The value by enumeration of four steps."""
    tree, predictor, _ = make_tree(kernels, pomdp)
    search(tree, predictor, tree.find_or_add_node(pomdp.start), 5)
    tail = 0.3**4 / 0.7 * float(np.ptp(pomdp.reward))
    for node in range(min(2, tree.node_count)):
        above = value_of(pomdp, tree.belief(node), 4)
        assert max(tree.cached_lower(node), tree.lower_bound(node)) <= above + 1e-9
        assert min(tree.cached_upper(node), tree.upper_bound(node)) >= above - tail - 1e-9


@pytest.mark.parametrize("kernels", BOTH)
@given(pomdp=pomdps() | random_models())
@settings(max_examples=15)
def test_bounds_never_cross_and_the_upper_one_never_rises(kernels, pomdp):
    tree, predictor, informed = make_tree(kernels, pomdp)
    root = tree.find_or_add_node(pomdp.start)
    slack = 1e-9 * max(1.0, float(np.abs(informed).max()))
    uppers = [tree.upper_bound(root)]
    for i in range(8):
        target = max(0.0, 0.3 * (uppers[-1] - tree.cached_lower(root)))
        tree.sample(predictor, root, target, 20, SECONDS, i % 2 == 1)
        tree.prune([root], *PRUNE)
        uppers.append(tree.upper_bound(root))
    assert all(later <= earlier for earlier, later in pairwise(uppers))
    for node in range(tree.node_count):
        assert tree.cached_lower(node) <= tree.cached_upper(node) + slack
        assert tree.lower_bound(node) <= tree.upper_bound(node) + slack
        assert (tree.q_lower(node) <= tree.q_upper(node) + slack).all()


@pytest.mark.parametrize("kernels", BOTH)
def test_vectors_survive_where_they_are_best(kernels):
    """Pruning drops dominated vectors, and no relevant node loses its value."""
    pomdp = random_model(5, hidden=4)
    tree, predictor, _ = make_tree(kernels, pomdp)
    root = tree.find_or_add_node(pomdp.start)
    search(tree, predictor, root, 6)
    states, vectors, actions = tree.vectors(0)
    worse = np.repeat(vectors.min(axis=0)[None] - 1, 200, axis=0) - np.arange(200)[:, None]
    tree.add_vectors(0, worse, np.zeros(200, dtype=np.int32))
    before = [tree.lower_bound(root), tree.vector_count]
    tree.prune([root], 0.0, 3.0, 1.3)
    assert tree.lower_bound(root) == before[0]
    kept = {tuple(vector) for vector in tree.vectors(0)[1].tolist()}
    assert kept <= {tuple(vector) for vector in vectors.tolist()}
    assert len(kept) == tree.vector_count < before[1] - 200 + 1
    tree.backup(root)  # the best vectors of the node were pruned
    assert tree.lower_bound(root) >= before[0] - 1e-9
    assert (states.tolist(), len(actions)) == ([0, 1, 2, 3], len(vectors))


@pytest.mark.parametrize("kernels", BOTH)
def test_extreme_pruning_ratios(kernels):
    pomdp = random_model(5, hidden=4)
    for cap, left in ((0.0, 2), (np.inf, 202)):  # blind policies always stay
        tree, _, _ = make_tree(kernels, pomdp)
        root = tree.find_or_add_node(pomdp.start)
        best = tree.vectors(0)[1][tree.select_action(root, True)]
        nearly = best - np.linspace(1e-6, 1e-3, 200)[:, None] * np.array([0.1, 0.2, 0.3, 5])
        tree.add_vectors(0, nearly, np.zeros(200, dtype=np.int32))
        tree.prune([root], np.inf, cap, 0.0)
        assert tree.vector_count == left


def test_stamps_outlive_pruning():
    vectors = alpha_vectors.VectorSet(3)
    for i in range(100):
        vectors.add(np.full(3, float(i)), i % 3, i)
    vectors.keep(vectors.stamps % 2 == 0)
    assert [vectors.find(stamp) for stamp in (0, 1, 2, 98, 99, 200)] == [0, -1, 1, 49, -1, -1]
    assert vectors.table[:, vectors.first_since(97) :].tolist() == [[98.0]] * 3
    vectors.add(np.zeros(3), 1, 100)
    assert (vectors.find(100), vectors.count, vectors.central()) == (50, 51, 49)

"""The tree and its two bounds: they are those of the equations, and contain the optimal value."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import Pomdp, parse_pomdp, solve
from tests.planning.models import LCORPP, TIGER, pomdps
from tests.planning.sarsop.kernels import (
    PRUNE,
    SECONDS,
    close,
    make_tree,
    random_model,
    random_models,
    search,
)
from tests.planning.sarsop.reference import Bounds, Predictor, TreeValue, TwoStateValue, outcomes, sample


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
                "compress",
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
    if name == "compress":
        return tree.compress([0, node], 1e4, SECONDS)
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


def slack_of(informed: Any) -> float:
    """The rounding error of a bound."""
    return 1e-9 * max(1.0, float(np.abs(informed).max()))


@given(random_models(), CALLS)
@settings(max_examples=15)
def test_any_sequence_of_calls_keeps_the_bounds_valid(pomdp, calls):
    """At every belief, of every action and of every child they contain the optimal value."""
    tree, predictor, informed = make_tree(pomdp)
    tree.find_or_add_node(pomdp.start)
    for name, number in calls:
        call(tree, predictor, pomdp, name, number)
    now, value, slack = Bounds.of(pomdp, tree, informed), TreeValue(pomdp), slack_of(informed)
    for node in range(min(5, tree.node_count)):
        belief = tree.belief(node)
        least, most = value.interval(belief)
        assert tree.lower_bound(node) == close(now.lower(belief))
        assert max(tree.lower_bound(node), tree.cached_lower(node)) <= most + slack
        assert min(tree.upper_bound(node), tree.cached_upper(node)) >= least - slack
        assert tree.upper_bound(node) <= (informed @ belief).max() + slack
        assert tree.expected_rewards(node) == close(pomdp.reward @ belief)
        for action in range(len(pomdp.actions)):
            after = outcomes(pomdp, belief, action)
            for o, probability, lower, upper, _ in zip(*tree.children(node, action), strict=True):
                assert probability == close(after[o].sum())
                least, most = value.interval(after[o])
                assert lower <= most + slack
                assert upper >= least - slack


@pytest.mark.parametrize("seed", range(8))
def test_the_bounds_of_a_new_node_are_those_of_the_equations(seed):
    pomdp = random_model(
        seed, seen=1 + seed % 3, hidden=4 - seed % 2, actions=3, signals=2 + seed % 2, absorbing=seed % 4 == 3
    )
    tree, predictor, informed = make_tree(pomdp)
    search(tree, predictor, tree.find_or_add_node(pomdp.start), 8)
    tree.clear_nodes()  # the vectors and points remain
    rng, slack = np.random.default_rng(seed), slack_of(informed)
    anywhere = rng.dirichlet(np.ones(len(pomdp.states)), 3)
    within = [each / each.sum() for each in outcomes(pomdp, anywhere[0], 1) if each.any()]
    for belief in [pomdp.start, *anywhere, *within]:
        now, node = Bounds.of(pomdp, tree, informed), tree.find_or_add_node(belief)
        assert tree.lower_bound(node) == close(now.lower(belief))
        assert tree.upper_bound(node) == close(now.upper(belief))
        assert tree.upper_bound(node) >= min((informed @ belief).max(), now.convex_hull(belief)) - slack
        tree.refresh(node)
        q_lower, q_upper = now.q_lower(belief), now.q_upper(belief)
        assert [tree.q_lower(node).max(), tree.q_upper(node).max()] == close([q_lower.max(), q_upper.max()])
        assert (
            tree.q_lower(node) <= q_lower + slack
        ).all()  # actions that cannot be the best are not updated
        assert (tree.q_upper(node) >= q_upper - slack).all()
        assert (tree.q_upper(node) <= informed @ belief + slack).all()
        tree.clear_nodes()


@pytest.mark.parametrize("seed", range(8))
def test_a_backup_adds_the_vector_and_the_point_of_the_equations(seed):
    pomdp = random_model(seed, seen=1 + seed % 3, hidden=4 - seed % 2, actions=3, signals=2 + seed % 2)
    tree, predictor, informed = make_tree(pomdp)
    search(tree, predictor, tree.find_or_add_node(pomdp.start), 2)
    added = [0, 0]
    for belief in np.random.default_rng(seed).dirichlet(np.ones(len(pomdp.states)), 12):
        tree.clear_nodes()
        now, node = Bounds.of(pomdp, tree, informed), tree.find_or_add_node(belief)
        group, slack = now.group(belief), slack_of(informed)
        tree.backup(node)
        states, vectors, actions = tree.vectors(group)
        if len(vectors) > len(now.groups[group][1]):
            action, vector = now.back_up(belief)
            assert (int(actions[-1]), vectors[-1]) == (action, close(vector))
            added[0] += 1
        expected = max(now.lower(belief), now.q_lower(belief).max())
        assert tree.lower_bound(node) == close(expected) == close((vectors @ belief[states]).max())
        upper = min(now.upper(belief), now.q_upper(belief).max())
        assert [tree.upper_bound(node), tree.cached_upper(node)] == close([upper, upper])
        later = Bounds.of(pomdp, tree, informed)
        assert later.upper(belief) <= upper + slack
        added[1] += len(later.points) > len(now.points)
    assert min(added) > 0


@pytest.mark.parametrize("seed", range(6))
def test_the_search_samples_the_paths_of_the_paper(seed):
    """Compiled, and in Python on the compiled tree, node by node."""
    pomdp = random_model(seed, seen=1 + seed % 3, hidden=4, actions=3, signals=2, absorbing=seed % 2 == 1)
    trees, found = [], []
    for run in (None, sample):
        tree, predictor, informed = make_tree(pomdp)
        given_predictor = predictor if run is None else Predictor(informed)
        found.append(search(tree, given_predictor, tree.find_or_add_node(pomdp.start), 12, run))
        trees.append(tree)
    assert found[0] == found[1]
    assert found[0][-1][1] >= 5  # enough nodes to compare
    assert_same(*trees, 3)


def test_an_own_function_samples_the_paths_of_a_solver():
    """With the predictor of the kernels, the reference finds what the kernels find."""
    pomdp, lengths = parse_pomdp(LCORPP), list[int]()

    def own(*arguments: Any) -> int:
        lengths.append(sample(*arguments))
        return lengths[-1]

    found, plain = solve(pomdp, precision=0.1, sample=own), solve(pomdp, precision=0.1)
    assert len(lengths) == found.trials == plain.trials
    assert (found.lower, found.upper) == close((plain.lower, plain.upper))


def test_predictions_are_means_of_similar_beliefs():
    pomdp = random_model(3, hidden=5)
    tree, predictor, informed = make_tree(pomdp)
    reference, rng = Predictor(informed), np.random.default_rng(0)
    nodes = [tree.find_or_add_node(rng.dirichlet(np.ones(5) / 2)) for _ in range(40)]
    for node in nodes[:20]:
        tree.refresh(node)
        predictor.learn(tree, node)
        reference.learn(tree, node)
    expected = [reference.predict(tree, node) for node in nodes]
    assert [predictor.predict(tree, node) for node in nodes] == close(expected)


def test_the_prediction_for_an_empty_bin_is_the_upper_bound():
    tree, predictor, _ = make_tree(parse_pomdp(TIGER))
    sure, unsure = tree.find_or_add_node(np.array([1.0, 0])), tree.find_or_add_node(np.array([0.5, 0.5]))
    tree.refresh(sure)
    tree.backup(sure)
    predictor.learn(tree, sure)
    assert predictor.predict(tree, sure) == tree.cached_lower(sure)
    assert predictor.predict(tree, unsure) == tree.cached_upper(unsure)


@pytest.mark.parametrize(("text", "least", "most"), [(TIGER, 19.371, 19.372), (LCORPP, 51.656, 51.658)])
def test_known_values_are_between_the_bounds(text, least, most):
    pomdp = parse_pomdp(text)
    tree, predictor, _ = make_tree(pomdp)
    root = tree.find_or_add_node(pomdp.start)
    search(tree, predictor, root, 40)
    assert tree.lower_bound(root) <= most
    assert tree.upper_bound(root) >= least
    assert tree.upper_bound(root) - tree.lower_bound(root) < 3


@given(pomdps(discounts=(0.3, 0.6)) | random_models(hidden=2, actions=2, signals=2, discount=0.3))
@settings(max_examples=10)
def test_bounds_contain_the_value(pomdp):
    """The value by enumeration of as many steps as possible."""
    tree, predictor, informed = make_tree(pomdp)
    search(tree, predictor, tree.find_or_add_node(pomdp.start), 5)
    value = TreeValue(pomdp, max_beliefs=20_000)
    for node in range(min(2, tree.node_count)):
        least, most = value.interval(tree.belief(node))
        assert max(tree.cached_lower(node), tree.lower_bound(node)) <= most + slack_of(informed)
        assert min(tree.cached_upper(node), tree.upper_bound(node)) >= least - slack_of(informed)


@pytest.mark.parametrize("seed", range(4))
def test_bounds_contain_the_value_of_exact_value_iteration(seed):
    pomdp, gap = random_model(seed, hidden=2, actions=3, signals=2, discount=0.8), 1e-3
    value = TwoStateValue(pomdp, error=1e-3 * gap)
    tree, predictor, informed = make_tree(pomdp)
    root, slack = tree.find_or_add_node(pomdp.start), slack_of(informed)
    for trial in range(200):
        if tree.upper_bound(root) - tree.lower_bound(root) <= gap:
            break
        tree.sample(predictor, root, 0.1 * gap, 50, SECONDS, trial % 2 == 1)
        tree.prune([root], *PRUNE)
    assert tree.upper_bound(root) - tree.lower_bound(root) <= gap
    for node in range(tree.node_count):
        least, most = value.interval(tree.belief(node))
        assert max(tree.cached_lower(node), tree.lower_bound(node)) <= most + slack
        assert min(tree.cached_upper(node), tree.upper_bound(node)) >= least - slack
    for p in np.linspace(0, 1, 11):  # the value is convex, and the vectors are below it everywhere
        belief = np.array([1 - p, p])
        assert (tree.vectors(0)[1] @ belief).max() <= value.interval(belief)[1] + slack


@given(pomdp=pomdps() | random_models())
@settings(max_examples=7)
def test_bounds_never_cross_and_the_upper_one_never_rises(pomdp):
    tree, predictor, informed = make_tree(pomdp)
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


def test_vectors_survive_where_they_are_best():
    """Pruning drops dominated vectors, and no relevant node loses its value."""
    pomdp = random_model(5, hidden=4)
    tree, predictor, _ = make_tree(pomdp)
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


def test_extreme_pruning_ratios():
    pomdp = random_model(5, hidden=4)
    for cap, left in ((0.0, 2), (np.inf, 202)):  # blind policies always stay
        tree, _, _ = make_tree(pomdp)
        root = tree.find_or_add_node(pomdp.start)
        best = tree.vectors(0)[1][tree.select_action(root, True)]
        nearly = best - np.linspace(1e-6, 1e-3, 200)[:, None] * np.array([0.1, 0.2, 0.3, 5])
        tree.add_vectors(0, nearly, np.zeros(200, dtype=np.int32))
        tree.prune([root], np.inf, cap, 0.0)
        assert tree.vector_count == left

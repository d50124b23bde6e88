"""What a policy promises it earns: each of its vectors goes on with others of the same policy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from lcorpp.planning import Pomdp, parse_pomdp, solve
from lcorpp.planning.sarsop import numpy_kernels
from tests.planning.models import LCORPP, TIGER
from tests.planning.sarsop.kernels import BOTH, NATIVE, SECONDS, close, make_tree, needs_native, random_model


def largest_shortfall(pomdp: Pomdp, pieces: Any, piece: Any, row: int) -> float:
    """By how much a vector promises more, at some belief, than its action earns and the best vectors promise.

    A linear program: the belief b, and t for each observation, at least what any vector promises after it;
    the least of R b + gamma sum t - vector b.
    """
    action, states = int(piece.actions[row]), piece.states
    T, Z = pomdp.transition[action][states], pomdp.observation[action]
    n, seen = len(states), np.flatnonzero((T @ Z).any(axis=0))
    rows, bounds = [], [(0.0, 1.0)] * n + [(None, None)] * len(seen)
    for o in seen:
        joint = T * Z[:, o]
        reached = np.flatnonzero(joint.any(axis=0))
        following = next(other for other in pieces if set(reached) <= set(other.states))
        for worth in (joint[:, following.states] @ following.vectors.T).T:
            rows.append(np.concatenate([worth, np.where(seen == o, -1.0, 0.0)]))
    cost = np.concatenate(
        [pomdp.reward[action, states] - piece.vectors[row], np.full(len(seen), pomdp.discount)]
    )
    total = np.concatenate([np.ones(n), np.zeros(len(seen))])[None]
    found = linprog(cost, np.array(rows), np.zeros(len(rows)), total, [1.0], bounds)
    assert found.success, found.message
    return -float(found.fun)


@pytest.mark.parametrize("kernels", BOTH)
@pytest.mark.parametrize("model", [parse_pomdp(TIGER), parse_pomdp(LCORPP), random_model(5, hidden=4)])
def test_every_vector_goes_on_with_others(kernels, model):
    """However much was pruned: none promises more than one step and what is left are worth, at any belief."""
    pieces = solve(model, precision=1e-3, time_limit=5, kernels=kernels).policy.vector_sets
    rng, scale = np.random.default_rng(0), max(np.abs(piece.vectors).max() for piece in pieces)
    for piece in pieces:
        for row in rng.permutation(len(piece.vectors))[:40]:
            # each vector that took the place of a pruned one may be 1e-11 worse
            assert largest_shortfall(model, pieces, piece, int(row)) <= 1e-8 * scale


def prune_often(kernels: Any) -> tuple[Any, int]:
    """A tree with vectors that were pruned and are needed, and its root."""
    model = parse_pomdp(LCORPP)
    tree, predictor, _ = make_tree(kernels, model)
    root = tree.add_node(model.start)
    for trial in range(30):
        tree.sample(predictor, root, 0.0, 60, SECONDS, trial % 2 == 1)
        tree.prune([root], 0.0, 1.0, 0.0)
    return tree, root


@pytest.mark.parametrize("kernels", BOTH)
def test_pruned_vectors_are_kept_only_while_they_are_needed(kernels):
    tree, root = prune_often(kernels)
    table, actions = tree.dependencies(0)
    assert table.shape == (len(actions), 5)
    assert len(actions) > 10
    held = tree.vectors(0)[1]
    for vector in table:  # otherwise a vector that is left stands for it
        assert not (held >= vector - 1e-12).all(axis=1).any()
    better = np.repeat(held.max(axis=0)[None] + 1, 200, axis=0)  # so good that nothing else is needed
    tree.add_vectors(0, better, np.zeros(200, dtype=np.int32))
    tree.prune([root], 0.0, 1.0, 0.0)
    assert len(tree.dependencies(0)[1]) == 0


@needs_native
@pytest.mark.parametrize("seed", [2, 5])
def test_both_kernels_keep_the_same(seed):
    """In a model without ties, where rounding does not decide."""
    rng = np.random.default_rng(seed)
    transition = rng.dirichlet(np.full(5, 0.3), (4, 5))
    observation = rng.dirichlet(np.full(3, 0.5), (4, 5))
    reward = rng.normal(size=(4, 5))
    names = tuple(tuple(f"{kind}{i}" for i in range(n)) for kind, n in (("s", 5), ("a", 4), ("o", 3)))
    model = Pomdp(*names, transition, observation, reward, 0.95, np.full(5, 0.2))
    trees = []
    for kernels in (NATIVE, numpy_kernels):
        tree, predictor, _ = make_tree(kernels, model)
        root = tree.add_node(model.start)
        for trial in range(16):
            gap = tree.upper_bound(root) - tree.lower_bound(root)
            tree.sample(predictor, root, 0.3 * gap, 60, SECONDS, trial % 2 == 1)
            tree.prune([root], 0.0, 1.0, 0.0)
        trees.append(tree)
    (mine, first), (others, then) = (tree.dependencies(0) for tree in trees)
    assert len(first) > 0
    assert first.tolist() == then.tolist()
    assert mine == close(others)

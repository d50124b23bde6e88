"""Vector dependencies: a policy contains all vectors that it needs to earn what its vectors promise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lcorpp.planning import Pomdp, parse_pomdp, solve
from tests.planning.models import LCORPP, TIGER
from tests.planning.sarsop.kernels import export_policy, prune_often, random_model
from tests.planning.shortfall import assert_vectors_are_earned


@pytest.mark.parametrize("model", [parse_pomdp(TIGER), parse_pomdp(LCORPP), random_model(5, hidden=4)])
def test_the_policy_contains_the_vectors_that_its_vectors_depend_on(model):
    assert_vectors_are_earned(model, solve(model, precision=1e-3, time_limit=5).policy)


def pruned_vectors(tree: Any) -> tuple[Any, Any]:
    """The pruned vectors that those of the first group depend on, and their actions."""
    count = len(tree.vectors(0)[2])
    _, vectors, actions = tree.vectors(0, with_pruned=True)
    return vectors[count:], actions[count:]


def test_pruned_vectors_are_kept_while_others_depend_on_them():
    tree, root = prune_often(parse_pomdp(LCORPP), trials=30, share=0.0)
    table, actions = pruned_vectors(tree)
    assert table.shape == (len(actions), 5)
    assert len(actions) > 10
    remaining = tree.vectors(0)[1]
    for vector in table:  # otherwise a remaining vector replaces it
        assert not (remaining >= vector - 1e-12).all(axis=1).any()
    better = np.repeat(remaining.max(axis=0)[None] + 1, 200, axis=0)  # dominates all others
    tree.add_vectors(0, better, np.zeros(200, dtype=np.int32))
    tree.prune([root], 0.0, 1.0, 0.0)
    assert len(pruned_vectors(tree)[1]) == 0


@pytest.mark.parametrize("seed", [2, 5])
def test_vectors_are_earned_after_much_pruning(seed):
    rng = np.random.default_rng(seed)
    transition = rng.dirichlet(np.full(5, 0.3), (4, 5))
    observation = rng.dirichlet(np.full(3, 0.5), (4, 5))
    reward = rng.normal(size=(4, 5))
    names = tuple(tuple(f"{kind}{i}" for i in range(n)) for kind, n in (("s", 5), ("a", 4), ("o", 3)))
    model = Pomdp(*names, transition, observation, reward, 0.95, np.full(5, 0.2))
    tree, _ = prune_often(model)
    assert len(pruned_vectors(tree)[1]) > 0
    assert_vectors_are_earned(model, export_policy(model, tree))

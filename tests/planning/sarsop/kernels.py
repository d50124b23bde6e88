"""Trees and random models for the tests of the kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from lcorpp.planning import AlphaVectors, Policy, Pomdp, _native
from lcorpp.planning.sarsop.kernel_model import build_model

SECONDS = 60.0
"""A time limit that no test reaches, so that comparisons are of complete searches."""


def random_model(
    seed: int,
    *,
    seen: int = 1,
    hidden: int = 3,
    actions: int = 2,
    signals: int = 2,
    certain: bool = False,
    absorbing: bool = False,
    discount: float = 0.9,
) -> Pomdp:
    """A random model without ties, with a fully observed part of the state.

    Args:
        seen, hidden: numbers of values of the two parts; every value of the first is one or more blocks.
        signals: number of observations of the hidden part. certain: whether the state determines them.
        absorbing: whether the last state is absorbing, with rewards.
    """
    rng = np.random.default_rng(seed)
    S = seen * hidden
    T, Z = np.zeros((actions, S, S)), np.zeros((actions, S, seen * signals))
    for a in range(actions):
        for s in range(S):
            reached = rng.choice(S, size=min(S, int(rng.integers(1, 4))), replace=False)
            T[a, s, reached] = rng.dirichlet(np.ones(len(reached)))
            weights = np.eye(signals)[rng.integers(signals)] if certain else rng.dirichlet(np.ones(signals))
            part = s // hidden * signals
            Z[a, s, part : part + signals] = weights
    if absorbing:
        T[:, -1] = np.eye(S)[-1]
    return Pomdp(
        tuple(f"s{i}" for i in range(S)),
        tuple(f"a{i}" for i in range(actions)),
        tuple(f"o{i}" for i in range(seen * signals)),
        T,
        Z,
        rng.normal(size=(actions, S)) * 3,
        discount,
        rng.dirichlet(np.ones(S)),
    )


def random_models(**given: Any) -> st.SearchStrategy[Pomdp]:
    """A strategy for all kinds of models of `random_model`."""
    drawn = {
        "seen": st.integers(1, 3),
        "hidden": st.integers(1, 4),
        "actions": st.integers(1, 3),
        "signals": st.integers(1, 3),
        "certain": st.booleans(),
        "absorbing": st.booleans(),
        "discount": st.sampled_from((0.5, 0.9, 0.97)),
    }
    drawn.update({name: st.just(value) for name, value in given.items()})
    return st.builds(random_model, st.integers(0, 2**32 - 1), **drawn)


def bounds(model: _native.Model, tolerance: float = 1e-7) -> tuple[Any, Any, Any]:
    """Blind policies, MDP bound and fast informed bound."""
    blind = _native.blind_policies(model, tolerance, SECONDS)
    above = _native.mdp_bound(model, tolerance, SECONDS)
    return blind, above, _native.fast_informed_bound(model, above, tolerance, SECONDS)


def make_tree(pomdp: Pomdp) -> tuple[_native.Tree, _native.ValuePredictor, Any]:
    """A tree without nodes, a predictor, and the informed bound."""
    model = build_model(pomdp)
    blind, _, informed = bounds(model)
    return _native.Tree(model, informed, blind), _native.ValuePredictor(informed.max(axis=0)), informed


PRUNE = (1e-3, 3.0, 1.3)
"""Radius, ratio and growth of pruning, as in `bounded_search`."""


def search(tree: Any, predictor: Any, root: int, trials: int, run: Any = None) -> list[tuple[Any, ...]]:
    """Sample paths that aim at half of the gap; lengths and sizes of the tree after each."""
    sizes = []
    for i in range(trials):
        gap = tree.upper_bound(root) - tree.lower_bound(root)
        if gap <= 1e-3:
            break
        arguments = predictor, root, max(0.5 * gap, 5e-4), 50, SECONDS, i % 2 == 1
        steps = run(tree, *arguments) if run else tree.sample(*arguments)
        tree.prune([root], *PRUNE)
        sizes.append((steps, tree.node_count, tree.vector_count, tree.point_count))
    return sizes


def prune_often(pomdp: Pomdp, *, trials: int = 16, share: float = 0.3) -> tuple[_native.Tree, int]:
    """A tree after a search that prunes as often as it can, and its root; paths aim at a share of the gap."""
    tree, predictor, _ = make_tree(pomdp)
    root = tree.find_or_add_node(pomdp.start)
    for trial in range(trials):
        gap = tree.upper_bound(root) - tree.lower_bound(root)
        tree.sample(predictor, root, max(share * gap, 1e-6), 60, SECONDS, trial % 2 == 1)
        tree.prune([root], 0.0, 1.0, 0.0)
    return tree, root


def export_policy(pomdp: Pomdp, tree: _native.Tree) -> Policy:
    """The vectors of a tree, with the pruned ones that others depend on, as a policy."""
    sets = [tree.vectors(group, with_pruned=True) for group in range(tree.group_count)]
    return Policy.of_sets(pomdp, [AlphaVectors(*each) for each in sets if len(each[2])])


def close(numbers: Any) -> Any:
    return pytest.approx(np.asarray(numbers), rel=1e-9, abs=1e-9)

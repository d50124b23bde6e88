"""Compression: a finite-state controller with fewer plans replaces the vectors, as good at the roots."""

from __future__ import annotations

from time import monotonic
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import parse_pomdp, read_pomdp, solve
from lcorpp.planning.sarsop import bounded_search
from lcorpp.planning.sarsop.bounded_search import BoundedSearch
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from tests.planning.models import LCORPP, TIGER, shared_model
from tests.planning.sarsop.kernels import SECONDS, export_policy, prune_often, random_model, random_models
from tests.planning.shortfall import assert_vectors_are_earned

ROUNDING = 1e-8
"""A bound may fall by 1e-11 of the largest value, which is below 1000 in these models."""

MANY = 1e6
"""Evaluations that no controller of these tests needs."""


def vectors_of(tree: Any) -> list[Any]:
    """All vectors with the pruned ones, by group."""
    return [tree.vectors(group, with_pruned=True)[1] for group in range(tree.group_count)]


def test_the_controller_needs_fewer_vectors_and_is_worth_as_much():
    pomdp = parse_pomdp(LCORPP)
    tree, root = prune_often(pomdp, trials=30)
    lower, count = tree.lower_bound(root), sum(map(len, vectors_of(tree)))
    assert tree.compress([root], MANY, SECONDS)
    assert tree.lower_bound(root) >= lower - ROUNDING
    assert sum(map(len, vectors_of(tree))) < 0.7 * count
    assert_vectors_are_earned(pomdp, export_policy(pomdp, tree))


@settings(max_examples=6, deadline=None)
@given(random_models(actions=3), st.integers(2, 12))
def test_laws_of_compression(pomdp, trials):
    """No bound at the root falls, and a policy that continues with its vectors earns all it promises."""
    tree, root = prune_often(pomdp, trials=trials)
    before, lower = vectors_of(tree), tree.lower_bound(root)
    replaced = tree.compress([root], MANY, SECONDS)
    assert lower - ROUNDING <= tree.lower_bound(root) <= tree.upper_bound(root) + ROUNDING
    if not replaced:
        assert all(np.array_equal(*pair) for pair in zip(before, vectors_of(tree), strict=True))
    # the linear programs of very near vectors are solved to 1e-7
    assert_vectors_are_earned(pomdp, export_policy(pomdp, tree), sample=8, tolerance=1e-7)


def test_values_are_those_of_the_controller():
    """So a controller without older versions of plans remains as it is."""
    pomdp = random_model(3, hidden=4, actions=3, discount=0.9)
    tree, root = prune_often(pomdp)
    assert tree.compress([root], MANY, SECONDS)
    first = vectors_of(tree)
    assert tree.compress([root], MANY, SECONDS)
    for own, other in zip(first, vectors_of(tree), strict=True):
        assert own == pytest.approx(other, abs=1e-5)


def test_nothing_changes_without_time_or_evaluations():
    tree, root = prune_often(parse_pomdp(LCORPP), trials=30)
    before = vectors_of(tree)
    assert not tree.compress([root], MANY, 0.0)
    assert not tree.compress([root], 0.0, SECONDS)
    assert all(np.array_equal(*pair) for pair in zip(before, vectors_of(tree), strict=True))


def test_imported_vectors_are_not_compressed():
    """Their plans are unknown."""
    pomdp = parse_pomdp(LCORPP)
    tree, root = prune_often(pomdp)
    tree.add_vectors(0, tree.vectors(0)[1][:1] - 1, np.zeros(1, dtype=np.int32))
    assert not tree.compress([root], MANY, SECONDS)


def test_arguments():
    tree, root = prune_often(parse_pomdp(TIGER), trials=1)
    with pytest.raises(IndexError):
        tree.compress([root, 10**6], MANY, SECONDS)
    for evaluations, seconds in ((-1.0, 1.0), (float("nan"), 1.0), (1.0, float("nan"))):
        with pytest.raises(ValueError, match="max_evaluations and seconds must not be NaN"):
            tree.compress([root], evaluations, seconds)


def test_a_search_with_compression_reaches_a_gap_with_fewer_vectors(monkeypatch):
    """On a maze, where plans lead back to themselves."""
    pomdp = read_pomdp(shared_model("hallway.pomdp"))
    compressed = solve(pomdp, precision=0.35, time_limit=600)
    monkeypatch.setattr(BoundedSearch, "compress_now", lambda search, seconds, memory_limit: False)
    plain = solve(pomdp, precision=0.35, time_limit=600)
    assert compressed.reason == plain.reason == "precision reached"
    assert compressed.trials < plain.trials
    assert len(compressed.policy) < 0.5 * len(plain.policy)
    assert_vectors_are_earned(pomdp, compressed.policy, sample=4)


def test_ctrl_c_during_the_last_compression_loses_nothing(monkeypatch):
    def interrupt(search: BoundedSearch, seconds: float, memory_limit: float) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(bounded_search, "MIN_BACKUPS", np.inf)
    monkeypatch.setattr(BoundedSearch, "compress_now", interrupt)
    solution = solve(parse_pomdp(TIGER), precision=0.5)
    assert solution.reason == "interrupted"
    assert solution.upper - solution.lower <= 0.5


def test_compression_needs_memory():
    """Two copies of the vectors, which is more than a search may have at its limit."""
    pomdp = parse_pomdp(LCORPP)
    bounds = BoundedTree(pomdp, [pomdp.start], precision=1e-3, seconds=SECONDS)
    search = BoundedSearch(bounds, [pomdp.start], precision=1e-3, began=monotonic(), time_limit=SECONDS)
    for _ in range(10):
        search.sample(0.5, 50)
    made, size = bounds.tree.made_count, bounds.memory_size
    assert not search.compress_now(SECONDS, size)
    assert bounds.tree.made_count == made
    search.sample(0.5, 50)
    assert search.compress_now(SECONDS, 2 * size)

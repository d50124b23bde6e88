"""The memory limit of a search: what it drops, and that the bounds stay valid."""

from __future__ import annotations

from itertools import pairwise
from signal import SIGINT, raise_signal
from time import monotonic

import numpy as np
import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import Progress, parse_pomdp, read_pomdp, solve
from lcorpp.planning.evaluation.certificate import certificate
from lcorpp.planning.sarsop.bounded_search import BoundedSearch
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from tests.planning.models import TIGER, shared_model
from tests.planning.sarsop.kernels import make_tree, random_model, search


def test_bounds_remain_without_the_beliefs():
    pomdp = random_model(3, seen=2, hidden=4, actions=3, signals=2)
    tree, predictor, _ = make_tree(pomdp)
    root = tree.find_or_add_node(pomdp.start)
    search(tree, predictor, root, 12)
    vectors, points, bound_memory = tree.vector_count, tree.point_count, tree.bound_memory
    tree.backup(root)  # its point is the newest
    lower, upper = tree.lower_bound(root), tree.upper_bound(root)
    assert tree.node_memory > 0
    tree.clear_nodes()
    assert (tree.node_count, tree.node_memory) == (0, 0)
    assert tree.vector_count >= vectors
    assert tree.bound_memory >= bound_memory > 0
    root = tree.find_or_add_node(pomdp.start)
    assert tree.lower_bound(root) == pytest.approx(lower, abs=1e-12)
    assert tree.upper_bound(root) >= upper - 1e-12
    for _ in range(6):  # points at the same beliefs are replaced, not added
        search(tree, predictor, root, 6)
        tree.clear_nodes()
        root = tree.find_or_add_node(pomdp.start)
    beliefs = np.split(tree.points()[3], tree.points()[1][1:-1])
    assert len({belief.tobytes() for belief in beliefs}) == tree.point_count >= points


def test_the_newer_half_of_the_points_remains():
    pomdp = random_model(3, seen=1, hidden=4, actions=3, signals=2)
    tree, _, _ = make_tree(pomdp)
    beliefs = np.random.default_rng(1).dirichlet(np.ones(4), 7)
    states = np.tile(np.arange(4, dtype=np.int32), 7)
    tree.add_points(np.arange(8, dtype=np.int64) * 4, states, beliefs.ravel(), np.arange(7.0))
    tree.drop_older_points()
    assert tree.points()[4].tolist() == [3, 4, 5, 6]
    assert tree.point_count == 4
    tree.drop_older_points()
    assert tree.points()[4].tolist() == [5, 6]


class Watch:
    """A callback that interrupts the search after it has dropped beliefs some times."""

    def __init__(self, drops: int) -> None:
        self.seen, self._drops = list[Progress](), drops

    def __call__(self, now: Progress) -> None:
        self.seen.append(now)
        self._drops -= len(self.seen) > 1 and now.beliefs < self.seen[-2].beliefs
        if not self._drops:
            raise KeyboardInterrupt


def test_a_search_goes_on_at_the_limit():
    pomdp = random_model(5, seen=2, hidden=4, actions=3, signals=3, discount=0.97)
    plain, watch = solve(pomdp, precision=0.1), Watch(3)
    found = solve(pomdp, precision=1e-9, time_limit=600, memory_limit=2e5, callback=watch)
    assert found.reason in ("memory limit", "interrupted")
    assert found.lower <= plain.upper + 1e-9
    assert plain.lower <= found.upper + 1e-9
    for before, after in pairwise(watch.seen):
        assert after.lower >= before.lower - 1e-9
        assert after.upper <= before.upper + 1e-9
    assert certificate(found, tolerance=1e-6).verdict != "refuted"


@pytest.mark.slow
def test_it_goes_on_several_times_on_a_published_model():
    pomdp = read_pomdp(shared_model("tag-avoid.pomdp"))
    found = solve(pomdp, time_limit=600, memory_limit=1e7, callback=Watch(4))
    assert found.reason == "interrupted"
    assert -8 < found.lower < found.upper < 0
    assert certificate(found, time_limit=60).verdict == "confirmed"


def test_ctrl_c_while_beliefs_are_dropped_loses_nothing():
    pomdp = random_model(5, seen=2, hidden=4, actions=3, signals=3, discount=0.97)
    bounds = BoundedTree(pomdp, [pomdp.start], precision=1e-3, seconds=10)
    search = BoundedSearch(bounds, [pomdp.start], precision=1e-3, began=monotonic(), time_limit=600)
    for _ in range(5):
        search.sample(0.9, 100)
    clear = bounds.tree.clear_nodes

    class Interrupted:
        def __getattr__(self, name):
            return getattr(tree, name)

        def clear_nodes(self):
            clear()
            raise_signal(SIGINT)

    tree, bounds.tree = bounds.tree, Interrupted()
    with pytest.raises(KeyboardInterrupt):
        search.limit_memory(1.0)
    found = search.make_solution("interrupted")
    assert found.lower < found.upper
    assert certificate(found, time_limit=20).verdict != "refuted"


@pytest.mark.parametrize(
    ("limit", "message"), [(0, "is 0; expected"), (-1, "is -1"), ("1", "must be a number")]
)
def test_wrong_limits_are_refused(limit, message):
    with pytest.raises(ModelError, match=f"the memory limit {message}|memory limit {message}"):
        solve(parse_pomdp(TIGER), memory_limit=limit)

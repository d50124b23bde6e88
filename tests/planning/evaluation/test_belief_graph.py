from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import ObservationError
from lcorpp.planning import Policy, parse_pomdp
from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from tests.planning.models import LCORPP, TIGER
from tests.planning.policies import back_up

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


def test_equal_beliefs_share_a_node():
    graph = BeliefGraph(tiger, Policy.of(tiger, [[0.0, 0.0]], [0]))  # always listens
    root = graph.add(SparseBeliefs.of(tiger.start[None]))
    left = graph.follow(root, np.array([0]))
    assert graph.beliefs.dense(int(left[0]), 2) == pytest.approx([0.85, 0.15])
    assert graph.follow(left, np.array([1])).tolist() == root.tolist()
    assert len(graph) == 2


def test_follow_and_expand_agree():
    policy = back_up(lcorpp, 4)
    expanded, followed = BeliefGraph(lcorpp, policy), BeliefGraph(lcorpp, policy)
    roots = [graph.add(SparseBeliefs.of(lcorpp.start[None])) for graph in (expanded, followed)]
    parent, observation, probability, child = expanded.expand(roots[0])
    assert probability.sum() == pytest.approx(1)
    one_by_one = [followed.follow(roots[1], np.array([o]))[0] for o in observation]
    for a, b in zip(child, one_by_one, strict=True):
        one, other = expanded.beliefs.take(np.array([a])), followed.beliefs.take(np.array([b]))
        assert one.keys() == other.keys()
        assert (expanded.actions[a], expanded.values[a]) == (followed.actions[b], followed.values[b])
    assert expanded.follow(parent, observation).tolist() == child.tolist()


def test_imported_nodes_are_bitwise_equal():
    policy = back_up(lcorpp, 4)
    graph = BeliefGraph(lcorpp, policy)
    nodes = graph.expand(graph.add(SparseBeliefs.of(lcorpp.start[None]))).child
    other = graph.empty_copy()
    copied = other.import_nodes(graph, np.append(nodes, nodes))
    assert len(other) == len(np.unique(nodes))
    assert graph.beliefs.take(np.append(nodes, nodes)).keys() == other.beliefs.take(copied).keys()


def test_absorbing_beliefs():
    report = BeliefGraph(lcorpp, Policy.of(lcorpp, [[0.0] * 5], [3]))
    move = BeliefGraph(lcorpp, Policy.of(lcorpp, [[0.0] * 5], [0]))
    beliefs = SparseBeliefs.of(np.array([np.eye(5)[4], lcorpp.start]))
    nodes = report.add(beliefs)
    # a report in `term` has no cost and is a self-loop
    assert report.absorbing[nodes].tolist() == [True, False]
    nodes = move.add(beliefs)
    assert move.absorbing[nodes].tolist() == [False, False]  # a move has a cost


def test_an_impossible_observation_names_everything():
    graph = BeliefGraph(lcorpp, Policy.of(lcorpp, [[0.0] * 5], [0]))
    node = graph.add(SparseBeliefs.of(np.array([[0.22, 0.78, 0, 0, 0]])))
    with pytest.raises(ObservationError) as caught:
        graph.follow(np.append(node, node), np.array([0, 2]))
    words = "observation 'none' is impossible after action 'move_forward' in belief {not_interested_away 0.78"
    assert words in str(caught.value)

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning import BatchPolicy, Policy, Pomdp, observation_probabilities, parse_pomdp, update
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.evaluation.policy_graph import policy_graph
from tests.planning.models import LCORPP, TIGER, pomdps
from tests.planning.policies import policies

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)
# optimal for the tiger: listen until one side was heard twice more often, then open the other door
WAIT = Policy.of(
    tiger,
    [[19.37, 19.37], [22.0, 9.0], [9.0, 22.0], [28.4, -81.6], [-81.6, 28.4]],
    [0, 0, 0, 2, 1],
)


@pytest.mark.parametrize("merge", ["vector", "belief"])
def test_the_graph_of_the_tiger(merge):
    graph = policy_graph(tiger, WAIT, merge=merge)
    assert [tiger.actions[a] for a in graph.actions] == ["listen"] * 3 + ["open-right", "open-left"]
    assert graph.depths.tolist() == [0, 1, 1, 2, 2]
    assert graph.vectors.tolist() == [0, 1, 2, 3, 4]
    assert graph.complete.all()
    edges = list(zip(graph.sources, graph.observations, graph.targets, strict=True))
    assert edges == [(0, 0, 1), (0, 1, 2), (1, 0, 3), (1, 1, 0), (2, 0, 0), (2, 1, 4)] + [
        (source, o, 0) for source in (3, 4) for o in (0, 1)
    ]
    assert graph.probabilities[:4] == pytest.approx([0.5, 0.5, 0.745, 0.255])
    assert graph.belief(3) == pytest.approx(np.array([0.85**2, 0.15**2]) / 0.745)
    assert [layer.tolist() for layer in graph.layers()] == [[0], [1, 2], [3, 4]]
    assert graph.positions().tolist() == [[0, 0], [-0.5, -1], [0.5, -1], [-0.5, -2], [0.5, -2]]
    assert graph.edges_by_nodes()[3, 0] == [6, 7]


@given(pomdps(), st.data())
@settings(max_examples=6)
def test_a_graph_by_belief_is_the_policy(pomdp, data):
    policy = data.draw(policies(pomdp))
    graph = policy_graph(pomdp, policy, merge="belief", max_nodes=25)
    assert graph.belief(0) == pytest.approx(pomdp.start)
    for node in range(len(graph)):
        belief, action = graph.belief(node), int(graph.actions[node])
        assert BatchPolicy(policy).values_and_actions(belief[None])[1][0] == action
        mine = np.flatnonzero(graph.sources == node)
        chances = observation_probabilities(pomdp, belief, action)
        assert graph.probabilities[mine] == pytest.approx(chances[graph.observations[mine]])
        if graph.complete[node]:
            assert graph.observations[mine].tolist() == np.flatnonzero(chances).tolist()
        for edge in mine:
            after = update(pomdp, belief, action, int(graph.observations[edge]))
            assert graph.belief(int(graph.targets[edge])) == pytest.approx(after)
            assert graph.depths[graph.targets[edge]] <= graph.depths[node] + 1
    assert (np.diff(graph.depths) >= 0).all()
    assert (np.diff(graph.sources) >= 0).all()
    assert sorted(np.concatenate(graph.layers()).tolist()) == list(range(len(graph)))


@given(pomdps(), st.data())
@settings(max_examples=10)
def test_merged_by_vector_there_are_no_more_nodes_than_vectors(pomdp, data):
    policy = data.draw(policies(pomdp))
    graph = policy_graph(pomdp, policy)
    assert len(set(graph.vectors.tolist())) == len(graph) <= len(policy)
    assert graph.complete.all()
    sums = np.bincount(graph.sources, graph.probabilities, minlength=len(graph))
    assert sums == pytest.approx(1)


def test_a_complete_graph_has_the_policys_value():
    graph = policy_graph(tiger, WAIT, merge="belief")
    n = len(graph)
    moves = np.zeros((n, n))
    np.add.at(moves, (graph.sources, graph.targets), graph.probabilities)
    paid = [tiger.reward[a] @ graph.belief(i) for i, a in enumerate(graph.actions)]
    values = np.linalg.solve(np.eye(n) - tiger.discount * moves, paid)
    assert values[0] == pytest.approx(evaluate(tiger, WAIT, precision=1e-8).interval.estimate)
    assert 19.371 < values[0] < 19.372  # the optimum, as published


def test_limits_leave_edges_out():
    shallow = policy_graph(tiger, WAIT, max_depth=1)
    assert shallow.complete.tolist() == [True, False, False]
    assert len(shallow.sources) == 2
    few = policy_graph(tiger, WAIT, max_nodes=2)
    assert few.complete.tolist() == [False, False]
    likely = policy_graph(tiger, WAIT, min_probability=0.3)
    assert likely.complete.tolist() == [True, False, False, True, True]
    assert (likely.probabilities >= 0.3).all()
    alone = policy_graph(tiger, WAIT, max_depth=0)
    assert (len(alone), len(alone.sources), alone.to_dot().count("->")) == (1, 0, 0)


def test_graph_starts_at_the_given_belief():
    assert policy_graph(tiger, WAIT, [1.0, 0.0]).actions[0] == 2


def test_to_dot_gives_nodes_and_edges_of_graphviz():
    text = policy_graph(tiger, WAIT, max_depth=1).to_dot()
    assert text.startswith("digraph policy {\n")
    assert text.endswith("}\n")
    assert '  n0 [label="listen\\ntiger-left 0.5", peripheries=2];\n' in text
    assert '  n1 [label="listen\\ntiger-left 0.85", style="rounded,dashed"];\n' in text
    assert '  n0 -> n1 [label="tiger-left 0.5"];\n' in text


def test_names_are_escaped_in_dot():
    odd = Pomdp(
        ('a"b', "c\\n"), ("\\",), tuple(f"o\n{i}" for i in range(8)),
        np.eye(2)[None], np.full((1, 2, 8), 1 / 8), np.zeros((1, 2)), 0.5, [0.0, 1.0],
    )  # fmt: skip
    text = policy_graph(odd, Policy.of(odd, [[0.0, 0.0]], [0])).to_dot()
    assert '[label="\\\\\\nc\\\\n 1", peripheries=2]' in text
    assert 'n0 -> n0 [label="o?0 0.125\\no?1 0.125' in text
    assert "\\n2 others 0.25" in text
    # names appear inside quoted strings only
    bare = re.sub(r'"(?:[^"\\]|\\.)*"', "", text)
    assert set(re.findall(r"[a-z_]\w*", bare)) <= {
        "digraph", "policy", "node", "shape", "box", "style", "rounded", "label", "peripheries", "n0",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"merge": "state"}, "merged by 'vector' or by 'belief', not by 'state'"),
        ({"max_nodes": 0}, "max_nodes 0 is from 1"),
        ({"max_depth": -1}, "max_depth -1 from 0"),
        ({"min_probability": 1.5}, r"1.5 between 0 and 1"),
        ({"start": [1.0]}, "cannot have shape"),
    ],
)
def test_invalid_arguments_raise_errors(changes, words):
    with pytest.raises(ModelError, match=words):
        policy_graph(tiger, WAIT, **changes)


def test_a_policy_for_another_model_raises_an_error():
    with pytest.raises(PolicyError, match="another model"):
        policy_graph(lcorpp, WAIT)

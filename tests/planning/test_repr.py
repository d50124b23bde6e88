"""Short texts of planning values: at most ten lines, and an HTML table in notebooks."""

from __future__ import annotations

import re

import pytest

from lcorpp.planning import (
    BatchPolicy,
    Planner,
    certificate,
    evaluate,
    parse_pomdp,
    policy_graph,
    simulate,
    solve,
    solve_finite_horizon_exact,
)
from tests.planning.factored.models import rover
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER, file="tiger.pomdp")
solution = solve(tiger)
graph = policy_graph(tiger, solution.policy)
result = simulate(tiger, solution.policy, trials=100, steps=20, seed=0, traces=1)
evaluation = evaluate(tiger, solution.policy)
tables = [
    tiger,
    rover(),
    solution,
    solution.policy,
    result,
    evaluation,
    certificate(solution),
    graph,
]
texts = [
    *tables,
    tiger.transition,
    rover().transition[0],
    solution.policy.vector_sets[0],
    Planner(solution),
    BatchPolicy(solution.policy),
    graph.beliefs,
    result.traces[0],
    evaluation.shortfall,
]


@pytest.mark.parametrize("value", texts, ids=lambda value: type(value).__name__)
def test_the_repr_is_short(value):
    text = repr(value)
    assert len(text.splitlines()) <= 10
    assert len(text) < 1000
    assert "array(" not in text


@pytest.mark.parametrize("value", tables, ids=lambda value: type(value).__name__)
def test_a_notebook_shows_a_table(value):
    html = value._repr_html_()
    assert "<table><caption>" in html
    assert html.endswith("</tbody></table></div>")
    assert "/" not in re.sub("</|<style>.*</style>", "", html)  # files without their folders


def test_repr_of_each_value_gives_sizes_and_names():
    assert repr(tiger) == "<Pomdp tiger.pomdp: 2 states, 3 actions, 2 observations, discount 0.95>"
    assert repr(tiger.observation) == "<SparseTables 3 x 2 x 2, 12 entries>"
    assert repr(solution).startswith("<Solution precision reached after ")
    assert "value at the start in [" in repr(solution)
    several = solve(tiger, [[0.5, 0.5], [1.0, 0.0]])
    assert "value at the start with the widest gap (of 2) in [" in repr(several)
    assert "2; bounds at the widest gap" in several._repr_html_()
    finite = solve_finite_horizon_exact(tiger, 2, [[0.5, 0.5], [1.0, 0.0]])
    assert "value of 2 steps from the start with the widest gap (of 2) in [" in repr(finite)
    assert repr(solution.policy).endswith("over 2 states, actions listen, open-left, open-right>")
    assert repr(graph) == "<PolicyGraph: 5 nodes, 10 edges, depth 2>"

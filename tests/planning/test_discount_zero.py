"""Discount 0: only the first reward counts, so the value is the largest expected reward of an action."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.planning import (
    SOLVER_NAMES,
    OnlinePlanner,
    PomcpPlanner,
    evaluate,
    flatten,
    format_pomdpx,
    load_solver,
    parse_pomdp,
    parse_pomdpx,
    policy_graph,
    simulate,
    solve,
    solve_finite_horizon,
)
from lcorpp.planning.evaluation.certificate import certificate
from lcorpp.planning.formats.pomdp.writer import format_pomdp
from tests.planning.models import TIGER, pomdps

tiger = parse_pomdp(TIGER.replace("0.95", "0"))


@pytest.mark.parametrize("solver", SOLVER_NAMES)
@pytest.mark.parametrize("start", [[0.5, 0.5], [0.98, 0.02]])
def test_each_solver_is_myopic(solver, start):
    solution = load_solver(solver)(tiger, start, time_limit=1000)
    expected = (tiger.reward @ start).max()
    assert (solution.lower, solution.upper) == pytest.approx((expected, expected))
    assert solution.reason == "precision reached"
    found = certificate(solution)
    assert (found.verdict, found.certain, found.evaluation.exact) == ("confirmed", True, True)
    result = simulate(tiger, solution.policy, trials=2000, steps=2, seed=1, start=start)
    assert result.interval.low <= expected <= result.interval.high
    assert result.truncation == (0, 0)


@given(pomdps(discounts=(0.0,)))
@settings(max_examples=6)
def test_sarsop_and_a_finite_horizon_are_myopic(pomdp):
    expected = pytest.approx((pomdp.reward @ pomdp.start).max())
    for found in (solve(pomdp), solve_finite_horizon(pomdp, 3)):
        assert (found.lower, found.upper) == (expected, expected)
    policy = solve(pomdp).policy
    assert evaluate(pomdp, policy).interval.estimate == expected
    assert parse_pomdp(format_pomdp(pomdp)).fingerprint == pomdp.fingerprint
    assert flatten(parse_pomdpx(format_pomdpx(pomdp))).discount == 0


def test_online_planners_and_the_graph():
    assert OnlinePlanner(tiger, seconds=10).action(np.array([0.5, 0.5])) == "listen"
    assert PomcpPlanner(tiger, seed=1).action(np.array([0.01, 0.99])) == "open-left"
    assert len(policy_graph(tiger, solve(tiger).policy)) >= 1

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.planning import parse_pomdp, read_pomdp, solve
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.solvers.exact.value_iteration import solve_exact
from lcorpp.planning.solvers.table_policy import policy_lower_bound, solve_fib, solve_qmdp
from tests.planning.models import LCORPP, TIGER, pomdps, shared_model
from tests.planning.solvers.brute_force import corners

tiger = parse_pomdp(TIGER)

# A prize is behind one of two doors; asking costs 1 and reveals it, opening the right door has reward 10.
ASKING = """\
discount: 0.5
values: reward
states: left right end
actions: ask open-left open-right
observations: left right
start: 0.5 0.5 0
T: ask
identity
T: open-left : * : end 1
T: open-right : * : end 1
O: ask
1 0
0 1
0.5 0.5
O: open-left uniform
O: open-right uniform
R: ask : left : * : * -1
R: ask : right : * : * -1
R: open-left : left : * : * 10
R: open-right : right : * : * 10
R: open-left : right : * : * -10
R: open-right : left : * : * -10
"""


def interrupt(progress):
    raise KeyboardInterrupt


def test_qmdp_by_hand():
    """Asking first has value -1 + 5, more than the mean 0 of opening a door."""
    solution = solve_qmdp(parse_pomdp(ASKING))
    assert solution.upper == pytest.approx(4, abs=1e-5)
    assert solution.lower == pytest.approx(4, abs=1e-3)
    assert solution.policy.action(np.array([0.5, 0.5, 0])) == 0
    assert solution.policy.action(np.array([1.0, 0, 0])) == 1


def test_qmdp_expects_information_for_free():
    """Waiting is free and uninformative: QMDP expects to observe the state, always waits and earns 0."""
    text = ASKING.replace("1 0\n0 1\n0.5 0.5\n", "0.5 0.5\n0.5 0.5\n0.5 0.5\n").replace("* -1\n", "* 0\n")
    waiting = parse_pomdp(text)
    solution = solve_qmdp(waiting)
    assert solution.policy.action(waiting.start) == 0
    assert solution.upper == pytest.approx(5, abs=1e-5)
    assert solution.lower == pytest.approx(0, abs=1e-3)
    assert evaluate(waiting, solution.policy, trials=0).upper == pytest.approx(0, abs=1e-3)


def test_the_tables_of_the_tiger():
    """With observed tiger, the reward is 10 in every step: 200 in total; listening first costs 11."""
    qmdp = solve_qmdp(tiger)
    assert qmdp.policy.upper_bound.vectors == pytest.approx(
        np.array([[189, 189], [90, 200], [200, 90]]), abs=1e-4
    )
    assert qmdp.upper == pytest.approx(189, abs=1e-4)
    # QMDP listens until it is sufficiently sure, as the optimal policy does
    assert qmdp.lower == pytest.approx(19.3714, abs=2e-3)


@given(pomdps())
@settings(max_examples=7)
def test_qmdp_is_above_fib_and_that_above_the_truth(pomdp):
    # interrupted when the tables are complete, before the evaluation of the policies
    qmdp, fib = (solver(pomdp, precision=1e-3, callback=interrupt) for solver in (solve_qmdp, solve_fib))
    exact = solve_exact(pomdp, precision=1e-3, time_limit=0.2)
    assert (qmdp.policy.upper_bound.vectors >= fib.policy.upper_bound.vectors - 1e-9).all()
    for belief in (pomdp.start, *corners(pomdp)):
        seen, informed = qmdp.policy.upper_bound.value(belief), fib.policy.upper_bound.value(belief)
        assert seen >= informed - 1e-9
        assert informed >= exact.policy.value(belief) - 1e-9


@pytest.mark.parametrize("solver", [solve_qmdp, solve_fib])
@given(pomdp=pomdps())
@settings(max_examples=5)
def test_the_vectors_are_lower_bounds(solver, pomdp):
    solution = solver(pomdp, time_limit=0.3)
    for belief in (pomdp.start, *corners(pomdp)):
        earned = evaluate(pomdp, solution.policy, belief, max_nodes=200, trials=0)
        assert solution.policy.value(belief) <= earned.upper + 1e-6
        assert solution.policy.gap(belief) >= 0
    assert solution.policy.value(pomdp.start) <= solution.lower + 1e-9
    assert solution.lower <= evaluate(pomdp, solution.policy, max_nodes=200, trials=0).upper + 1e-6


@given(pomdps())
@settings(max_examples=8)
def test_lower_bounds_of_any_table(pomdp):
    """Not only of bounds: the table of the greedy policy is the reward of one step."""
    from lcorpp.planning import Policy

    vectors = policy_lower_bound(pomdp, pomdp.reward, 1e-6, 10.0)
    policy = Policy.of(pomdp, vectors, np.arange(len(vectors)))
    for belief in corners(pomdp):
        assert pomdp.actions[policy.action(belief)] in {
            pomdp.actions[a]
            for a in np.flatnonzero(pomdp.reward @ belief >= (pomdp.reward @ belief).max() - 1e-9)
        }
        assert policy.value(belief) <= evaluate(pomdp, policy, belief, max_nodes=200, trials=0).upper + 1e-6


@pytest.mark.parametrize("solver", [solve_qmdp, solve_fib])
def test_both_bracket_the_authors_value(solver):
    solution = solver(parse_pomdp(LCORPP))
    assert solution.reason == "policy evaluated"
    assert 51.14 <= solution.lower <= 51.657 <= solution.upper


def test_fib_is_closer_than_qmdp_on_a_published_model():
    pomdp = read_pomdp(shared_model("4x3.95.pomdp"))
    qmdp, fib, other = solve_qmdp(pomdp), solve_fib(pomdp), solve(pomdp, time_limit=0.5)
    assert other.lower <= fib.upper < qmdp.upper
    assert fib.lower <= other.upper
    assert qmdp.lower <= other.upper


def test_several_starts_report_the_widest_gap():
    solution = solve_qmdp(tiger, np.array([[0.5, 0.5], [1.0, 0]]))
    # 189 - 19.37 at the uniform belief, 200 - (10 + .95 * 19.37) with known tiger
    assert solution.start == pytest.approx([1, 0])
    assert solution.upper == pytest.approx(200, abs=1e-3)
    assert solution.lower == pytest.approx(10 + 0.95 * 19.3714, abs=2e-3)

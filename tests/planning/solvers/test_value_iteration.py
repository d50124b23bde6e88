from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.planning import parse_pomdp, read_pomdp, solve
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.solvers.exact.value_iteration import solve_exact
from tests.planning.models import LCORPP, TIGER, pomdps, shared_model
from tests.planning.solvers.brute_force import best, corners, tail

tiger = parse_pomdp(TIGER)


def stop_at(trials):
    """Return a callback that interrupts a search after as many steps or trials, on any machine."""

    def stop(progress):
        if progress.trials >= trials:
            raise KeyboardInterrupt

    return stop


def test_the_tiger():
    solution = solve_exact(tiger)
    assert solution.reason == "precision reached"
    assert 19.371 <= solution.lower <= solution.upper <= 19.373
    assert solution.upper - solution.lower <= 1e-3
    assert len(solution.policy) == 9  # as known: Cassandra, Kaelbling and Littman, AAAI 1994


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("cheese.95.pomdp", 3.4854, 3.4863),
        ("1d.pomdp", 1.26033, 1.26035),  # 1d and paint: this solver's own, SARSOP's bounds agree
        ("paint.95.pomdp", 3.2935, 3.2937),
        ("ejs3.pomdp", 167364.9, 167365.0),  # discount .99999
    ],
)
def test_exact_bounds_contain_published_values_and_meet_those_of_sarsop(name, least, most):
    pomdp = read_pomdp(shared_model(name))
    solution = solve_exact(pomdp, time_limit=600)
    assert solution.reason == "precision reached"
    assert solution.lower <= most
    assert solution.upper >= least
    other = solve(pomdp, time_limit=0.3)
    assert other.lower <= solution.upper + 1e-6
    assert solution.lower <= other.upper + 1e-6


@pytest.mark.slow
def test_a_model_of_eight_states():
    solution = solve_exact(read_pomdp(shared_model("shuttle.95.pomdp")), time_limit=300)
    assert solution.reason == "precision reached"
    assert solution.lower <= 32.8898
    assert solution.upper >= 32.8892


@given(pomdps(discounts=(0.3, 0.5)))
@settings(max_examples=7)
def test_brute_force_is_between_the_bounds(pomdp):
    solution = solve_exact(pomdp, precision=1e-4, time_limit=600)  # a second or two on a quiet machine
    assert solution.reason == "precision reached"
    for belief in (pomdp.start, *corners(pomdp)):
        steps = 3
        exact, (least, most) = best(pomdp, belief, steps), tail(pomdp, steps)
        assert solution.policy.value(belief) <= exact + most + 1e-9
        assert solution.policy.upper_bound.value(belief) >= exact + least - 1e-9


@given(pomdps(discounts=(0.5, 0.8)))
@settings(max_examples=15)
def test_sarsop_agrees(pomdp):
    """Some models of two states take seconds: bounds before convergence must agree as well."""
    exact = solve_exact(pomdp, precision=1e-3, time_limit=600, callback=stop_at(12))
    other = solve(pomdp, precision=1e-3, time_limit=600, callback=stop_at(100))
    assert exact.lower <= other.upper + 1e-9
    assert other.lower <= exact.upper + 1e-9


@given(pomdps(discounts=(0.5, 0.8)))
@settings(max_examples=10)
def test_the_policy_earns_its_value_at_all_beliefs(pomdp):
    solution = solve_exact(pomdp, precision=1e-3, time_limit=600, callback=stop_at(12))
    most = 1e-3 + 1e-12 if solution.reason == "precision reached" else np.inf
    for belief in corners(pomdp):
        low, high = solution.policy.value(belief), solution.policy.upper_bound.value(belief)
        assert 0 <= high - low <= most
        assert evaluate(pomdp, solution.policy, belief, max_nodes=150, trials=0).upper >= low - 1e-9


def test_the_policy_earns_the_lower_bound():
    solution = solve_exact(tiger)
    assert solution.reason == "precision reached"
    evaluation = evaluate(tiger, solution.policy, precision=1e-6, trials=0)
    assert evaluation.exact
    assert solution.lower - 1e-9 <= evaluation.upper
    assert evaluation.lower <= solution.upper


def test_bounds_are_valid_before_convergence():
    """The authors' model needs many more steps and vectors."""
    solution = solve_exact(parse_pomdp(LCORPP), time_limit=600, callback=stop_at(2))
    assert solution.reason == "interrupted"
    assert solution.lower <= 51.657
    assert solution.upper >= 51.656
    assert solution.lower > 40


def test_a_tiny_time_limit_returns_a_result():
    solution = solve_exact(tiger, time_limit=1e-9)
    assert solution.reason == "time limit"
    assert solution.lower == pytest.approx(-20)  # always listening
    assert solution.upper == pytest.approx(200)  # the largest reward in every step


def test_several_starts():
    solution = solve_exact(tiger, np.array([[0.5, 0.5], [1, 0], [0.1, 0.9]]))
    assert solution.policy.value(np.array([1.0, 0])) == pytest.approx(10 + 0.95 * 19.3714, abs=2e-3)

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError
from lcorpp.planning import SparseTables, parse_pomdp, read_pomdp
from lcorpp.planning.solvers.exact.value_iteration import solve_exact
from lcorpp.planning.solvers.finite_horizon import solve_finite_horizon, solve_finite_horizon_exact
from lcorpp.planning.solvers.finite_horizon.time_expanded import time_expand
from tests.planning.models import LCORPP, TIGER, pomdps, shared_model
from tests.planning.solvers.brute_force import best, corners, earned

tiger = parse_pomdp(TIGER)
BOTH = [solve_finite_horizon, solve_finite_horizon_exact]


@pytest.mark.parametrize("solver", BOTH)
def test_the_tiger_for_a_few_steps(solver):
    """Two equal observations have probability .97; then a door has mean reward 6.7, before a negative one."""
    one, two, three = (solver(tiger, steps, discount=1) for steps in (1, 2, 3))
    assert one.lower == pytest.approx(-1)
    assert two.lower == pytest.approx(-2)
    # -1 -1 and then with .745 both listens agree: a door pays 10 - 110 * .0302; otherwise listen again
    agree = 0.85**2 + 0.15**2
    wrong = 0.15**2 / agree
    assert three.lower == pytest.approx(-2 + agree * (10 - 110 * wrong) - (1 - agree), abs=1e-3)
    assert three.action(np.array([0.5, 0.5]), 3) == 0
    assert three.action(np.array([1 - wrong, wrong]), 1) == 2
    assert three.action(np.array([1 - wrong, wrong]), 2) in (0, 2)


def test_how_many_vectors_the_tiger_has():
    """The published numbers for 1, 2, ... remaining steps."""
    solution = solve_finite_horizon_exact(tiger, 9)
    assert [len(policy) for policy in solution.policies] == [3, 5, 9, 7, 13, 15, 19, 25, 27]


@pytest.mark.parametrize("solver", BOTH)
@given(pomdp=pomdps(), steps=st.integers(1, 4), discount=st.sampled_from([None, 1.0, 0.7]))
@settings(max_examples=7)
def test_brute_force_agrees(solver, pomdp, steps, discount):
    solution = solver(pomdp, steps, precision=1e-4, discount=discount)
    exact = best(pomdp, pomdp.start, steps, discount)
    assert solution.reason == "precision reached"
    assert solution.horizon == steps
    assert solution.lower - 1e-9 <= exact <= solution.upper + 1e-9
    assert solution.upper - solution.lower <= 1e-4 + 1e-9
    # the policy earns the lower bound
    assert earned(pomdp, solution.action, pomdp.start, steps, discount) >= solution.lower - 1e-9


@given(pomdps(), st.integers(1, 4))
@settings(max_examples=7)
def test_the_exact_policies_are_optimal_at_all_beliefs(pomdp, steps):
    solution = solve_finite_horizon_exact(pomdp, steps, discount=1)
    for to_go, policy in enumerate(solution.policies, 1):
        for belief in corners(pomdp):
            value = best(pomdp, belief, to_go, 1)
            assert policy.value(belief) == pytest.approx(value, abs=1e-6 + 1e-9)
            assert policy.upper_bound.value(belief) >= value - 1e-9


@given(pomdps(), st.integers(1, 4))
@settings(max_examples=6)
def test_the_other_policies_are_bounds_at_all_beliefs(pomdp, steps):
    solution = solve_finite_horizon(pomdp, steps, precision=1e-2, discount=1)
    for to_go, policy in enumerate(solution.policies, 1):
        for belief in corners(pomdp):
            value = best(pomdp, belief, to_go, 1)
            assert policy.value(belief) <= value + 1e-9
            assert policy.upper_bound.value(belief) >= value - 1e-9


def test_both_agree_on_the_authors_model():
    lcorpp = parse_pomdp(LCORPP)
    around, exact = (
        solve_finite_horizon(lcorpp, 4, discount=1),
        solve_finite_horizon_exact(lcorpp, 4, discount=1, precision=0.5),
    )
    assert around.lower <= exact.upper + 1e-9
    assert exact.lower <= around.upper + 1e-9


def test_many_steps_approach_the_infinite_horizon():
    hasty = parse_pomdp(TIGER.replace("discount: 0.95", "discount: 0.75"))
    solution, endless = solve_finite_horizon(hasty, 40), solve_exact(hasty)
    # .75^40 is 1e-5, times a value of at most 12
    assert solution.lower <= endless.upper + 2e-4
    assert endless.lower <= solution.upper + 2e-4


def test_a_large_model_is_bracketed_within_the_time_limit():
    solution = solve_finite_horizon(read_pomdp(shared_model("tag-avoid.pomdp")), 5, time_limit=5)
    # tagging has reward 10 once; every step costs 1
    assert -5 <= solution.lower <= solution.upper <= 10
    assert len(solution.policies) == 5


def test_the_time_expanded_model():
    expanded = time_expand(tiger, 3, 0.95)
    flat = expanded.pomdp
    assert len(flat.states) == 7
    assert flat.states[2] == "tiger-left@1"
    assert flat.transition[0, 2] == pytest.approx([0, 0, 0, 0, 1, 0, 0])
    assert flat.transition[1, 4] == pytest.approx([0, 0, 0, 0, 0, 0, 1])
    assert flat.observation[0, 2] == pytest.approx([0, 0, 0.85, 0.15, 0, 0, 0])
    assert flat.reward[:, 6] == pytest.approx(0)
    assert (time_expand(tiger, 4, 1.0).weights > 1 - 1e-12).all()


def test_an_interrupt_returns_fewer_steps():
    def stop(progress):
        if progress.trials == 3:
            raise KeyboardInterrupt

    solution = solve_finite_horizon_exact(tiger, 10, callback=stop)
    assert (solution.reason, solution.horizon) == ("interrupted", 3)
    assert solution.lower == pytest.approx(best(tiger, tiger.start, 3))
    around = solve_finite_horizon(tiger, 10, callback=stop)
    assert (around.reason, around.horizon) == ("interrupted", 10)
    exact = solve_finite_horizon_exact(tiger, 10)
    assert around.lower <= exact.upper
    assert exact.lower <= around.upper


def test_a_tiny_time_limit_returns_a_result():
    solution = solve_finite_horizon_exact(tiger, 10, time_limit=1e-9)
    assert (solution.reason, solution.horizon) == ("time limit", 1)
    assert "value of 1 steps" in solution.summary()


@pytest.mark.parametrize("solver", BOTH)
@pytest.mark.parametrize(
    ("horizon", "arguments", "words"),
    [
        (0, {}, "horizon must be an integer of at least 1, not 0"),
        (2.5, {}, "horizon must be an integer of at least 1, not 2.5"),
        (3, {"precision": 0}, "expected a .*positive number"),
        (3, {"discount": -0.5}, r"the discount of a finite horizon must be between 0 and 1, not -0\.5"),
        (3, {"discount": 1.5}, r"between 0 and 1, not 1\.5"),
        (3, {"start": [1.0, 1.0]}, "not a distribution"),
    ],
)
def test_bad_arguments(solver, horizon, arguments, words):
    with pytest.raises(ModelError, match=words):
        solver(tiger, horizon, **arguments)


def test_too_many_steps_raise_errors():
    with pytest.raises(ModelError, match="which is too many"):
        solve_finite_horizon(tiger, 10**8)
    with pytest.raises(ModelError, match="remaining steps must be 1 to 2, not 3"):
        solve_finite_horizon(tiger, 2).policy(3)


def test_the_time_expanded_tables_are_sparse():
    expanded = time_expand(tiger, 2, 0.95)
    assert isinstance(expanded.pomdp.transition, SparseTables)
    assert expanded.pomdp.transition.row_sums() == pytest.approx(1)
    assert expanded.belief(tiger.start, 1) == pytest.approx([0, 0, 0.5, 0.5, 0])

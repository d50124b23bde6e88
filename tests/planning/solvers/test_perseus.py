from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.errors import ModelError
from lcorpp.planning import Pomdp, Progress, Solution, parse_pomdp, read_pomdp
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.solvers.exact.value_iteration import solve_exact
from lcorpp.planning.solvers.perseus import solve_perseus
from tests.planning.models import LCORPP, TIGER, pomdps, shared_model
from tests.planning.sarsop.kernels import random_model
from tests.planning.shortfall import assert_vectors_are_earned
from tests.planning.solvers.brute_force import corners

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


def test_perseus_reaches_the_precision_on_the_authors_model():
    solution = solve_perseus(lcorpp, precision=0.02, time_limit=600)
    assert solution.reason == "precision reached"
    assert 51.656 - 0.02 <= solution.lower <= 51.657
    assert 51.656 <= solution.upper <= 51.657 + 0.02


@pytest.mark.slow
def test_perseus_on_tag_comes_close_to_the_published_bound():
    """APPL has a lower bound of -6.2 after a minute."""
    solution = solve_perseus(read_pomdp(shared_model("tag-avoid.pomdp")), time_limit=10)
    assert -6.6 <= solution.lower <= solution.upper <= 0.5


@given(pomdps())
@settings(max_examples=6)
def test_exact_is_between_the_bounds_everywhere(pomdp):
    solution = solve_perseus(pomdp, precision=1e-2, time_limit=0.2, beliefs=50)
    exact = solve_exact(pomdp, precision=1e-3, time_limit=1)
    for belief in (pomdp.start, *corners(pomdp)):
        assert solution.policy.value(belief) <= exact.policy.upper_bound.value(belief) + 1e-9
        assert solution.policy.upper_bound.value(belief) >= exact.policy.value(belief) - 1e-9


def test_the_policy_earns_the_lower_bound():
    solution = solve_perseus(tiger, precision=0.05)
    assert evaluate(tiger, solution.policy, trials=0).upper >= solution.lower - 1e-6


def run_stages(pomdp: Pomdp, stages: int) -> Solution:
    """Perseus, interrupted after a number of stages."""

    def stop(progress: Progress) -> None:
        nonlocal stages
        stages -= 1
        if not stages:
            raise KeyboardInterrupt

    return solve_perseus(pomdp, precision=1e-6, time_limit=600, beliefs=200, callback=stop)


def test_the_policy_contains_the_vectors_that_its_vectors_depend_on():
    """Without them, after pruning, a vector exceeds what the policy earns by 7e-4 of the largest value."""
    assert_vectors_are_earned(lcorpp, run_stages(lcorpp, 8).policy, sample=100)


def test_the_policy_earns_its_value_at_a_belief_that_depends_on_pruned_vectors():
    """Without these vectors, the policy earns less by 0.004 at this belief."""
    pomdp, belief = random_model(5, hidden=5, actions=4, signals=3, discount=0.95), [0, 0, 0.407, 0, 0.593]
    policy = run_stages(pomdp, 6).policy
    evaluation = evaluate(pomdp, policy, belief, precision=1e-6, trials=0, max_nodes=4000)
    assert evaluation.upper >= policy.value(np.array(belief))


def test_equal_seeds_have_equal_results():
    runs = [solve_perseus(lcorpp, precision=0.5, seed=seed) for seed in (3, 3, 4)]
    assert np.array_equal(runs[0].policy.vectors, runs[1].policy.vectors)
    assert runs[0].trials == runs[1].trials
    assert (runs[0].trials, runs[0].beliefs) != (runs[2].trials, runs[2].beliefs)


def test_the_search_stops_when_all_beliefs_are_done():
    """With one state there is only one belief."""
    text = "discount: 0.9\nvalues: reward\nstates: s\nactions: a b\nobservations: o\nstart: s\n"
    text += "T: * identity\nO: * uniform\nR: a : s : * : * 1\nR: b : s : * : * 2\n"
    solution = solve_perseus(parse_pomdp(text), precision=1e-6)
    assert solution.lower == pytest.approx(20)
    assert solution.beliefs == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"beliefs": 0}, "beliefs must be an integer of at least 1, not 0"),
        ({"beliefs": 2.5}, "beliefs must be an integer of at least 1, not 2.5"),
        ({"seed": -1}, "seed must be an integer of at least 0, not -1"),
        ({"seed": True}, "seed must be an integer of at least 0, not True"),
    ],
)
def test_bad_arguments(arguments, words):
    with pytest.raises(ModelError, match=words):
        solve_perseus(tiger, **arguments)

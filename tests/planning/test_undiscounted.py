"""Discount 1: a step that ends with probability 1 - gamma is worth what the discount gamma is."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning import Pomdp, evaluate, parse_pomdp, simulate, solve
from lcorpp.planning.evaluation.certificate import certificate
from lcorpp.planning.solvers import SOLVER_NAMES, load_solver
from lcorpp.planning.solvers.finite_horizon.sarsop import solve_finite_horizon
from lcorpp.planning.solvers.heuristic_search import OnlinePlanner
from lcorpp.planning.undiscounted import DiscountedForm, find_ended, find_endless
from tests.planning.models import TIGER, pomdps


def add_end(pomdp: Pomdp, probability: float | None = None) -> Pomdp:
    """A problem with discount 1 whose steps end with a probability, 1 minus the discount if it is None."""
    A, S, O = pomdp.observation.shape  # noqa: E741
    stay = pomdp.discount if probability is None else 1 - probability
    T, Z = np.zeros((A, S + 1, S + 1)), np.full((A, S + 1, O), 1 / O)
    T[:, :S, :S], T[:, :S, S], T[:, S, S] = stay * pomdp.transition.dense, 1 - stay, 1
    Z[:, :S] = pomdp.observation.dense
    return replace(
        pomdp,
        states=(*pomdp.states, "end"),
        transition=T,
        observation=Z,
        reward=np.pad(pomdp.reward, ((0, 0), (0, 1))),
        discount=1.0,
        start=np.append(pomdp.start, 0.0),
    )


def corridor(steps: int, success: float = 1.0) -> Pomdp:
    """Each step costs 1 and succeeds with a probability; the end earns 5."""
    T = np.zeros((1, steps + 1, steps + 1))
    for s in range(steps):
        T[0, s, s + 1], T[0, s, s] = success, 1 - success
    T[0, steps, steps] = 1
    reward = np.full((1, steps + 1), -1.0)
    reward[0, steps - 1] += 5 * success
    reward[0, steps] = 0
    names = tuple(f"s{i}" for i in range(steps + 1))
    return Pomdp(names, ("go",), ("none",), T, np.ones((1, steps + 1, 1)), reward, 1.0, np.eye(steps + 1)[0])


@pytest.mark.parametrize("solver", SOLVER_NAMES)
def test_each_solver_finds_the_value_of_the_discounted_problem(solver):
    tiger = parse_pomdp(TIGER)
    ended = load_solver(solver)(add_end(tiger), precision=1e-2, time_limit=30)
    plain = load_solver(solver)(tiger, precision=1e-2, time_limit=30)
    assert ended.lower == pytest.approx(plain.lower, abs=0.02)
    assert ended.upper >= 19.371 - 1e-6
    value, gap = ended.policy.value(ended.pomdp.start), ended.gap(ended.pomdp.start)
    assert value <= ended.lower + 1e-6  # QMDP and FIB evaluate their policy
    assert value + gap == pytest.approx(ended.upper, abs=1e-6)
    assert certificate(ended).verdict == "confirmed"


@given(pomdp=pomdps(discounts=(0.5, 0.8)))
@settings(max_examples=6)
def test_random_models_have_the_value_of_the_discounted_problem(pomdp):
    ended, plain = solve(add_end(pomdp), precision=1e-3), solve(pomdp, precision=1e-3)
    assert ended.lower <= plain.upper + 1e-6
    assert plain.lower <= ended.upper + 1e-6
    assert ended.upper - ended.lower <= 1e-3 + 1e-9
    value = evaluate(ended.pomdp, ended.policy, precision=1e-4)
    assert value.upper >= ended.lower - 1e-6
    assert value.lower <= ended.upper + 1e-6


@pytest.mark.parametrize(("steps", "success"), [(1, 1.0), (7, 1.0), (4, 0.25)])
def test_corridors_have_the_value_of_their_steps(steps, success):
    found = solve(corridor(steps, success), precision=1e-6)
    expected = 5 - steps / success
    assert found.lower == pytest.approx(expected, abs=1e-5)
    assert found.upper == pytest.approx(expected, abs=1e-5)
    value = evaluate(found.pomdp, found.policy)
    assert value.lower - 1e-5 <= expected <= value.upper + 1e-5


def test_simulated_rewards_have_the_computed_mean():
    found = solve(add_end(parse_pomdp(TIGER), 0.2), precision=1e-3)
    result = simulate(found.pomdp, found.policy, trials=4000, steps=400, seed=1)
    value = evaluate(found.pomdp, found.policy)
    assert result.unfinished == 0
    assert result.interval.low - 1 <= value.lower <= value.upper <= result.interval.high + 1
    assert abs(result.mean - value.lower) < 4 * (result.interval.high - result.mean)
    cut = simulate(found.pomdp, found.policy, trials=50, steps=1, seed=1)
    assert cut.truncation[0] < 0 < cut.truncation[1]
    assert np.isfinite(cut.truncation).all()


def test_several_starts_mixtures_and_an_earlier_solution():
    pomdp = add_end(parse_pomdp(TIGER), 0.1)
    starts = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    found = solve(pomdp, starts, mixed=starts, precision=1e-2)
    for p in (0.0, 0.2, 0.5, 0.9):
        start = np.array([p, 1 - p, 0])
        plain = solve(pomdp, start, precision=1e-4)
        assert found.policy.value(start) <= plain.upper + 1e-6
        assert found.policy.upper_bound.value(start) >= plain.lower - 1e-6
        assert found.gap(start) <= 2e-2
    again = solve(pomdp, starts, previous=found, precision=1e-2)
    assert again.trials == 0
    seen = []
    solve(pomdp, precision=1e-4, callback=lambda now: seen.append((now.lower, now.upper)))
    best = solve(pomdp, precision=1e-4)
    assert seen[-1] == pytest.approx((best.lower, best.upper), abs=1e-6)


def test_the_precision_is_that_of_the_values():
    """b.w is large, and so is the scale between the two problems."""
    pomdp = add_end(parse_pomdp(TIGER), 0.02)
    found = solve(pomdp)
    assert found.reason == "precision reached"
    assert found.upper - found.lower <= 5e-4 + 1e-9
    ended = np.array([0.001, 0, 0.999])
    mixed = solve(pomdp, ended, mixed=np.eye(3)[:2], precision=0.05)
    assert mixed.reason == "precision reached"
    assert max(mixed.gap(np.array([p, 1 - p, 0])) for p in np.linspace(0, 1, 21)) <= 0.05 + 1e-6


def test_wrong_arguments_are_refused_as_with_other_discounts():
    pomdp = corridor(3)
    other = solve(replace(pomdp, reward=2 * pomdp.reward))
    with pytest.raises(PolicyError, match="the previous solution is for another model"):
        solve(pomdp, previous=other)
    with pytest.raises(PolicyError, match="the previous solution is for another model"):
        solve(pomdp, previous=solve(corridor(2)))
    for options, message in (
        ({"precision": "x"}, "precision must be a number"),
        ({"precision": None}, "precision must be a number"),
        ({"callback": 3}, "callback must be a function"),
        ({"time_limit": -1}, "the time limit is -1"),
        ({"previous": 3}, "previous must be a Solution"),
    ):
        with pytest.raises(ModelError, match=message):
            solve(pomdp, **options)


@pytest.mark.parametrize("solver", SOLVER_NAMES)
def test_nothing_earned_anywhere_is_worth_nothing(solver):
    pomdp = add_end(parse_pomdp(TIGER))
    found = load_solver(solver)(replace(pomdp, reward=0 * pomdp.reward))
    assert (found.lower, found.upper) == pytest.approx((0, 0), abs=1e-6)


@given(pomdp=pomdps())
@settings(max_examples=15)
def test_weights_satisfy_their_inequality(pomdp):
    ended = add_end(pomdp, 0.3)
    form = DiscountedForm.of(ended)
    alive = ~find_ended(ended)
    expected = ended.transition.dense[:, :, alive] @ form.weights[alive]
    assert (form.weights[alive] >= 1 + expected.max(axis=0)[alive] - 1e-9).all()
    assert form.pomdp.transition.row_sums() == pytest.approx(np.ones(ended.reward.shape), abs=1e-9)
    beliefs = np.random.default_rng(0).dirichlet(np.ones(len(ended.states)), 3)
    restored = [form.restore_belief(belief) for belief in form.convert_beliefs(beliefs)]
    assert np.array(restored) == pytest.approx(beliefs, abs=1e-12)


def test_states_that_go_on_forever_are_named():
    """Waiting in s1 never ends; from s0 it is reached with the first action only."""
    T = np.zeros((2, 3, 3))
    T[0, 0, 1], T[1, 0, 2] = 1, 1
    T[0, 1, 1], T[1, 1, 2] = 1, 1
    T[:, 2, 2] = 1
    names = ("s0", "s1", "end"), ("wait", "leave"), ("none",)
    pomdp = Pomdp(*names, T, np.ones((2, 3, 1)), np.array([[-1.0, -1, 0]] * 2), 1.0, np.eye(3)[0])
    ended = find_ended(pomdp)
    assert ended.tolist() == [False, False, True]
    assert find_endless(pomdp, ended).tolist() == [True, True, False]
    with pytest.raises(ModelError, match="from 's0' a policy may go on forever"):
        solve(pomdp)
    policy = replace(solve(replace(pomdp, discount=0.9)).policy, fingerprint="")
    with pytest.raises(ModelError, match="may go on forever"):
        evaluate(pomdp, policy)


@pytest.mark.parametrize("pomdp", [parse_pomdp(TIGER.replace("0.95", "1", 1)), corridor(3, 1e-7)])
def test_problems_without_an_end_are_refused(pomdp, monkeypatch):
    monkeypatch.setattr("lcorpp.planning.undiscounted.MAX_STEPS", 1e4)
    with pytest.raises(ModelError, match=r"may go on forever|may take more than"):
        solve(pomdp)


def test_a_start_at_the_end_is_worth_nothing():
    found = solve(replace(corridor(2), start=np.eye(3)[2]))
    assert (found.lower, found.upper) == pytest.approx((0, 0), abs=1e-6)


def test_what_needs_a_discount_says_so():
    with pytest.raises(ModelError, match=re.escape("expected a discount below 1, not 1; with 1, use sarsop")):
        OnlinePlanner(corridor(3))


def test_a_finite_horizon_needs_no_end():
    tiger = parse_pomdp(TIGER.replace("0.95", "1", 1))
    assert tiger.discount == 1
    assert solve_finite_horizon(tiger, 1).lower == pytest.approx(-1)
    discounted = parse_pomdp(TIGER)
    found = solve_finite_horizon(tiger, 3, precision=1e-6)
    assert found.lower == pytest.approx(solve_finite_horizon(discounted, 3, discount=1.0).lower, abs=1e-3)

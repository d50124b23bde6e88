"""`solve_limited`: against the linear program over all plans, known answers, and its own bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcorpp import load_domain, solve
from lcorpp.errors import InfeasibleError, ModelError
from lcorpp.planning import Limit, Pomdp, SparseTables, read_limit, solve_limited, verify_limits
from lcorpp.planning.limits.limited_model import build_limited_model
from lcorpp.planning.limits.solver import find_smallest_bound
from tests.planning.limits.models import enumerate_plans, mix_plans, random_limit, random_model, stage

KINDS = ("probability", "total", "discounted")


@pytest.mark.parametrize("seed", range(12))
def test_the_linear_program_over_all_plans_of_a_finite_horizon(seed):
    rng = np.random.default_rng(seed)
    steps = 2 + seed % 2
    model = stage(random_model(rng, discount=float(rng.choice([0.5, 0.9, 1.0]))), steps)
    limits = []
    for k in range(1 + seed % 3):
        limit = random_limit(rng, model, f"l{k}", KINDS[(seed + k) % 3] if model.discount < 1 else "total")
        cost = limit.cost.copy()
        cost[:, -1] = 0
        limits.append(Limit(limit.name, cost, limit.bound, limit.kind, limit.more_than))
    rows = enumerate_plans(model, steps, limits)
    best = mix_plans(rows, [limit.bound for limit in limits])
    if best is None:
        with pytest.raises(InfeasibleError):
            solve_limited(model, limits, time_limit=60)
        return
    solution = solve_limited(model, limits, precision=1e-7, time_limit=60)
    assert solution.value == pytest.approx(best, abs=2e-6)
    assert solution.value - 1e-9 <= best <= solution.upper + 1e-9
    assert (solution.costs <= [limit.bound + 1e-9 for limit in limits]).all()
    assert verify_limits(solution).verdict == "confirmed"


@pytest.mark.parametrize("seed", range(4))
def test_random_models_keep_their_limits(seed):
    """The check is independent of the solver, and the gap small compared with the range of returns."""
    rng = np.random.default_rng(100 + seed)
    model = random_model(rng, states=2 + seed % 3)
    drawn = [random_limit(rng, model, f"l{k}", "discounted") for k in range(1 + seed % 3)]
    limits = [replace(limit, bound=float(rng.uniform(5.5, 7))) for limit in drawn]
    solution = solve_limited(model, limits, precision=0.02, time_limit=60)
    assert verify_limits(solution).verdict == "confirmed"
    assert solution.gap <= 0.02
    assert solution.value <= solve(model, precision=0.01, time_limit=5).upper + 1e-6


def two_doors(discount=0.5):
    """A model without observations: `a` earns 1 and costs 1, `b` earns and costs nothing, without end."""
    return Pomdp(("s",), ("a", "b"), ("none",), [[[1.0]]] * 2, [[[1.0]]] * 2, [[1.0], [0.0]], discount, [1.0])


def test_a_known_mixture():
    """Total discounted cost at most 1 of 2 halves the return; the price of a unit is 1."""
    limit = Limit("cost", [[1.0], [0.0]], 1.0, "discounted")
    solution = solve_limited(two_doors(), [limit])
    assert solution.value == pytest.approx(1.0, abs=1e-6)
    assert solution.costs[0] == pytest.approx(1.0, abs=1e-6)
    assert solution.multipliers[0] == pytest.approx(1.0)
    assert solution.upper == pytest.approx(1.0, abs=1e-3)


def test_the_probability_of_an_event_counts_it_once():
    """Either never or always: an event that has happened may happen again at no cost."""
    limit = Limit("ever", [[1.0], [0.0]], 0.25)
    solution = solve_limited(two_doors(), [limit])
    assert solution.value == pytest.approx(0.25 * 2, abs=1e-3)
    assert verify_limits(solution).verdict == "confirmed"


def test_more_than_n_times():
    """Twice is free: 1 + .5, and a quarter of the decisions never end."""
    limit = Limit("often", [[1.0], [0.0]], 0.25, more_than=2)
    solution = solve_limited(two_doors(), [limit])
    assert solution.value == pytest.approx(0.75 * 1.5 + 0.25 * 2, abs=1e-3)


def test_a_limit_without_end_has_finite_costs_at_its_best():
    """A policy without a last action has an infinite total; the best one has a finite total."""
    solution = solve_limited(two_doors(), [Limit("total", [[1.0], [0.0]], 3.0, "total")])
    assert solution.value == pytest.approx(1 + 0.5 + 0.25, abs=2e-3)
    assert solution.costs[0] <= 3 + 1e-9


def test_limits_that_are_not_tight_change_nothing():
    pomdp = load_domain("intention").pomdp
    free = solve(pomdp)
    solution = solve_limited(pomdp, [read_limit(pomdp, "greet <= 1")], precision=1e-3)
    assert solution.value == pytest.approx(free.lower, abs=2e-3)
    assert solution.multipliers.tolist() == [0.0]
    assert solution.policy.is_deterministic


def test_a_smallest_bound_is_named():
    """Each report may be wrong; without more than one question, P(wrong) has a minimum."""
    pomdp = load_domain("intention").pomdp
    text = "report_interested:not_interested <= 0.001"
    hurry = "*>1 <= 0"
    limits = [
        read_limit(pomdp, text),
        read_limit(pomdp, hurry),
        read_limit(pomdp, "report_not_interested <= .2"),
    ]
    with pytest.raises(InfeasibleError, match=r"smallest feasible bound while the others hold: .*"):
        solve_limited(pomdp, limits, time_limit=20)


def test_the_smallest_bound_that_can_be_met():
    """The only report is wrong with probability .3, whatever the robot does."""
    pomdp = Pomdp(
        ("x", "y", "end"), ("say_x",), ("none",),
        [[[0, 0, 1], [0, 0, 1], [0, 0, 1]]], [[[1]] * 3], [[1, -1, 0]], 0.9, [0.7, 0.3, 0],
    )  # fmt: skip
    with pytest.raises(InfeasibleError, match=r"smallest feasible bound: say_x:y <= 0\.3$"):
        solve_limited(pomdp, [read_limit(pomdp, "say_x:y <= .2")])
    assert solve_limited(pomdp, [read_limit(pomdp, "say_x:y <= .3")]).value == pytest.approx(0.4)


def test_a_smallest_bound_that_takes_a_search():
    """The total of actions is at least 1, the report; a second limit on wrong reports permits the bound 0."""
    pomdp = load_domain("intention").pomdp
    model = build_limited_model(pomdp, [read_limit(pomdp, "total(*) <= 1")], pomdp.start[None], np.ones(1))
    assert find_smallest_bound(model, 0, 20) == pytest.approx((1, 1), abs=1e-3)
    both = [read_limit(pomdp, "total(*) <= 2"), read_limit(pomdp, "report_interested:not_interested <= .01")]
    model = build_limited_model(pomdp, both, pomdp.start[None], np.ones(1))
    smallest, certain = find_smallest_bound(model, 1, 20)
    assert smallest == 0  # it reports "not interested" at once
    assert certain <= 1e-9


def test_a_condition_divides_by_its_probability():
    """The probability among decisions that begin in `not_interested` is twice that of both."""
    pomdp = load_domain("intention").pomdp
    joint = solve_limited(pomdp, [read_limit(pomdp, "move_forward:not_interested <= .1")], precision=0.01)
    given = solve_limited(pomdp, [read_limit(pomdp, "move_forward|not_interested <= .2")], precision=0.01)
    assert joint.value == pytest.approx(given.value, abs=0.02)
    assert given.costs[0] == pytest.approx(2 * joint.costs[0], abs=1e-6)


def test_deterministic_policies_lose_little():
    pomdp = load_domain("intention").pomdp
    limit = read_limit(pomdp, "move_forward|not_interested <= .1")
    mixed = solve_limited(pomdp, [limit], precision=0.01)
    single = solve_limited(pomdp, [limit], precision=0.01, deterministic=True)
    assert single.policy.is_deterministic
    assert not mixed.policy.is_deterministic
    assert mixed.upper - 0.5 < single.value <= mixed.value + 1e-9
    assert verify_limits(single).verdict == "confirmed"


def test_limits_hold_in_all_models():
    """With more noise the plain policy is above the bound, the robust one is not."""
    pomdp = load_domain("intention").pomdp
    table = pomdp.observation.dense
    noisy = replace(pomdp, observation=SparseTables.of(0.6 * table + 0.4 * table[:, :, [1, 0, 2]]))
    limit = read_limit(pomdp, "report_interested:not_interested <= .02")
    plain = solve_limited(pomdp, [limit], precision=0.05)
    robust = solve_limited(pomdp, [limit], models=[pomdp, noisy], precision=2.0, time_limit=60)
    assert verify_limits(plain).verdict == "confirmed"
    assert verify_limits(plain, models=[noisy]).verdict == "refuted"
    assert verify_limits(robust).verdict == "confirmed"
    assert len(verify_limits(robust).checks) == 3
    assert robust.value < plain.value


def test_plans_of_another_bound_are_used_again():
    pomdp = load_domain("intention").pomdp
    before = solve_limited(pomdp, [read_limit(pomdp, "move_forward|not_interested <= .1")], precision=0.01)
    tighter = [read_limit(pomdp, "move_forward|not_interested <= .05")]
    after = solve_limited(pomdp, tighter, precision=0.01, previous=before)
    assert after.value < before.value
    assert after.costs[0] <= 0.05
    with pytest.raises(ModelError, match="another model, other starts or other limits"):
        solve_limited(pomdp, [read_limit(pomdp, "greet <= .5")], previous=before)


def test_the_previous_solution_is_of_the_same_problem():
    limit = Limit("cost", [[1.0], [0.0]], 1.0, "discounted")
    before = solve_limited(two_doors(), [limit])
    with pytest.raises(ModelError, match="another model, other starts or other limits"):
        solve_limited(two_doors(), [replace(limit, kind="total")], previous=before)
    with pytest.raises(ModelError, match="previous must be a LimitedSolution"):
        solve_limited(two_doors(), [limit], previous=3)


def test_a_discount_close_to_one():
    """The bound counts the return with its own discount: a quarter of the decisions never end."""
    pomdp = two_doors(0.99995)
    solution = solve_limited(pomdp, [Limit("ever", [[1.0], [0.0]], 0.25)], time_limit=20)
    assert solution.upper >= 0.25 / (1 - 0.99995) - 1e-3
    assert solution.value <= solution.upper + 1e-6


def test_a_return_without_discount_that_begins_later():
    """Nothing is earned in the first state, and the policy ends geometrically: the check follows it."""
    pomdp = Pomdp(
        ("a", "b", "end"), ("go",), ("none",),
        [[[0, 1, 0], [0, 0.5, 0.5], [0, 0, 1]]], [[[1]] * 3], [[0, 1, 0]], 1.0, [1, 0, 0],
    )  # fmt: skip
    solution = solve_limited(pomdp, [Limit("c", [[0, 1, 0]], 5.0, "total")])
    assert solution.value == pytest.approx(2)
    assert verify_limits(solution).verdict == "confirmed"
    assert verify_limits(solution).checks[1].high == pytest.approx(2, abs=1e-6)
    with pytest.raises(ModelError, match="counts in a state that is never left"):
        solve_limited(pomdp, [Limit("c", [[0, 0, 1]], 0.5, "total")])


def test_several_starts_share_a_limit():
    """From a start that is certain nothing has to be asked, so that the other one may ask more."""
    pomdp = load_domain("intention").pomdp
    starts = [[0.5, 0.5, 0, 0, 0], [0.05, 0.95, 0, 0, 0]]
    limit = read_limit(pomdp, "move_forward,greet|not_interested <= .1")
    solution = solve_limited(pomdp, [limit], starts, weights=[0.3, 0.7], precision=0.05)
    assert solution.costs[0] == pytest.approx(0.1, abs=1e-6)
    assert verify_limits(solution).verdict == "confirmed"


def test_wrong_arguments():
    pomdp = load_domain("intention").pomdp
    limit = read_limit(pomdp, "greet <= .5")
    with pytest.raises(ModelError, match="there is no limit"):
        solve_limited(pomdp, [])
    with pytest.raises(ModelError, match="two limits have the name 'greet'"):
        solve_limited(pomdp, [limit, limit])
    with pytest.raises(ModelError, match="weights of 1 starts"):
        solve_limited(pomdp, [limit], weights=[0.5])
    with pytest.raises(ModelError, match="costs of shape"):
        solve_limited(two_doors(), [limit])
    with pytest.raises(ModelError, match="same names"):
        solve_limited(pomdp, [limit], models=[two_doors()])
    with pytest.raises(ModelError, match=r"its discount is 0\.9; expected that of the stated model, 0\.99"):
        solve_limited(pomdp, [limit], models=[replace(pomdp, discount=0.9)])
    with pytest.raises(ModelError, match="weights are finite numbers from 0"):
        solve_limited(pomdp, [limit], weights=[float("nan")])
    with pytest.raises(ModelError, match="factors have shape"):
        solve_limited(pomdp, [limit], factors=[1.0])
    with pytest.raises(ModelError, match="limits must be a Sequence"):
        solve_limited(pomdp, limit)
    with pytest.raises(ModelError, match="more_than of the limit a must be an integer"):
        Limit("a", [[1.0]], 0.1, more_than=1.5)
    with pytest.raises(ModelError, match="it counts nothing"):
        Limit("a", [[0.0]], 0.1)

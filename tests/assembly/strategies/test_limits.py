"""LCORPP+limits: the plan of a domain, what it does to people, and replay."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp import load_domain, load_robot
from lcorpp.assembly import solve_domain_limits
from lcorpp.assembly.strategies.baselines import find_strategies
from lcorpp.assembly.strategies.limited_plan import list_models, list_population
from lcorpp.assembly.strategies.limits import bind_limits, get_plan
from lcorpp.errors import DecisionError, DomainError, InfeasibleError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning import verify_limits
from lcorpp.scoring import Experiment, replay_trial, run_trials
from lcorpp.scoring.limit_costs import measure_decision
from lcorpp.values import Interval

FEEDBACK = {"feedback": {"interested": "pos", "not_interested": "neg"}, "noise": 0.4}


def load(*texts, limit_noise=(), **simulation):
    """Return the domain intention with limits; people answer as its model states."""
    planning = {"limits": [{"limit": text} for text in texts], "limit_noise": list(limit_noise)}
    return load_domain(
        "intention", preset="limit_5", changes={"planning": planning, "simulation": simulation}
    )


@pytest.fixture(scope="module")
def plan():
    return solve_domain_limits(load_domain("intention", preset="limit_5"))


def test_the_population_has_the_probabilities_of_the_knowledge():
    """The sums over the cases are the marginals; so it is for an attribute without observations."""
    domain = load("greet|not_interested <= .1", "greet|identity=visitor <= .2", "greet <= .5")
    own = list_population(domain, domain.program)
    assert own.weights.sum() == pytest.approx(1)
    prior = own.weights @ own.starts
    from lcorpp.reasoning import Reasoner

    marginal = Reasoner(domain.program).posterior("intention", {})
    assert domain.marginal(prior).probabilities == pytest.approx(marginal.probabilities)
    # each factor makes the expectation over people with the condition: it is 1 for a cost of 1
    for k in range(3):
        assert own.weights @ (own.starts * own.factors[k]).sum(axis=1) == pytest.approx(1)
    assert np.allclose(own.factors[2][own.starts > 0], 1)


def test_the_plan_keeps_the_limit_and_is_nearly_optimal(plan):
    solution = plan.solution
    assert solution.costs[0] <= 0.05
    assert solution.upper - solution.value < 0.2
    assert verify_limits(solution).verdict == "confirmed"
    assert plan.find_start({"time": "morning", "location": "classroom", "classifier": "one"}) is not None
    assert plan.find_start({"time": "morning"}) is None


def test_shares_of_simulated_people_cover_the_plan(plan):
    """LCORPP approaches everybody; the limited robot as many as it has planned."""
    full = load_robot("intention", preset="limit_5", cache=False)
    channels = {"motion": full.senses["motion"].classifier}
    rows = bind_limits(find_strategies(["LCORPP", "LCORPP+limits"]), plan)
    assert get_plan(rows) is plan
    experiment = Experiment(full.domain, full.robot, channels, channels, rows, seed=1)
    (free, limited), _ = run_trials(experiment, 4000)
    assert free.limits["bothered"].estimate == 1
    own = limited.limits["bothered"]
    assert own.low <= 0.05 <= own.high
    assert limited.cells["limit_bothered_high"] == own.high


def test_a_trial_is_drawn_again_alike(plan):
    full = load_robot("intention", preset="limit_5", cache=False)
    channels = {"motion": full.senses["motion"].classifier}
    rows = bind_limits(find_strategies(["LCORPP+limits"]), plan)
    experiment = Experiment(full.domain, full.robot, channels, channels, rows, seed=3)
    first, second = (replay_trial(experiment, 5, rows[0], trials=100) for _ in range(2))
    assert [step.action for step in first.steps] == [step.action for step in second.steps]


def test_costs_of_decisions():
    domain = load(
        "greet > 1 <= .5", "total(greet:not_interested) <= 1", "discounted(*) <= 9", "greet|interested <= 1"
    )
    person = {"intention": "not_interested"}
    costs = measure_decision(domain, person, ["greet", "turn", "greet", "report_interested"])
    assert costs[:2].tolist() == [1, 2]
    assert costs[2] == pytest.approx(sum(0.99**t for t in range(4)))
    assert np.isnan(costs[3])
    assert measure_decision(domain, person, ["greet"])[:2].tolist() == [0, 1]


def test_robust_limits_hold_for_each_noise():
    text = "greet:not_interested <= .02"
    others = list_models(load(text, limit_noise=(0.1, 0.4), **FEEDBACK))
    plain = solve_domain_limits(load(text)).solution
    robust = solve_domain_limits(load(text, limit_noise=(0.1, 0.4), **FEEDBACK)).solution
    assert verify_limits(plain).verdict == "confirmed"
    assert verify_limits(plain, models=others).verdict == "refuted"
    assert verify_limits(robust).verdict == "confirmed"
    assert [check.what for check in verify_limits(robust).checks[1:]] == [
        "greet:not_interested in model 1",
        "greet:not_interested in model 2",
    ]


def test_comparisons_have_the_plan():
    domain = load_domain("intention", preset="limit_10")
    options = ComparisonOptions(find_strategies(["LCORPP+limits"]), trials=300, seed=2)
    comparison = compare_strategies(domain, options)
    assert comparison.plan.cells["planned_limit_bothered"] <= 0.1
    assert comparison.scores[0].limits.keys() == {"bothered"}
    assert isinstance(comparison.scores[0].limits["bothered"], Interval)


def test_what_cannot_be_planned():
    with pytest.raises(DomainError, match=r"no \[\[planning.limits\]\]"):
        solve_domain_limits(load_domain("intention"))
    with pytest.raises(InfeasibleError, match=r"smallest feasible bound: total\(\*\) <= 1$"):
        solve_domain_limits(load("total(*) <= 0.5"), time_limit=20)
    robot = load_robot("intention", cache=False).robot
    (row,) = find_strategies(["LCORPP+limits"])
    with pytest.raises(DomainError, match=r"LCORPP\+limits needs one"):
        row.robot(robot, np.random.default_rng(0))
    with pytest.raises(DecisionError, match="expected a random generator"):
        row.robot(robot)

"""CORPP's shopping task: correlated knowledge, rewards by hand, exact scores and simulation."""

from collections import defaultdict
from functools import cache

import numpy as np
import pytest

from lcorpp.assembly.solving import solve_domain
from lcorpp.decision import Robot, strategies
from lcorpp.domains import load_domain
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning import Planner, SolverOptions
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.scoring import Experiment, Scores, evaluate_exactly, run_trials
from lcorpp.scoring.cases import compute_joint_distribution
from lcorpp.scoring.metrics import find_reference

SHARED = ["item", "person", "room"]


@cache
def small():
    domain = load_domain("shopping", preset="small")
    planner = Planner(solve_domain(domain, cache=find_cache_folder()))
    return domain, Robot({}, Reasoner(domain.program), planner, domain)


@cache
def exactly() -> dict[str, Scores]:
    domain, robot = small()
    return {row.strategy: row for row in evaluate_exactly(domain, robot, {}, strategies([], []))}


def test_the_joint_prior_keeps_the_correlations():
    domain = load_domain("shopping", preset="small")
    reasoner, reference = Reasoner(domain.program), Enumeration(domain.program)
    for time in ("morning", "noon"):
        facts = {"time": time, "requester": "bob"}
        joint = reasoner.posterior(SHARED, facts)
        np.testing.assert_allclose(
            joint.probabilities, reference.posterior(SHARED, facts).probabilities, rtol=0, atol=1e-12
        )
        product = np.ones(1)
        for name in SHARED:
            product = np.outer(product, domain.marginalise(joint, name).probabilities).ravel()
        assert np.abs(joint.probabilities - product).max() > 0.1


def test_rewards_by_hand():
    pomdp = load_domain("shopping").pomdp

    def reward(action: str, request: str) -> float:
        return pomdp.reward[pomdp.actions.index(action), pomdp.states.index(request)]

    assert len(pomdp.states) == 28
    assert (reward("ask_room", "coffee_bob_lab"), reward("confirm_bob", "coffee_bob_lab")) == (-1.5, -1)
    assert reward("deliver_coffee_bob_lab", "coffee_bob_lab") == 20
    assert reward("deliver_coffee_bob_lab", "coffee_bob_office") == -10
    assert reward("deliver_coffee_bob_lab", "coffee_alice_office") == -15
    assert reward("deliver_coffee_bob_lab", "sandwich_alice_office") == -20


@pytest.mark.parametrize(
    ("question", "facts", "expected"),
    [
        # a default with an exception: Carol does not drink coffee
        ("item", {"person": "carol", "time": "morning"}, {"coffee": 0.1, "sandwich": 0.8, "notebook": 0.1}),
        ("item", {"person": "bob", "time": "morning"}, {"coffee": 0.8, "sandwich": 0.1, "notebook": 0.1}),
        ("room", {"person": "bob", "weekday": "tuesday"}, {"office": 0.075, "lab": 0.85, "workshop": 0.075}),
        ("room", {"person": "bob", "weekday": "friday"}, {"office": 0.075, "lab": 0.075, "workshop": 0.85}),
        (
            "room",
            {"person": "bob", "weekday": "monday", "time": "morning"},
            {"office": 0.85, "lab": 0.075, "workshop": 0.075},
        ),
    ],
)
def test_defaults_and_exceptions(question, facts, expected):
    answer = Reasoner(load_domain("shopping").program).posterior(question, facts)
    assert dict(answer) == pytest.approx(expected)


def test_reasoning_and_planning_together_are_best():
    scores = exactly()
    assert list(scores) == ["R", "P", "R+P"]
    assert scores["R+P"].return_.estimate > scores["P"].return_.estimate + 4
    assert scores["R+P"].return_.estimate > scores["R"].return_.estimate + 8
    assert find_reference(list(scores.values())).strategy == "R+P"
    assert list(scores["P"].variables) == SHARED


def test_exact_scores_are_those_of_simulation():
    """2000 decisions; 15 figures, each within 4 standard errors (1 chance in 1000 for all)."""
    domain, robot = small()
    results, _ = run_trials(Experiment(domain, robot, {}, {}, strategies([], []), 3), 2000)
    for row in results:
        truth = exactly()[row.strategy]
        pairs = [(interval, truth.columns[name]) for name, interval in row.columns.items()]
        for other in results:
            gaps, true_gaps = row.subtract(other), truth.subtract(exactly()[other.strategy])
            pairs += [(gaps[name], true_gaps[name]) for name in ("cost", "return")]
        for found, true in pairs:
            error = (found.high - found.low) / 2 / 1.96
            assert abs(found.estimate - true.estimate) <= 4 * error + 1e-12, row.strategy


def test_the_people_of_a_program_are_its_worlds():
    """The two ways to the joint distribution agree; the full truth program has too many worlds to list."""
    domain = load_domain("shopping", preset="small")
    listed = defaultdict(float)
    for world in Enumeration(domain.simulation.true_program).worlds:
        listed[tuple(world.values[name] for name in ("time", *SHARED))] += float(world.measure)
    assert compute_joint_distribution(domain, ("time", *SHARED)) == pytest.approx(listed, abs=1e-15)
    full = compute_joint_distribution(load_domain("shopping"), ("weekday", "time", "requester", *SHARED))
    assert len(full) == 5 * 3 * 3 * 27
    assert sum(full.values()) == pytest.approx(1)


@pytest.mark.slow
def test_three_values_each_return_more_at_less_cost_than_planning_alone():
    """The search stops at a gap, not at a time, so that the policy is the same on every machine."""
    domain = load_domain("shopping")
    options = ComparisonOptions(
        trials=500, solver=SolverOptions(precision=8, time_limit=600), strategies=strategies(["P", "R+P"], [])
    )
    comparison = compare_strategies(domain, options)
    assert comparison.solution.converged
    planning_only, both = comparison.scores
    gaps = both.subtract(planning_only)
    assert gaps["return"].low > 0 > gaps["cost"].high

"""The extended domain: its model, its policy, and two independent evaluations of it."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.assembly import solve_domain
from lcorpp.decision import STRATEGIES, Robot
from lcorpp.domains import load_domain
from lcorpp.early_decision.evaluation import (
    ObservedPeople,
    score_evidence,
    score_policy,
    sum_dialogues,
)
from lcorpp.early_decision.extension import OVER, WATCH, extend_domain
from lcorpp.early_decision.stream_model import fit_stream_model
from lcorpp.errors import DataError, DomainError
from lcorpp.planning import Planner
from lcorpp.reasoning import Reasoner
from lcorpp.scoring import evaluate_exactly
from tests.early_decision.streams import make_stream, make_timeline


@pytest.fixture(scope="module")
def domain():
    return load_domain("intention")


@pytest.fixture(scope="module")
def extended(domain):
    return extend_domain(domain, make_stream(ends=0.0), cost=0.5)


@pytest.fixture(scope="module")
def own_planner(extended):
    """The planner of the extended domain for its own priors."""
    return Planner(solve_domain(extended))


@pytest.fixture(scope="module")
def planner(extended):
    return Planner(solve_domain(extended, any_prior=True))


def prior_of(domain, p):
    belief = domain.planning.initial_states
    return p * belief[0] + (1 - p) * belief[1]


def test_watching_is_bayes_rule(extended, own_planner):
    """Prior .4, the bin has .8 and .3: .4 x .8 / (.4 x .8 + .6 x .3) = .64; the same bin adds nothing."""
    planner = own_planner
    belief = planner.update(prior_of(extended, 0.4), WATCH, "bin_2")
    assert extended.marginal(belief).probabilities == pytest.approx([0.64, 0.36])
    again = planner.update(belief, WATCH, "bin_2")
    assert extended.marginal(again).probabilities == pytest.approx([0.64, 0.36])
    over = planner.update(again, WATCH, OVER)
    assert over == pytest.approx(np.append(prior_of(load_domain("intention"), 0.64), np.zeros(10)))


def test_the_dialogue_is_that_of_the_domain(domain, extended, own_planner):
    """After a bin, a question gives the belief that the domain gives from the same distribution."""
    base, planner = Planner(solve_domain(domain)), own_planner
    belief = planner.update(prior_of(extended, 0.4), WATCH, "bin_2")
    after = planner.update(belief, "greet", "pos")
    assert after[:5] == pytest.approx(base.update(prior_of(domain, 0.64), "greet", "pos"))
    assert planner.update(after, WATCH, OVER) == pytest.approx(after)


def test_costs(domain, extended):
    """.5 a second: 1 s to the first stage, 2 s to the second; nothing in the terminal state."""
    pomdp = extended.pomdp
    reward = dict(zip(pomdp.states, pomdp.reward[pomdp.action_index(WATCH)].tolist(), strict=True))
    assert reward["interested_not_turned_before"] == -0.5
    assert reward["interested_not_turned_stage_1_bin_1"] == -1
    assert reward["term"] == 0
    assert pomdp.reward[: len(domain.pomdp.actions), :5].tolist() == domain.pomdp.reward.tolist()


def test_watching_pays_if_it_is_cheap_and_not_if_it_is_dear(domain):
    cheap = extend_domain(domain, make_stream(), cost=0.01)
    dear = extend_domain(domain, make_stream(), cost=100.0)
    for own, watches in ((cheap, True), (dear, False)):
        planner = Planner(solve_domain(own, any_prior=True))
        assert (planner.action(prior_of(own, 0.5)) == WATCH) == watches


def test_a_dear_stream_is_worth_nothing(domain):
    """The value of the extended model is then that of the domain with the same discount."""
    own = extend_domain(domain, make_stream(), cost=100.0, discount=None)
    assert own.pomdp.discount == domain.pomdp.discount
    values = [solve_domain(each, any_prior=True).policy.value(prior_of(each, 0.4)) for each in (domain, own)]
    assert values[1] == pytest.approx(values[0], abs=2e-3)  # twice the precision


def test_two_evaluations_agree(domain, extended, planner):
    """People whose streams follow the model exactly: a weighted sum over bins equals `evaluate_exactly`."""
    robot = Robot({}, Reasoner(domain.program), planner, extended)
    strategy = next(own for own in STRATEGIES if own.name == "R+P")
    expected = evaluate_exactly(extended, robot, {}, (strategy,))[0].return_.estimate
    posterior = Reasoner(domain.simulation.true_program).exact([*domain.observed, "intention"])
    total = 0.0
    stream = make_stream(ends=0.0)
    for (*facts, value), mass in posterior.items():
        context = dict(zip(domain.observed, facts, strict=True))
        prior = robot.reasoner.posterior(domain.shared, context)
        v = domain.values.index(value)
        waiting = [(extended.prior(prior), float(mass), -1, 0)]
        for belief, weight, before, stage in waiting:  # grows
            if planner.action(belief) != WATCH:
                total += weight * sum_dialogues(extended, planner, belief[None])[0, v]
                continue
            total -= weight * 0.5 * stream.durations[stage]
            rates = stream.first[v] if before < 0 else stream.steps[stage - 1, v, before]
            for b, rate in enumerate(rates):
                after = planner.update(belief, WATCH, f"bin_{b + 1}")
                waiting.append((after, weight * rate, b, stage + 1))
    assert total == pytest.approx(expected, abs=1e-6)


def test_people_with_streams(domain):
    """Never watching is the strategy R+P, and watching at a low cost earns more."""
    timeline = make_timeline(400)
    stream = fit_stream_model(timeline, stages=3, bins=3)
    people = [{"time": "evening", "location": "library", "intention": label} for label in timeline.labels]
    observed = ObservedPeople.of(domain, people, make_timeline(400, seed=1))
    own = extend_domain(domain, stream, cost=0.1)
    watching = score_policy(domain, own, Planner(solve_domain(own, any_prior=True)), stream, observed)
    same = replace(domain, planning=replace(domain.planning, model=replace(domain.pomdp, discount=0.999)))
    never = score_evidence(
        same, Planner(solve_domain(same, any_prior=True)), observed, np.ones((400, 2)), 0.0
    )
    assert watching.seconds.max() <= stream.seconds[-1]
    assert (watching.subtract_cost(0.1) - never.returns).mean() > 1


def test_wrong_arguments(domain, extended):
    stream = make_stream()
    with pytest.raises(DomainError, match=r"costs 0\.0; expected a positive number"):
        extend_domain(domain, stream, cost=0.0)
    with pytest.raises(DomainError, match="'watch' is already an action"):
        extend_domain(extended, stream)
    with pytest.raises(DomainError, match="expected those of the sense 'motion'"):
        extend_domain(domain, replace(stream, classes=("a", "b")))
    with pytest.raises(DomainError, match="the senses are none; expected one"):
        extend_domain(replace(domain, senses=()), stream)
    with pytest.raises(DataError, match="extend_domain: cost"):
        extend_domain(domain, stream, cost="1")  # type: ignore[arg-type]

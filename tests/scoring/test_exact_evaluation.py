"""Shows 4: the values of PAPER.md's table, exactly and by simulation."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lcorpp import planning
from lcorpp.decision import STRATEGIES, Robot
from lcorpp.domains import load_domain
from lcorpp.errors import DomainError
from lcorpp.reasoning import Enumeration, Reasoner, parse_plog
from lcorpp.scoring import decision_graph, episode_model, episode_totals
from lcorpp.scoring.cases import compute_joint_distribution
from lcorpp.scoring.exact_evaluation import evaluate_exactly
from lcorpp.scoring.experiment import Experiment
from lcorpp.scoring.metrics import Scores
from lcorpp.scoring.trials import run_trials
from lcorpp.simulation.simulated_classifier import NoisyChannel
from tests.decision.fakes import FakeWorld

# strategy: F1, accuracy, cost, its standard deviation, return
TABLE = {
    "paper": {
        "L": (0.692, 0.730, 0, 0, 36.80),
        "R": (0.596, 0.705, 0, 0, 32.75),
        "P": (0.813, 0.845, 13.79, 8.94, 41.38),
        "L+R": (0.731, 0.771, 0, 0, 43.32),
        "R+P": (0.817, 0.852, 10.27, 7.82, 45.98),
        "LCORPP": (0.848, 0.880, 9.28, 7.96, 51.53),
    },
    "authors": {
        "L": (0.670, 0.766, 0, 0, 42.59),
        "R": (0.596, 0.705, 0, 0, 32.75),
        "P": (0.870, 0.893, 10.95, 7.22, 52.00),
        "L+R": (0.724, 0.789, 0, 0, 46.26),
        "R+P": (0.874, 0.899, 9.56, 6.97, 54.21),
        "LCORPP": (0.891, 0.916, 8.18, 7.06, 58.45),
    },
}


@cache
def parts(preset: str):
    domain = load_domain("intention", preset=preset)
    policy = planning.solve(domain.pomdp, domain.start_beliefs()).policy
    channels = {"motion": NoisyChannel.from_domain(domain, domain.senses[0])}
    robot = Robot(channels, Enumeration(domain.program), planning.Planner(policy, domain.pomdp), domain)
    return domain, robot, channels


@cache
def exactly(preset: str) -> dict[str, Scores]:
    domain, robot, channels = parts(preset)
    return {scores.strategy: scores for scores in evaluate_exactly(domain, robot, channels, STRATEGIES)}


@pytest.mark.parametrize("preset", TABLE)
@pytest.mark.parametrize("strategy", TABLE["paper"])
def test_the_table_to_its_last_digit(preset, strategy):
    f1, accuracy, cost, cost_sd, return_ = TABLE[preset][strategy]
    found = exactly(preset)[strategy]
    assert round(found.f1.estimate, 3) == f1
    assert round(found.accuracy.estimate, 3) == accuracy
    assert round(found.cost.estimate, 2) == cost
    assert round(found.cost_sd, 2) == cost_sd
    assert round(found.return_.estimate, 2) == return_


@pytest.mark.parametrize("preset", TABLE)
def test_simulation_agrees_with_enumeration(preset):
    """3000 decisions; 36 figures in both presets, each within 4 standard errors (1 chance in 400 for all)."""
    domain, robot, channels = parts(preset)
    results, done = run_trials(Experiment(domain, robot, channels, channels, STRATEGIES, 5), 3000)
    assert done == 3000
    for result in results:
        truth = exactly(preset)[result.strategy]
        for name in ("f1", "cost", "return_"):
            interval, value = getattr(result, name), getattr(truth, name).estimate
            standard_error = (interval.high - interval.low) / 2 / 1.96
            assert abs(interval.estimate - value) <= 4 * standard_error + 1e-12, (result.strategy, name)


def test_probabilities_of_an_enumeration_sum_to_one():
    for scores in exactly("authors").values():
        assert np.sum(scores.counts) == pytest.approx(1, abs=1e-8)


@pytest.mark.parametrize("preset", TABLE)
def test_totals_of_the_further_actions_equal_the_sums_step_by_step(preset, monkeypatch):
    """Branches below 1e-12 are pruned step by step, and their number is some hundreds."""
    monkeypatch.setattr(episode_totals, "MAX_SIZE", 0)
    domain, robot, channels = parts(preset)
    for scores in evaluate_exactly(domain, robot, channels, STRATEGIES):
        other = exactly(preset)[scores.strategy]
        np.testing.assert_allclose(scores.counts, other.counts, atol=1e-9)
        assert scores.cost.estimate == pytest.approx(other.cost.estimate, abs=1e-7)
        assert scores.cost_sd == pytest.approx(other.cost_sd, abs=1e-6)
        assert scores.return_.estimate == pytest.approx(other.return_.estimate, abs=1e-7)


def test_scores_with_sparse_matrices_are_the_same(monkeypatch):
    """Those of large domains are sparse."""
    monkeypatch.setattr(episode_model, "DENSE_PAIRS", 1)
    monkeypatch.setattr(episode_totals, "MAX_SIZE", 0)
    domain, robot, channels = parts("paper")
    for scores in evaluate_exactly(domain, robot, channels, STRATEGIES):
        other = exactly("paper")[scores.strategy]
        np.testing.assert_allclose(scores.counts, other.counts, atol=1e-9)
        assert scores.return_.estimate == pytest.approx(other.return_.estimate, abs=1e-7)


def test_return_is_report_reward_minus_cost():
    """80 for right and -80 for wrong, so that return = 80 (2 accuracy - 1) - cost."""
    for scores in exactly("paper").values():
        expected = 80 * (2 * scores.accuracy.estimate - 1) - scores.cost.estimate
        assert scores.return_.estimate == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("preset", TABLE)
def test_scores_by_circuits_are_those_by_enumeration(preset):
    """The reasoner of circuits infers all posteriors at once, the enumeration one by one."""
    domain, robot, channels = parts(preset)
    compiled = replace(robot, reasoner=Reasoner(domain.program))
    for scores in evaluate_exactly(domain, compiled, channels, STRATEGIES):
        other = exactly(preset)[scores.strategy]
        np.testing.assert_allclose(scores.counts, other.counts, rtol=1e-12)
        assert scores.return_.estimate == pytest.approx(other.return_.estimate, rel=1e-12)


def test_points_are_the_same_however_many_are_extended_together(monkeypatch):
    monkeypatch.setattr(decision_graph, "MAX_TOGETHER", 3)
    domain, robot, channels = parts("paper")
    for scores in evaluate_exactly(domain, robot, channels, STRATEGIES):
        assert np.array_equal(scores.counts, exactly("paper")[scores.strategy].counts)


def test_a_planner_of_another_kind_acts_at_one_point_after_the_other():
    class OneByOne:
        """The same planner, without the methods for many beliefs."""

        def __init__(self, planner):
            self.start, self.action, self.update = planner.start, planner.action, planner.update

    domain, robot, channels = parts("paper")
    for scores in evaluate_exactly(
        domain, replace(robot, planner=OneByOne(robot.planner)), channels, STRATEGIES
    ):
        other = exactly("paper")[scores.strategy]
        np.testing.assert_allclose(scores.counts, other.counts, rtol=1e-12)
        assert scores.cost.estimate == pytest.approx(other.cost.estimate, rel=1e-12)


def test_the_joint_distribution_is_that_of_the_own_people():
    """It is computed once for equal programs of the people, and their numbers tell programs apart."""
    domain = load_domain("intention")
    people = domain.simulation.true_program
    others = parse_plog(str(people).replace("identity=student) = 3/10", "identity=student) = 2/5"))
    changed = replace(domain, simulation=replace(domain.simulation, true_program=others))
    for each, program in ((domain, people), (changed, others), (load_domain("intention"), people)):
        expected = Enumeration(program).exact(["location", "intention"])
        found = compute_joint_distribution(each, ("location", "intention"))
        assert found == pytest.approx({values: float(p) for values, p in expected.items()}, abs=1e-15)


def test_reactions_drawn_by_python_cannot_be_enumerated():
    domain, robot, channels = parts("paper")
    drawn = replace(domain.simulation, world=lambda person, rng: FakeWorld("pos"))
    with pytest.raises(
        DomainError, match=r"reaction\(\) in people\.py, so only simulated trials can score this"
    ):
        evaluate_exactly(replace(domain, simulation=drawn), robot, channels, STRATEGIES)

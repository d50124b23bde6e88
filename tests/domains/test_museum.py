"""Two senses feed one program: what each is worth, and the signals that they can be trained on."""

from functools import cache

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import confusion_matrix
from sklearn.model_selection import cross_val_predict

from lcorpp.decision import Robot, strategies
from lcorpp.domains import load_domain
from lcorpp.learning import learner
from lcorpp.planning import Planner, solve
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.scoring import Scores, evaluate_exactly
from lcorpp.scoring.metrics import find_reference
from lcorpp.simulation import NoisyChannel, Population
from lcorpp.simulation.people import SimulatedSignals


@cache
def exactly() -> dict[str, Scores]:
    domain = load_domain("museum")
    planner = Planner(solve(domain.pomdp, domain.start_beliefs(), precision=0.01))
    channels = {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}
    robot = Robot(channels, Reasoner(domain.program), planner, domain)
    rows = strategies([], list(channels))
    return {row.strategy: row for row in evaluate_exactly(domain, robot, channels, rows)}


def test_both_senses_are_better_than_each_alone():
    returns = {name: row.return_.estimate for name, row in exactly().items()}
    assert list(returns)[-3:] == ["LCORPP", "LCORPP-motion", "LCORPP-gaze"]
    assert returns["LCORPP"] > returns["LCORPP-gaze"] + 1
    assert returns["LCORPP"] > returns["LCORPP-motion"] + 2
    assert min(returns["LCORPP-gaze"], returns["LCORPP-motion"]) > returns["R+P"] + 1
    assert max(returns, key=returns.get) == "LCORPP"
    assert find_reference(list(exactly().values())).strategy == "LCORPP"


def test_without_knowledge_only_senses_of_the_wish_count():
    """L+P by hand: rates of the motion, a uniform prior; what attention means for a wish is knowledge."""
    domain = load_domain("museum")
    robot = Robot({}, Reasoner(domain.program), Planner(solve(domain.pomdp, precision=1)), domain)
    (own,) = (row.robot(robot) for row in strategies(["L+P"], ["motion", "gaze"]))
    waits = np.array([0.65, 0.2, 0.2])
    for gaze in ("robot", "exhibits"):
        evidence = domain.evidence({"group": "class"}, {"motion": "tour", "gaze": gaze})
        marginal = own.reasoner.posterior("wish", evidence)
        np.testing.assert_allclose(marginal.probabilities, waits / waits.sum(), atol=1e-12)
    assert own.reasoner.posterior("wish", domain.evidence({}, {"gaze": "robot"})) is None


def test_the_answer_by_hand():
    """P(wish | alone, morning, waits, at_robot) by Bayes' rule; the gaze acts through the attention."""
    prior = np.array([0.3, 0.25, 0.45])
    waits = np.array([0.65, 0.2, 0.2])
    attention = np.array([[0.6, 0.3, 0.1], [0.3, 0.05, 0.65], [0.05, 0.7, 0.25]])
    at_robot = attention @ [0.85, 0.05, 0.1]
    expected = prior * waits * at_robot
    facts = {"time": "morning", "crowd": "quiet", "group": "alone"}
    domain = load_domain("museum")
    evidence = domain.evidence(facts, {"motion": "tour", "gaze": "robot"})
    for reasoner in (Reasoner(domain.program), Enumeration(domain.program)):
        marginal = reasoner.posterior("wish", evidence)
        np.testing.assert_allclose(marginal.probabilities, expected / expected.sum(), atol=1e-12)


@pytest.mark.parametrize(
    ("facts", "p_tour"),
    [
        ({"group": "family", "time": "morning"}, 0.5),
        ({"group": "family", "time": "closing"}, 0.05),
        ({"group": "class", "time": "morning"}, 0.05),
        ({"group": "class", "time": "closing"}, 0.05),
    ],
)
def test_nobody_starts_a_tour_in_a_class_or_at_closing_time(facts, p_tour):
    marginal = Reasoner(load_domain("museum").program).posterior("wish", facts)
    assert marginal["tour"] == pytest.approx(p_tour)


@pytest.mark.parametrize(("name", "shape"), [("motion", (2, 100)), ("gaze", (4,))])
def test_classifiers_can_be_trained_on_the_signals(name, shape):
    """A simple classifier is about as good as the rules of the program state."""
    domain, rng = load_domain("museum"), np.random.default_rng(0)
    sense, population = domain.find_sense(name), Population(domain)
    people = [one for value in sense.classes for one in population.sample(150, rng, {sense.of: value})]
    signals = SimulatedSignals.from_domain(domain, sense).simulate(people, rng)
    assert signals.shape == (450, *shape)
    truth = [person[sense.of] for person in people]
    model = learner("summaries", interval=sense.interval) if name == "motion" else LogisticRegression()
    predicted = cross_val_predict(model, signals, truth, cv=5)
    recall = np.diag(confusion_matrix(truth, predicted, labels=sense.classes, normalize="true"))
    stated = np.diag(NoisyChannel.from_domain(domain, sense).rates)
    np.testing.assert_allclose(recall, stated, atol=0.15)


def test_signals_are_reproducible():
    domain = load_domain("museum")
    people = Population(domain).sample(20, np.random.default_rng(1))
    for sense in domain.senses:
        source = SimulatedSignals.from_domain(domain, sense)
        first, second = (source.simulate(people, np.random.default_rng(2)) for _ in range(2))
        np.testing.assert_array_equal(first, second)
        assert np.isfinite(first).all()

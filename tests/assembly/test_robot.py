"""The robot of a domain, composed by one call: it decides like one that is composed by hand."""

from itertools import product

import numpy as np
import pytest

import lcorpp
from lcorpp import Instance, Planner, Reasoner, Robot, dt_control, load_domain, solve
from lcorpp.assembly import TrainingOptions, solve_domain
from lcorpp.assembly.case import draw_case
from lcorpp.cli.new import build
from lcorpp.decision import LCORPP
from lcorpp.domains.new_folder import write_new_domain
from lcorpp.errors import DecisionError, DomainError, FileError
from lcorpp.scoring import evaluate_exactly
from lcorpp.simulation import NoisyChannel, Population
from lcorpp.values import ConfusionMatrix, Likelihood
from lcorpp.worlds import ScriptedWorld

FACTS = {"time": "afternoon", "location": "classroom"}
TRACK = np.zeros((2, 30))


@pytest.fixture(scope="module")
def robot():
    return lcorpp.load_robot("intention", cache=False)


def test_a_notebook_shows_the_parts_of_a_robot(robot):
    html = robot._repr_html_()
    assert "<td>SenseSetup channel; recall: interested 0.760, not_interested 0.710</td>" in html
    assert "<td>knowledge.plog: 5 attributes, 29 statements</td>" in html
    generic = robot.robot._repr_html_()
    assert "<td>NoisyChannel of intention" not in generic
    assert "&lt;NoisyChannel of intention; recall: interested 0.760, not_interested 0.710&gt;" in generic
    assert "<td>planner</td>" in generic


def test_the_trial_of_the_paper_as_composed_by_hand(robot):
    class Wrong:
        def classify(self, signal):
            return "not_interested"

    domain = load_domain("intention")
    planner = Planner(solve(domain.pomdp, domain.start_beliefs()))
    parts = Robot({"motion": Wrong()}, Reasoner(domain.program), planner, domain)
    person = Instance({"motion": np.zeros((2, 304))}, FACTS)
    expected = dt_control(parts, person, ScriptedWorld(["pos"] * 3))

    for label in ("zero", "not_interested"):  # the attribute's value, or the class
        episode = robot.decide(FACTS, label=label, world=["pos"] * 3)
        assert episode.report == expected.report == "interested"
        np.testing.assert_allclose(episode.prior, expected.prior)
        assert episode.evidence == expected.evidence
        assert [step.action for step in episode.steps] == [step.action for step in expected.steps]
    once = lcorpp.decide("intention", FACTS, labels={"motion": "zero"}, world=["pos"] * 3)
    assert once.report == "interested"


def test_a_person_is_simulated_where_no_world_answers(robot):
    """The reports about 200 people are right as often as exact values say; 4 standard errors are .092."""
    domain = robot.domain
    channels = {sense.name: NoisyChannel.from_domain(domain, sense) for sense in domain.senses}
    (exact,) = evaluate_exactly(domain, robot.robot, channels, (LCORPP,))
    truths = [draw_case(domain, robot.senses, {}, {}, seed=seed).truth for seed in range(200)]
    episodes = [robot.decide({}, seed=seed) for seed in range(200)]
    right = np.mean([episode.report == truth for episode, truth in zip(episodes, truths, strict=True)])
    assert right == pytest.approx(exact.accuracy.estimate, abs=0.092)
    assert {tuple(episode.labels) for episode in episodes} == {("motion",)}


def test_a_likelihood_and_no_label_change_the_prior_as_the_reasoner_says(robot):
    domain = robot.domain
    reasoner = Reasoner(domain.program)
    none = robot.decide(FACTS, world=["neg"] * 9)
    expected = domain.prior(reasoner.posterior(domain.shared, FACTS))
    np.testing.assert_allclose(none.prior, expected)
    classes = ("interested", "not_interested")
    for weights in ([0.4, 0.4], [0.9, 0.3]):  # of no weight; three times as likely
        likelihood = Likelihood(classes, np.array(weights))
        soft = lcorpp.decide("intention", FACTS, label=likelihood, world=["neg"] * 9)
        odds = none.prior[0] / none.prior[1] * weights[0] / weights[1]
        assert soft.prior[0] / soft.prior[1] == pytest.approx(odds)
    with pytest.raises(DomainError, match="this robot expects a label, see `likelihoods`"):
        robot.decide(FACTS, label=likelihood)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"facts": {"weather": "rain"}}, DomainError, "'weather' is not observed in intention"),
        ({"facts": {"time": "noon"}}, DomainError, "time cannot be 'noon'"),
        ({"facts": FACTS, "label": "two"}, DomainError, "'two' is not a label of motion"),
        (
            {"facts": FACTS, "labels": {"gaze": "zero"}},
            DomainError,
            "no sense 'gaze'; expected one of",
        ),
        ({"facts": FACTS, "label": "zero", "labels": {"motion": "one"}}, DomainError, "expected labels="),
        ({"facts": FACTS, "signals": {"moton": TRACK}}, DomainError, "no sense 'moton'; expected one of"),
        (
            {"facts": FACTS, "signals": {"motion": TRACK}},
            DomainError,
            "is a noisy channel, which has no signals",
        ),
        (
            {"facts": FACTS, "label": "zero", "signals": {"motion": TRACK}},
            DomainError,
            "a label and a signal of motion are given; expected one of them",
        ),
        ({"facts": "morning"}, DomainError, "`facts`, attribute -> value, is 'morning'; expected Mapping"),
        (
            {"facts": FACTS, "label": {"motion": "zero"}},
            DomainError,
            r"the label of the only sense \(of several: `labels`\) is .* expected str or Likelihood",
        ),
        (
            {"facts": FACTS, "labels": "zero"},
            DomainError,
            "`labels`, sense -> label, is 'zero'; exp",
        ),
        (
            {"facts": FACTS, "label": "zero", "world": ["pos"]},
            DecisionError,
            "the world has 1 answers, and the robot needs another one",
        ),
    ],
)
def test_wrong_arguments_are_named(robot, arguments, error, words):
    with pytest.raises(error, match=words):
        robot.decide(**{"world": ["pos"] * 9, **arguments})


def test_a_label_needs_its_sense_where_there_are_several():
    with pytest.raises(DomainError, match="the label 'one' is that of one sense, and the domain museum has"):
        lcorpp.decide("museum", {}, label="one")


def test_wrong_parts_are_named(tmp_path):
    for classifiers, error, words in (
        ({"gaze": "forest"}, DomainError, "no sense 'gaze'"),
        ({"motion": tmp_path / "missing.npz"}, FileError, "missing.npz"),
        (
            "forest",
            DomainError,
            "`classifiers`, sense -> file, learner or options, is 'forest'; exp",
        ),
    ):
        with pytest.raises(error, match=words):
            lcorpp.load_robot("intention", classifiers=classifiers)


def test_a_trained_classifier_receives_the_signal():
    robot = lcorpp.load_robot("intention", classifiers={"motion": TrainingOptions("summaries", tracks=60)})
    domain = robot.domain
    people = Population(domain).sample(6, np.random.default_rng(1))
    signals = robot.senses["motion"].signals.simulate(people, np.random.default_rng(2))
    labels = robot.robot.classifiers["motion"].classify_many(signals)
    assert len(set(labels)) == 2
    for signal, label in zip(signals, labels, strict=True):
        perceived = robot.decide(FACTS, signals={"motion": signal}, world=["pos"] * 20)
        given = robot.decide(FACTS, label=label, world=["pos"] * 20)
        assert perceived.labels == {"motion": label}
        np.testing.assert_allclose(perceived.prior, given.prior)


def test_the_priors_of_trained_labels_are_solved_for_where_there_are_many_values(tmp_path):
    """Six values are too many for a policy for all priors; the gap at those of these labels is measured."""
    shared, questions = ["wish=a,b,c", "room=lab,hall"], ["ask:wish:1:0.85", "find:room:1:0.8"]
    new = build("errands", ["time=noon,night"], shared, ["gaze:wish:0.8"], questions)
    loaded = write_new_domain(tmp_path / "errands", new)
    matrix = ConfusionMatrix(("a", "b", "c"), [[60, 25, 15], [10, 80, 10], [5, 5, 90]])
    program = loaded.program_for({"gaze": matrix})
    own, stated = (solve_domain(loaded, any_prior=True, program=p) for p in (program, None))
    reasoner = Reasoner(program)
    evidence = [
        loaded.evidence({"time": time}, {"gaze": label} if label else {})
        for time, label in product(("noon", "night"), ("a", "b", "c", None))
    ]
    priors = [loaded.prior(each) for each in reasoner.posteriors(loaded.shared, evidence)]
    precision = loaded.planning.solver.precision
    assert max(own.gap(prior) for prior in priors) <= precision + 1e-9
    assert max(stated.gap(prior) for prior in priors) > precision

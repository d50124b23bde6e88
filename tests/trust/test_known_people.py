"""People who are met again: what remains of them, against Bayes' rule, and how often a value is kept."""

import json

import numpy as np
import pytest

from lcorpp.assembly.strategies.trust_setup import set_up_trust
from lcorpp.decision import Robot, dt_control
from lcorpp.domains import load_domain
from lcorpp.errors import DecisionError
from lcorpp.planning import Planner, solve
from lcorpp.reasoning import Reasoner
from lcorpp.trust import Trust, TrustOptions, known_people
from lcorpp.values import Instance, Step
from tests.decision.fakes import FakeDomain, FakePlanner
from tests.trust.fakes import AskDialogue, SkyReasoner, find_noisy_likelihoods, weigh_sources

SUNNY = {"sky": "sunny"}


def make_trust(**options):
    return Trust(SkyReasoner(), FakeDomain(), AskDialogue(), FakePlanner(), options=TrustOptions(**options))


def answer(*answers):
    return [Step("ask", own, np.array([0.5, 0.5])) for own in answers]


def test_what_remains_is_the_belief_after_the_answers_with_the_probability_that_values_are_kept():
    trust = make_trust(share=0.0)
    _, before = trust.predict("wish", SUNNY, trust.used)
    trust.learn(SUNNY, answer("shake", "shake"), "ann")
    after = (weigh_sources(7, 3) @ before.rows * find_noisy_likelihoods(1, 2)).sum(axis=0)
    known = trust.recognise("ann").posterior("wish", SUNNY).probabilities
    new = trust.posterior("wish", SUNNY).probabilities
    np.testing.assert_allclose(known, (after / after.sum() + new) / 2)  # uniform prior: half are kept
    other = trust.recognise("bob").posterior("wish", SUNNY).probabilities
    np.testing.assert_array_equal(other, new)


def test_labels_of_a_later_meeting_count():
    """Against Bayes' rule for the last value and a new one, whose label the learnt model predicts."""
    trust = make_trust(share=0.0)
    trust.learn(SUNNY, answer("shake"), "ann")
    kept = trust.used.people.find("ann").belief
    rates = trust.learnt.rates[0][:, 0]
    evidence = {**SUNNY, "label": "yes"}
    new = trust.posterior("wish", evidence).probabilities
    same, other = kept @ rates, trust.learnt.pi[0] @ rates
    expected = (kept * rates + other * new) / (same + other)
    found = trust.recognise("ann").posterior("wish", evidence).probabilities
    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize("is_kept", [True, False])
def test_labels_alone_show_whether_values_are_kept(is_kept):
    """People who are never asked, seen by a classifier that is right 95 times in 100."""
    options = TrustOptions(ask_every=0)
    trust = Trust(
        SkyReasoner(0.5, 0.5, rates=(0.95, 0.05)), FakeDomain(), AskDialogue(), FakePlanner(), options=options
    )
    rng = np.random.default_rng(4)
    wishes = rng.random(40) < 0.5
    for _ in range(10):
        for person in range(40):
            wish = wishes[person] if is_kept else rng.random() < 0.5
            label = "yes" if (rng.random() < 0.95) == wish else "no"
            trust.learn({**SUNNY, "label": label}, answer(), str(person))
    kept = trust.used.people.persistence
    assert kept > 0.8 if is_kept else kept < 0.2


@pytest.mark.parametrize("is_kept", [True, False])
def test_the_probability_that_values_are_kept_is_learnt(is_kept):
    """Forty people who are met ten times each, and answer without errors."""
    trust, rng = make_trust(), np.random.default_rng(1)
    wishes = rng.random(40) < 0.5
    for _ in range(10):
        for person in range(40):
            wish = wishes[person] if is_kept else rng.random() < 0.5
            trust.learn(SUNNY, answer(*["nod" if wish else "shake"] * 2), str(person))
    kept = trust.used.people.persistence
    assert kept > 0.9 if is_kept else kept < 0.1


def test_people_without_an_id_are_not_remembered():
    one, other = make_trust(), make_trust()
    for k in range(60):
        steps = answer(*["nod", "shake"][: 1 + k % 2])
        one.learn(SUNNY, steps)
        other.learn(SUNNY, steps, f"person {k}")  # nobody comes again
    np.testing.assert_array_equal(
        one.posterior("wish", SUNNY).probabilities, other.posterior("wish", SUNNY).probabilities
    )
    np.testing.assert_array_equal(one.weights, other.weights)


def test_a_restart_continues_with_the_people():
    whole, rng = make_trust(), np.random.default_rng(2)
    meetings = [(str(rng.integers(8)), answer(*rng.choice(["nod", "shake"], 2))) for _ in range(60)]
    for person, steps in meetings[:30]:
        whole.learn(SUNNY, steps, person)
    restarted = make_trust()
    restarted.restore(json.loads(json.dumps(whole.state())))
    for trust in (whole, restarted):
        for person, steps in meetings[30:]:
            trust.learn(SUNNY, steps, person)
    assert json.dumps(restarted.state()) == json.dumps(whole.state())


def test_the_people_who_were_met_first_are_forgotten(monkeypatch):
    monkeypatch.setattr(known_people, "MAX_PEOPLE", 2)
    trust = make_trust()
    for person in ("ann", "bob", "ann", "cleo"):
        trust.learn(SUNNY, answer("nod"), person)
    people = trust.used.people
    assert [people.find(name) is None for name in ("ann", "bob", "cleo")] == [False, True, False]


@pytest.mark.parametrize("person", [17, ("ann",), b"ann"])
def test_an_id_that_is_no_string_is_refused(person):
    trust = make_trust()
    with pytest.raises(DecisionError, match="expected a string"):
        trust.learn(SUNNY, answer("nod"), person)
    with pytest.raises(DecisionError, match="expected a string"):
        trust.recognise(person)
    assert trust.n_people == 0


@pytest.fixture(scope="module")
def robot():
    domain = load_domain("intention", preset="paper")
    planner = Planner(solve(domain.pomdp, domain.start_beliefs()))
    return Robot({}, Reasoner(domain.program), planner, domain)


def test_a_meeting_without_answers_leaves_the_memory(robot):
    trust = set_up_trust(robot.domain, robot.reasoner, robot.planner)
    repeated = trust._learners[trust.forms.index("repeated")]
    facts = {"time": "morning"}
    trust.learn(facts, [Step("greet", "neg", robot.planner.start)], "ann")
    before = repeated.people.find("ann").memory
    assert any(before)
    trust.learn(facts, [], "ann")
    assert repeated.people.find("ann").memory == before


def test_a_class_of_people_is_never_certain(robot):
    trust = set_up_trust(robot.domain, robot.reasoner, robot.planner)
    steps = [Step("greet", own, robot.planner.start) for own in 5 * ["pos", "neg"]]
    for _ in range(30):
        trust.learn({"time": "morning"}, steps, "ann")
    odds = trust._learners[trust.forms.index("class")].people.find("ann").odds
    np.testing.assert_allclose(odds, [0.01, 0.99], atol=1e-3)


def test_the_form_of_a_person_is_that_of_the_recognition(robot):
    trust = set_up_trust(robot.domain, robot.reasoner, robot.planner)
    known = trust.recognise("ann")
    planner = known.make_planner()
    trust._used = trust.forms.index("class")
    prior = robot.domain.prior(known.posterior("intention", {"time": "morning"}))
    belief = planner.update(prior, "greet", "pos")
    assert belief.sum() == pytest.approx(1)


def test_a_planner_without_a_posterior_of_the_person_is_an_error(robot):
    trust = set_up_trust(robot.domain, robot.reasoner, robot.planner)
    trust._used = trust.forms.index("repeated")
    with pytest.raises(DecisionError, match="expected a call of `posterior` first"):
        trust.recognise("ann").make_planner().action(robot.planner.start)


class Stubborn:
    """A person who gives the same wrong answer to each question, always."""

    def __init__(self, answer):
        self.answer, self.n = answer, 0

    def act(self, action):
        self.n += 1
        return self.answer

    def report(self, action):
        pass


def test_a_recognised_person_with_repeated_answers_is_asked_less(robot):
    """Thirty people with the same answers at each of ten meetings: `repeated` is the form that fits."""
    domain, trust = robot.domain, set_up_trust(robot.domain, robot.reasoner, robot.planner)
    rng = np.random.default_rng(3)
    answers = rng.choice(["pos", "neg"], 30)
    asked = np.zeros((10, 30))
    for meeting in range(10):
        for person in range(30):
            known = trust.recognise(str(person))
            own = Robot({}, known, known.make_planner(), domain)
            world = Stubborn(answers[person])
            episode = dt_control(own, Instance({}, {"time": "morning", "location": "library"}), world)
            trust.learn(episode.evidence, episode.steps, str(person))
            asked[meeting, person] = world.n
    assert trust.form == "repeated"
    assert asked[0].min() >= 1
    assert asked[-1].mean() < asked[0].mean() / 2

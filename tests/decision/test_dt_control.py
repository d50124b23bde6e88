"""Algorithm 2 with parts whose numbers are computed by hand."""

import numpy as np
import pytest

from lcorpp.decision import Robot, dt_control
from lcorpp.errors import DecisionError
from lcorpp.values import Belief
from tests.decision.fakes import (
    FakeClassifier,
    FakeDomain,
    FakePlanner,
    FakeReasoner,
    FakeWorld,
    make_instance,
)


def test_a_decision_step_by_step():
    reasoner, world = FakeReasoner(), FakeWorld("nod", "nod")
    episode = dt_control(
        Robot({"eyes": FakeClassifier()}, reasoner, FakePlanner(), FakeDomain()),
        make_instance(0, "sunny"),
        world,
    )
    assert episode.labels == {"eyes": "yes"}
    assert reasoner.queries == [("wish", {"sky": "sunny", "label": "yes"})]
    assert episode.marginal is not None
    assert episode.marginal["yes"] == pytest.approx(0.8)
    assert episode.prior == pytest.approx([0.8, 0.2])
    # .8 : .2 is 4 : 1; a nod makes it 12 : 1, which is above .9
    assert [step.action for step in episode.steps] == ["ask", "say yes"]
    assert episode.steps[0].belief == pytest.approx([12 / 13, 1 / 13])
    assert episode.steps[-1].observation is None
    assert world.done == ["ask", "say yes"]
    assert episode.report == "yes"


def test_answers_overrule_a_wrong_label():
    episode = dt_control(
        Robot({"eyes": FakeClassifier()}, FakeReasoner(), FakePlanner(), FakeDomain()),
        make_instance(1),
        FakeWorld("nod", "nod", "nod", "nod"),
    )
    # 1 : 4 needs four nods to reach 81 : 4
    assert [step.observation for step in episode.steps] == ["nod", "nod", "nod", "nod", None]
    assert (episode.labels["eyes"], episode.report) == ("no", "yes")


def test_a_policy_that_never_reports_is_an_error():
    world = FakeWorld(*["nod", "shake"] * 10)
    robot = Robot({"eyes": FakeClassifier()}, FakeReasoner(), FakePlanner(), FakeDomain())
    with pytest.raises(DecisionError, match="no report after 7 actions; the last one was 'ask'"):
        dt_control(robot, make_instance(1), world, max_steps=7)


def test_a_terminal_state_ends_the_decision_without_a_report():
    class Leaving(FakeDomain):
        def is_terminal(self, belief: Belief) -> bool:
            return bool(belief[0] > 0.85)

    episode = dt_control(
        Robot({"eyes": FakeClassifier()}, FakeReasoner(), FakePlanner(), Leaving()),
        make_instance(0),
        FakeWorld("nod"),
    )
    assert episode.report is None
    assert [step.action for step in episode.steps] == ["ask"]


def test_an_episode_cannot_be_changed():
    episode = dt_control(
        Robot({"eyes": FakeClassifier()}, FakeReasoner(), FakePlanner(), FakeDomain()),
        make_instance(0),
        FakeWorld("nod"),
    )
    with pytest.raises(TypeError):
        episode.evidence["sky"] = "blue"  # type: ignore[index]
    with pytest.raises(ValueError, match="read-only"):
        episode.marginal.probabilities[0] = 1  # type: ignore[union-attr]


def test_beliefs_of_an_episode_are_distributions():
    episode = dt_control(
        Robot({"eyes": FakeClassifier()}, FakeReasoner(), FakePlanner(), FakeDomain()),
        make_instance(1),
        FakeWorld("shake"),
    )
    for step in episode.steps:
        assert np.sum(step.belief) == pytest.approx(1)


@pytest.mark.parametrize(
    ("part", "wrong", "words"),
    [
        ("classifiers", "lstm", "the classifiers of a robot are 'lstm'; expected sense -> classifier"),
        (
            "classifiers",
            {"eyes": "lstm"},
            "the classifier of a robot is 'lstm'; expected an object with clas",
        ),
        ("classifiers", {"eyes": FakeClassifier}, "expected an object with classify"),
        ("reasoner", None, "the reasoner of a robot is None; expected an object with posterior"),
        ("planner", FakeReasoner(), "expected an object with start, action, update"),
        ("domain", "intention", "the domain of a robot is 'intention'; expected an object with shared, val"),
    ],
)
def test_a_wrong_part_is_rejected_at_once(part, wrong, words):
    parts = {"classifiers": {}, "reasoner": FakeReasoner(), "planner": FakePlanner()}
    with pytest.raises(DecisionError, match=words):
        Robot(**{**parts, "domain": FakeDomain(), part: wrong})

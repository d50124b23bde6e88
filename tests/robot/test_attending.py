"""Forecasts of decisions against the exact evaluation, and the choice among people who wait."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp import Distribution
from lcorpp.decision import Robot
from lcorpp.errors import NoReportError
from lcorpp.planning import Planner, evaluate
from lcorpp.robot.attending import Attention, forecast_decision


@pytest.fixture(scope="module")
def robot(parts):
    full = parts[0].robot
    return Robot({}, full.reasoner, full.planner, full.domain)


def prior(robot, p):
    return robot.domain.prior(Distribution(robot.domain.values, np.array([p, 1 - p])))


@pytest.mark.parametrize("p", [0.1, 0.4, 0.9])
def test_the_forecast_agrees_with_the_return(robot, p):
    """return = 80 P(right) - 80 P(wrong) - seconds without discount."""
    forecast, other = (
        forecast_decision(robot.domain, robot, robot.planner.pomdp, prior(robot, p), value)
        for value in ("interested", "not_interested")
    )
    right = forecast.value + other.value
    undiscounted = 80 * (2 * right - 1) - forecast.seconds
    patient = replace(robot.domain.pomdp, discount=0.9995)
    policy = replace(robot.planner.policy, fingerprint=patient.fingerprint)
    bounds = evaluate(patient, policy, prior(robot, p), precision=0.1)
    assert bounds.upper - bounds.lower < 1
    assert bounds.lower - 0.5 < undiscounted < bounds.upper + 0.5  # the discount takes .2
    assert 0 <= forecast.value <= p + 1e-9


def test_a_policy_that_never_reports_is_named(robot):
    class Asking:
        start = robot.planner.start
        action = staticmethod(lambda belief: "greet")
        update = staticmethod(lambda belief, action, observation: belief)

    with pytest.raises(NoReportError, match="the policy: no report after 500 actions"):
        forecast_decision(
            robot.domain,
            replace(robot, planner=Asking()),
            robot.planner.pomdp,
            prior(robot, 0.4),
            "interested",
        )


def test_the_more_probable_of_two_people_comes_first(parts, robot):
    attention = Attention(parts[0].domain, "interested")
    attention.update("a", robot, prior(robot, 0.3), 1.0)
    attention.update("b", robot, prior(robot, 0.6), 1.0)
    assert attention.choose() == "b"
    attention.attend("b")
    assert attention.choose() == "a"
    attention.note_absence({"b": 3.0})
    assert attention.choose() is None


def test_people_about_whom_the_robot_need_not_ask_come_first(parts, robot):
    attention = Attention(parts[0].domain, "interested")
    attention.update("a", robot, prior(robot, 0.6), 1.0)
    attention.update("b", robot, prior(robot, 0.001), 1.0)
    assert attention.choose() == "b"


def test_another_planner_is_taken_as_it_is(parts, robot):
    class Own:
        start = robot.planner.start

        def action(self, belief):
            raise AssertionError("an own planner may have state")

        update = action

    own = Robot({}, robot.reasoner, Own(), robot.domain)
    attention = Attention(parts[0].domain, "interested")
    attention.update("a", own, prior(robot, 0.6), 1.0)
    assert attention.choose() == "a"
    assert isinstance(robot.planner, Planner)


def test_the_presence_of_people_is_learnt(parts):
    """Three people for half of the time, and never more: half of those who come find no room."""
    attention = Attention(parts[0].domain, "interested")
    for second in range(0, 100, 2):
        attention.note_presence(3, second)
        attention.note_presence(2, second + 1)
    assert attention.served.share == pytest.approx(0.25, abs=0.01)

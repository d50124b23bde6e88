"""A world that repeats earlier steps ends a decision at the first step that differs."""

import pytest

from lcorpp.worlds.scripted import EndOfStepsError, RepeatedWorld

STEPS = (("greet", "pos"), ("turn", "neg"), ("report_interested", None))


def test_the_observations_of_the_steps_are_repeated():
    world = RepeatedWorld(STEPS)
    assert [world.act("greet"), world.act("turn")] == ["pos", "neg"]
    world.report("report_interested")
    assert world.action == world.expected == "report_interested"


@pytest.mark.parametrize(
    ("done", "action", "expected"),
    [
        ((), "turn", "greet"),
        (("greet",), "greet", "turn"),
        (("greet", "turn"), "turn", "report_interested"),
    ],
)
def test_another_action_ends_the_decision(done, action, expected):
    world = RepeatedWorld(STEPS)
    for earlier in done:
        world.act(earlier)
    with pytest.raises(EndOfStepsError):
        world.act(action)
    assert (world.action, world.expected) == (action, expected)


def test_an_action_after_the_steps_ends_the_decision_and_no_error_handler_of_a_robot_catches_it():
    world = RepeatedWorld(STEPS[:1])
    world.act("greet")
    assert not issubclass(EndOfStepsError, Exception)
    with pytest.raises(EndOfStepsError):
        world.act("turn")
    assert (world.action, world.expected) == ("turn", None)

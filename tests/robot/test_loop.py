"""The robot's loop against the stand-in: whole decisions, several people, and every kind of failure."""

import threading
from contextlib import contextmanager

import pytest

from lcorpp.assembly.strategies.trust import TRUST
from lcorpp.decision.strategies import LCORPP
from lcorpp.errors import ActionFailedError, ConnectionLostError, NoReportError, WorldError
from lcorpp.robot.connecting import connect
from lcorpp.robot.loop import MAX_FAILURES, RobotLoop
from lcorpp.robot.reading import read_robot_config
from tests.worlds.ros.stand_in import BASE, StandIn, beliefs, published, robot_toml
from tests.worlds.ros.test_rosbridge import wait_until


def navigate_always(timeout):
    """Return the changes with which every action navigates, so that the first one meets a fault."""
    server = 'name = "/navigate_to_pose"\ntype = "nav2_msgs/NavigateToPose"'
    skill = f'skill = "navigate"\n{server}\ntimeout = {timeout}'
    names = {"move": "move_forward", "greet": "greet", "turn": "turn"}
    return {key: f"[actions.{name}]\n{skill}" for key, name in names.items()}


@contextmanager
def run_loop(folder, parts, changes=None, strategy=LCORPP, **options):
    stand_in = StandIn(**options)
    file = folder / "robot.toml"
    file.write_text(robot_toml(stand_in.url, **(changes or {})))
    config, _ = read_robot_config(file)
    connection = connect(config.connection)
    try:
        yield stand_in, RobotLoop(config, *parts, strategy, connection)
    finally:
        connection.close()
        stand_in.close()


def test_a_whole_decision(folder, parts):
    with run_loop(folder, parts) as (stand_in, loop):
        (decision,) = loop.run(1)
        episode = decision.episode
        assert (decision.person, decision.error) == ("7", None)
        assert decision.facts["location"] == "classroom"
        assert episode.report == "interested"
        assert {observation for _, observation in episode.answers} == {"pos"}
        assert "motion" in episode.labels
        wait_until(lambda: published(stand_in, "/intents"))
        assert beliefs(stand_in)[-1]["action"] == "report_interested"
        assert beliefs(stand_in)[0]["action"] is None
        assert published(stand_in, "/humans/persons/p7/engagement_status")[-1] == {"level": 3}


def test_all_people_are_decided_about_once(folder, parts):
    people = {"7": (0.0, 3.0), "8": (1.0, 3.0), "9": (-1.0, 3.0)}
    with run_loop(folder, parts, people=people) as (_, loop):
        decisions = list(loop.run(3))
        assert sorted(decision.person for decision in decisions) == ["7", "8", "9"]


def test_a_failed_action_is_a_failed_decision_and_the_robot_gives_up_after_some(folder, parts):
    people = {str(number): (number - 3.0, 4.0) for number in range(7)}
    with run_loop(folder, parts, navigate_always(60), people=people, navigation="abort") as (stand_in, loop):
        running = loop.run()
        decisions = [next(running) for _ in range(MAX_FAILURES)]
        with pytest.raises(
            WorldError, match=f"{MAX_FAILURES} decisions in a row have failed; the last"
        ) as caught:
            next(running)
        assert "; at the end: an order to stop was sent" in str(caught.value)
        assert all(isinstance(decision.error, ActionFailedError) for decision in decisions)
        wait_until(lambda: stand_in.stops >= MAX_FAILURES and stand_in.cancels >= MAX_FAILURES)


def test_a_person_who_says_nothing_is_left_after_some_actions(folder, parts):
    quick = '[actions.move_forward]\nskill = "listen"\nlisten = 0.01'
    changes = {"domain": 'domain = "heard"\nmax_actions = 4', "move": quick}
    for name in ("greet", "turn"):
        changes[name] = quick.replace("move_forward", name)
    with run_loop(folder, parts, changes, answer=None) as (_, loop):
        (decision,) = loop.run(1)
        assert isinstance(decision.error, NoReportError)
        assert decision.episode is None


def test_a_lost_connection_fails_the_decision_and_the_loop_goes_on(folder, parts):
    people = {"7": (0.0, 3.0), "8": (1.0, 3.0)}
    with run_loop(folder, parts, navigate_always(60), people=people, navigation="hang") as (stand_in, loop):
        running = loop.run(2)

        def cut():
            wait_until(lambda: stand_in.goals)
            stand_in.navigation = "succeed"
            stand_in.server.cut()

        threading.Thread(target=cut, daemon=True).start()
        lost, decided = running
        assert isinstance(lost.error, ConnectionLostError)
        assert decided.episode.report == "interested"
        wait_until(lambda: stand_in.stops and stand_in.cancels)


def test_a_connection_that_does_not_come_back_ends_the_loop(folder, parts):
    with run_loop(folder, parts, navigate_always(60), navigation="hang") as (stand_in, loop):

        def kill():
            wait_until(lambda: stand_in.goals)
            stand_in.close()

        threading.Thread(target=kill, daemon=True).start()
        with pytest.raises(
            ConnectionLostError,
            match="could not be used within 2 s; at the end: no order to stop can be sent",
        ):
            list(loop.run())


def test_the_last_decision_ends_after_the_stop_was_sent(folder, parts):
    with run_loop(folder, parts, navigate_always(60), navigation="hang") as (stand_in, loop):

        def cut():
            wait_until(lambda: stand_in.goals)
            stand_in.server.cut()

        threading.Thread(target=cut, daemon=True).start()
        (lost,) = loop.run(1)
        assert isinstance(lost.error, ConnectionLostError)
        assert stand_in.stops
        assert stand_in.cancels


def test_messages_of_another_type_are_left_out_and_the_loop_goes_on(folder, parts, caplog):
    with run_loop(folder, parts) as (stand_in, loop):
        wait_until(lambda: stand_in.server.is_subscribed("/people"))
        stand_in.server.publish("/people", {"data": "x"})
        (decision,) = loop.run(1)
        assert decision.error is None
        assert "/people: a message that is not people_msgs/People is left out" in caplog.text


def test_trust_learns_from_each_person(folder, parts):
    people = {"7": (0.0, 3.0), "8": (1.0, 3.0)}
    with run_loop(folder, parts, strategy=TRUST, people=people) as (_, loop):
        decisions = list(loop.run(2))
        assert [decision.n_learnt for decision in decisions] == [0, 1]


@pytest.mark.parametrize("permanent", [True, False])
def test_trust_recognises_a_person_whose_id_is_permanent(folder, parts, permanent):
    people = BASE["people"] + f"\npermanent_ids = {str(permanent).lower()}"
    changes = {"people": people}
    with run_loop(folder, parts, changes, strategy=TRUST) as (_, loop):
        (decision,) = loop.run(1)
        assert decision.person_id == ("7" if permanent else None)
        known = loop.session.trust.used.people.find("7")
        assert (known is not None) == permanent


def test_a_fact_of_a_topic(folder, parts):
    changes = {"facts": '[facts]\nlocation = {{ topic = "/place" }}'}
    with run_loop(folder, parts, changes) as (stand_in, loop):
        wait_until(lambda: stand_in.server.is_subscribed("/place"))
        stand_in.server.publish("/place", {"data": "library"})
        (decision,) = loop.run(1)
        assert decision.facts == {"location": "library"}


def test_a_text_that_is_no_value_of_a_fact_makes_it_unknown(folder, parts):
    changes = {"facts": '[facts]\nlocation = {{ topic = "/place" }}'}
    with run_loop(folder, parts, changes) as (stand_in, loop):
        wait_until(lambda: stand_in.server.is_subscribed("/place"))
        stand_in.server.publish("/place", {"data": "kitchen"})
        (decision,) = loop.run(1)
        assert decision.facts == {}

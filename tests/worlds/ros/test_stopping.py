"""Sentences about a stop state what is known, and no more."""

import pytest

from lcorpp.errors import ActionFailedError, ConnectionLostError
from lcorpp.worlds.ros import stopping
from lcorpp.worlds.ros.skills import Body
from lcorpp.worlds.ros.stop_report import Cancellation, StopReport, describe_missing_result
from lcorpp.worlds.ros.stopping import StopOrders

SENT = "an order to stop was sent (a Twist of zeros and the cancellation of all goals of /arm"


class Robot:
    """A connection and a perception with what they know: receivers, cancellations (or errors) and speeds."""

    measures_speed = True

    def __init__(self, receivers, cancellations, speeds=()):
        self.receivers, self.cancellations, self.speeds = receivers, dict(cancellations), list(speeds)
        self.sent = []

    def publish(self, topic, kind, message):
        if self.receivers == "lost":
            raise ConnectionLostError("lost")
        self.sent.append((topic, message))

    def count_receivers(self, topic):
        return self.receivers

    def cancel_goals(self, name, *, timeout):
        known = self.cancellations[name]
        if isinstance(known, Exception):
            raise known
        return known

    def find_speed(self, since):
        return self.speeds.pop(0) if self.speeds else None

    def stop(self, **options):
        orders = StopOrders("/cmd_vel", ("/arm", "/base"))
        return orders.stop(Body(self, self, "7"), **options)


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    """A clock that advances by what is slept."""
    now = [0.0]
    monkeypatch.setattr(stopping, "monotonic", lambda: now[0])
    monkeypatch.setattr(stopping, "sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))


@pytest.mark.parametrize(
    ("robot", "sentence"),
    [
        (
            Robot(1, {"/arm": Cancellation.CONFIRMED, "/base": Cancellation.NO_REPLY}, [None, 0.3, 0.1, 0.0]),
            f"{SENT} and /base); /arm has confirmed the cancellation; /base has not confirmed the"
            " cancellation so far; odometry shows that the robot stands still",
        ),
        (
            Robot(0, {"/arm": ActionFailedError("no"), "/base": Cancellation.NOT_SENT}, [0.3] * 50),
            f"{SENT}); no node receives the Twist; /arm has not accepted the cancellation; the cancellation"
            " could not be sent to /base; by odometry the robot still moves (0.30 m/s plus rad/s)",
        ),
        (
            Robot(None, {"/arm": ConnectionLostError("lost"), "/base": Cancellation.CONFIRMED}),
            "an order to stop was sent (a Twist of zeros); the cancellation could not be sent to /arm; the"
            " cancellation could not be sent to /base; whether the robot stands still is not measured",
        ),
        (
            Robot(None, dict.fromkeys(("/arm", "/base"), Cancellation.UNCONFIRMED)),
            f"{SENT} and /base); ROS 1 does not confirm cancellations; whether the robot stands still is not"
            " measured",
        ),
        (
            Robot("lost", {}),
            "no order to stop can be sent, as there is no connection; the next one is sent first if the"
            " connection comes back",
        ),
    ],
)
def test_the_sentence_states_what_is_known(robot, sentence):
    assert str(robot.stop()) == sentence


def test_without_a_connection_the_last_order_is_named_and_at_the_end_none_is_promised():
    robot, orders = (
        Robot(None, dict.fromkeys(("/arm", "/base"), Cancellation.CONFIRMED)),
        StopOrders("/cmd_vel"),
    )
    orders.stop(Body(robot, robot, "7"))
    robot.receivers = "lost"
    report = orders.stop(Body(robot, robot, "7"), is_final=True)
    expected = "no order to stop can be sent, as there is no connection; the last one was sent 0.3 s ago"
    assert str(report) == expected


def test_orders_are_settled_if_each_server_has_confirmed_or_cannot():
    for known, is_settled in (
        (Cancellation.CONFIRMED, True),
        (Cancellation.UNCONFIRMED, True),
        (Cancellation.NO_REPLY, False),
        (Cancellation.FAILED, False),
        (Cancellation.NOT_SENT, False),
    ):
        report = StopReport(True, None, {"/arm": Cancellation.CONFIRMED, "/base": known})
        assert report.is_settled is is_settled
    assert not StopReport(False).is_settled


@pytest.mark.parametrize(
    ("known", "has_ended", "end"),
    [
        (
            Cancellation.NO_REPLY,
            False,
            "its cancellation was sent; /go has not confirmed the cancellation so far",
        ),
        (Cancellation.CONFIRMED, False, "its cancellation was sent; /go has confirmed the cancellation"),
        (Cancellation.NO_REPLY, True, "its cancellation was sent; it has ended since"),
        (Cancellation.NOT_SENT, False, "the cancellation could not be sent to /go"),
    ],
)
def test_a_goal_without_a_result_is_not_said_to_be_cancelled(known, has_ended, end):
    text = describe_missing_result("/go", 2.0, known, has_ended=has_ended)
    assert text == f"/go has no result within 2 s; {end}"

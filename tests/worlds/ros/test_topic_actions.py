"""Goals of ROS 1 by topics that a fake server serves: what is known about their end."""

import pytest

from lcorpp.errors import ActionFailedError
from lcorpp.worlds.ros import topic_actions
from lcorpp.worlds.ros.connection import Subscription
from lcorpp.worlds.ros.topic_actions import run_topic_action

PREEMPTED, SUCCEEDED, ACTIVE = 2, 3, 1


class Server:
    """A connection to an action server that replies to a goal, and to its cancellation, with these messages.

    A reply is a state, or the content of a message of the states.
    """

    version = 1

    def __init__(self, to_goal=(), to_cancellation=(), receivers=None):
        self.replies = {"goal": to_goal, "cancel": to_cancellation}
        self.states, self.results = Subscription(), Subscription()
        self.states.put({"status_list": None})  # a server that is there
        self.receivers, self.cancelled = receivers, []

    def advertise(self, topic, kind):
        pass

    def count_receivers(self, topic):
        return self.receivers

    def subscribe(self, topic, kind, *, max_messages=64):
        return self.states if topic.endswith("status") else self.results

    def publish(self, topic, kind, message):
        name = topic.rpartition("/")[2]
        key = message["goal_id"]["id"] if name == "goal" else message["id"]
        if name == "cancel":
            self.cancelled.append(key)
        for reply in self.replies[name]:
            status = {"goal_id": {"id": key}, "status": reply} if isinstance(reply, int) else reply
            self.states.put({"status_list": [status]})


def run(server):
    return run_topic_action(server, "/base", "x/Go", {}, timeout=0.1)


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(topic_actions, "RESULT_TIMEOUT", 0.05)


def test_a_goal_succeeds_though_messages_are_malformed():
    assert run(Server([None, 3, {"goal_id": 1}, {"goal_id": {}, "status": []}, ACTIVE, SUCCEEDED])) == {}


@pytest.mark.parametrize(
    ("server", "known"),
    [
        (Server([ACTIVE]), "its cancellation was sent; ROS 1 does not confirm cancellations"),
        (Server([ACTIVE], [PREEMPTED]), "its cancellation was sent; it has ended since"),
        (Server([ACTIVE], receivers=1), "its cancellation was sent; ROS 1 does not confirm cancellations"),
        (Server([ACTIVE], receivers=0), "the cancellation could not be sent to /base"),
    ],
)
def test_a_goal_without_a_result_states_what_is_known_of_its_cancellation(server, known):
    with pytest.raises(ActionFailedError, match=f"^/base has no result within 0.1 s; {known}$"):
        run(server)
    assert len(server.cancelled) == 1

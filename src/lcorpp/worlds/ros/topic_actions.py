"""Actions of ROS 1, which are topics of goals, cancellations, states and results.

Source: the actionlib protocol, actionlib_msgs/GoalStatus.
"""

from __future__ import annotations

import itertools
import os
from time import monotonic, time
from typing import Any

from lcorpp.errors import ActionFailedError
from lcorpp.worlds.ros.connection import Message, RosConnection, Subscription, name_type
from lcorpp.worlds.ros.stop_report import Cancellation, describe_missing_result

SUCCEEDED = 3
FAILED = {2: "was cancelled by others", 4: "was aborted", 5: "was refused", 8: "was cancelled by others"}
"""Final states of a goal that is not reached: PREEMPTED, ABORTED, REJECTED, RECALLED."""
FINAL = {SUCCEEDED, *FAILED}
POLL, RESULT_TIMEOUT = 0.05, 0.5
"""Seconds between two looks at the states, and until a result counts as lost after the final state."""
SERVER_TIMEOUT = 3.0
"""Seconds within which a server publishes its states; it does so several times a second."""

_numbers = itertools.count(1)


def run_topic_action(
    connection: RosConnection, name: str, kind: str, goal: Message, *, timeout: float
) -> Message:
    """Send a goal to an action server of ROS 1 and return the result; as `RosConnection.run_action`.

    Args:
        kind: of the action, e.g. "move_base_msgs/MoveBase".
    """
    end, kind = monotonic() + timeout, name_type(kind, 1, "action")
    connection.advertise(f"{name}/cancel", "actionlib_msgs/GoalID")
    connection.advertise(f"{name}/goal", f"{kind}ActionGoal")
    with (
        connection.subscribe(f"{name}/status", "actionlib_msgs/GoalStatusArray", max_messages=1) as states,
        connection.subscribe(f"{name}/result", f"{kind}ActionResult") as results,
    ):
        if states.wait(min(timeout, SERVER_TIMEOUT)) is None:
            raise ActionFailedError(
                f"there is no action server {name}: nothing is published on {name}/status"
            )
        key = f"lcorpp-{os.getpid()}-{next(_numbers)}-{time():.3f}"
        message = {"goal_id": {"stamp": {"secs": 0, "nsecs": 0}, "id": key}, "goal": goal}
        connection.publish(f"{name}/goal", f"{kind}ActionGoal", message)
        status, known = None, Cancellation.NOT_SENT
        try:
            status, result = _wait_for_end(key, states, results, end)
        finally:
            if status is None:  # by its id, which the server remembers if it has not received the goal yet
                known = cancel_topic_goals(connection, name, key)
        if status is None:
            late, _ = _wait_for_end(key, states, results, monotonic() + RESULT_TIMEOUT)
            has_ended = late is not None
            raise ActionFailedError(describe_missing_result(name, timeout, known, has_ended=has_ended))
    if status["status"] == SUCCEEDED:
        return result
    how = FAILED.get(status["status"], f"ended in the state {status['status']}")
    reason = f": {status['text']}" if status.get("text") else ""
    raise ActionFailedError(f"the goal of {name} {how}{reason}")


def _wait_for_end(
    key: str, states: Subscription, results: Subscription, end: float
) -> tuple[Message | None, Message]:
    """Return the final status of a goal and its result; None if it does not end in time.

    The server repeats the final status for some seconds. It counts if the result, which is sent once, does
    not come: it is lost if the server has not found this receiver yet.
    """
    last_status, deadline = None, end
    while (left := deadline - monotonic()) > 0:
        result = results.wait(min(left, POLL))
        if result is not None and (status := _find_status([result.get("status")], key)) is not None:
            content = result.get("result")
            return status, content if isinstance(content, dict) else {}
        for message in states.take():
            status = _find_status(message.get("status_list"), key)
            if status is not None and status["status"] in FINAL and last_status is None:
                last_status, deadline = status, min(end, monotonic() + RESULT_TIMEOUT)
    return last_status, {}


def _find_status(statuses: Any, key: str) -> Message | None:
    """Return the status of a goal; what is not actionlib_msgs/GoalStatus is left out."""
    for status in statuses if isinstance(statuses, list | tuple) else ():
        is_status = isinstance(status, dict) and isinstance(status.get("goal_id"), dict)
        if is_status and type(status.get("status")) is int and status["goal_id"].get("id") == key:
            found: Message = status
            return found
    return None


def cancel_topic_goals(connection: RosConnection, name: str, key: str = "") -> Cancellation:
    """Request the cancellation of a goal of an action server of ROS 1; an empty id means all goals."""
    empty = {"stamp": {"secs": 0, "nsecs": 0}, "id": key}
    connection.publish(f"{name}/cancel", "actionlib_msgs/GoalID", empty)
    has_receiver = connection.count_receivers(f"{name}/cancel") != 0
    return Cancellation.UNCONFIRMED if has_receiver else Cancellation.NOT_SENT

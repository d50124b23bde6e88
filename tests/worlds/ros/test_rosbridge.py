"""The rosbridge client against the server of the examples, with faults: cuts, silence, malformed messages."""

import threading
import time

import pytest

from lcorpp.errors import ActionFailedError, ConnectionLostError
from lcorpp.worlds.ros.rosbridge import RosbridgeConnection
from lcorpp.worlds.ros.rosbridge_messages import read_result
from lcorpp.worlds.ros.stop_report import Cancellation
from tests.worlds.ros.stand_in import StandIn, bridge

WAIT = 10.0
"""Seconds to wait for what should come at once, also on a busy machine."""


@pytest.fixture
def server():
    made = bridge.BridgeServer()
    yield made
    made.close()


@pytest.fixture
def connection(server):
    made = RosbridgeConnection(server.url, timeout=WAIT)
    yield made
    made.close()


def wait_until(condition, describe=lambda: "it did not come true", timeout=WAIT):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, describe()
        time.sleep(0.01)


def is_connected(connection):
    try:
        connection.check()
    except ConnectionLostError:
        return False
    return True


def test_messages_arrive_in_order(server, connection):
    received = connection.subscribe("/numbers", "std_msgs/Int32")
    wait_until(lambda: server.is_subscribed("/numbers"))
    for number in range(50):
        server.publish("/numbers", {"data": number})
    assert [received.wait(WAIT)["data"] for _ in range(50)] == list(range(50))
    assert received.dropped == 0


def test_a_slow_reader_gets_the_newest_messages(server, connection):
    received = connection.subscribe("/numbers", "std_msgs/Int32", max_messages=8)
    last = connection.subscribe("/last", "std_msgs/Int32")
    wait_until(lambda: server.is_subscribed("/last"))
    for number in range(1000):
        server.publish("/numbers", {"data": number})
    server.publish("/last", {})
    last.wait(WAIT)
    assert [message["data"] for message in received.take()] == list(range(992, 1000))
    assert received.dropped == 992
    assert server.received[0]["queue_length"] == 8  # the server drops, too


def test_types_are_named_as_the_version_of_ros_names_them(server):
    for version, name in ((1, "std_msgs/String"), (2, "std_msgs/msg/String")):
        connection = RosbridgeConnection(server.url, version=version, timeout=WAIT)
        connection.publish("/say", "std_msgs/String", {"data": "hello"})
        wait_until(lambda: server.received and server.received[-1]["op"] == "publish")
        assert server.received[-2] == {"op": "advertise", "topic": "/say", "type": name}
        connection.close()
        server.received.clear()


def test_a_service_responds_fails_or_is_silent(server, connection):
    server.serve_service("/double", lambda request: {"data": 2 * request["data"]})
    assert connection.call_service("/double", "x/Y", {"data": 4}, timeout=WAIT) == {"data": 8}
    with pytest.raises(ActionFailedError, match=r"the service /nobody has not responded within 0.1 s"):
        connection.call_service("/nobody", "x/Y", {}, timeout=0.1)


def test_a_goal_succeeds_is_aborted_or_is_cancelled_in_time(server, connection):
    outcomes = {"reach": (bridge.SUCCEEDED, {"n": 3}), "abort": (bridge.ABORTED, {})}
    cancelled = threading.Event()

    def run(goal):
        if goal.content["do"] == "hang":
            cancelled_in_time = goal.is_cancelled.wait(WAIT)
            cancelled.set() if cancelled_in_time else None
            return bridge.CANCELLED, {}
        return outcomes[goal.content["do"]]

    server.serve_action("/go", run)
    assert connection.run_action("/go", "x/Go", {"do": "reach"}, timeout=WAIT) == {"n": 3}
    with pytest.raises(ActionFailedError, match="the goal of /go was refused or aborted"):
        connection.run_action("/go", "x/Go", {"do": "abort"}, timeout=WAIT)
    with pytest.raises(
        ActionFailedError, match=r"/go has no result within 0.2 s; its cancellation was sent;"
    ):
        connection.run_action("/go", "x/Go", {"do": "hang"}, timeout=0.2)
    assert cancelled.wait(WAIT)


def test_a_goal_that_is_accepted_after_its_time_out_is_cancelled(server, connection):
    ended = threading.Event()

    def run(goal):
        if goal.is_cancelled.wait(WAIT):
            ended.set()
        return bridge.CANCELLED, {}

    server.serve_action("/go", run)
    server.accept_delay = 0.4
    with pytest.raises(ActionFailedError, match=r"no result within 0.2 s; its cancellation was sent; "):
        connection.run_action("/go", "x/Go", {}, timeout=0.2)
    assert ended.wait(WAIT)


def test_a_refused_cancellation_is_not_confirmed(server, connection):
    assert connection.cancel_goals("/go", timeout=WAIT) is Cancellation.CONFIRMED  # no goals: nothing is left
    replies = iter(
        ['"result": false, "values": "no service"', '"result": true, "values": {"return_code": 1}']
    )

    def answer(client, message):
        client.send(f'{{"op": "service_response", "id": "{message["id"]}", {next(replies)}}}')

    server._answer = answer
    assert connection.cancel_goals("/go", timeout=WAIT) is Cancellation.FAILED
    assert connection.cancel_goals("/go", timeout=WAIT) is Cancellation.FAILED
    server._answer = lambda client, message: None
    assert connection.cancel_goals("/go", timeout=0.05) is Cancellation.NO_REPLY
    with pytest.raises(
        ActionFailedError, match="cancellation was sent; /go has not confirmed the cancellation"
    ):
        connection.run_action("/go", "x/Go", {}, timeout=0.05)


def test_a_cancellation_that_is_confirmed_before_the_goal_ends(server, connection):
    ends = threading.Event()
    server.serve_action("/go", lambda goal: (ends.wait(WAIT), (bridge.CANCELLED, {}))[1])
    with pytest.raises(ActionFailedError, match=r"was sent; /go has confirmed the cancellation$"):
        connection.run_action("/go", "x/Go", {}, timeout=0.05)
    ends.set()


@pytest.mark.parametrize(
    ("reply", "outcome"),
    [
        ({"values": {"n": 1}, "status": 4, "result": True}, {"n": 1}),
        ({"values": {"n": 1}, "status": "4", "result": True}, {"n": 1}),
        ({"values": {"status": 4, "result": {"n": 1}}, "result": True}, {"n": 1}),
        ({"values": None, "status": 4, "result": True}, {}),
        ({"values": {}, "status": 5, "result": True}, "was cancelled by others"),
        ({"values": {"status": "6", "result": {}}, "result": True}, "was refused or aborted"),
        ({"values": "no server", "result": False}, "was refused or aborted: no server"),
        ({"status": 4}, "was refused or aborted"),
    ],
)
def test_the_status_of_a_goal_is_beside_or_around_its_result(reply, outcome):
    if isinstance(outcome, dict):
        assert read_result("/go", reply) == outcome
    else:
        with pytest.raises(ActionFailedError, match=rf"the goal of /go {outcome}$"):
            read_result("/go", reply)


def test_a_goal_ends_at_once_if_the_connection_is_cut(server, connection):
    server.serve_action("/go", lambda goal: (goal.is_cancelled.wait(WAIT), (bridge.CANCELLED, {}))[1])
    threading.Timer(0.2, server.cut).start()
    began = time.monotonic()
    with pytest.raises(ConnectionLostError, match="the connection was lost during /go"):
        connection.run_action("/go", "x/Go", {}, timeout=60.0)
    assert time.monotonic() - began < WAIT


def test_a_lost_connection_is_made_again_with_its_subscriptions_and_a_stop(server, connection):
    called = threading.Event()
    connection.call_after_reconnect(lambda: called.set() is None)
    received = connection.subscribe("/numbers", "std_msgs/Int32")
    connection.advertise("/say", "std_msgs/String")
    wait_until(lambda: server.is_subscribed("/numbers"))
    server.cut()
    assert called.wait(WAIT)
    wait_until(lambda: [m["op"] for m in server.received].count("subscribe") == 2)
    wait_until(lambda: server.is_subscribed("/numbers"))
    server.publish("/numbers", {"data": 1})
    assert received.wait(WAIT) == {"data": 1}
    assert [m["op"] for m in server.received].count("advertise") == 2
    wait_until(lambda: is_connected(connection))  # once the function was called several times


def test_without_a_server_every_request_is_an_error(server, connection):
    received = connection.subscribe("/numbers", "std_msgs/Int32")
    server.close()
    wait_until(lambda: not is_connected(connection))
    with pytest.raises(ConnectionLostError, match="the connection was lost"):
        connection.publish("/say", "std_msgs/String", {"data": ""})
    with pytest.raises(ConnectionLostError, match="the connection was lost"):
        received.wait(0.1)
    with pytest.raises(ConnectionLostError):
        connection.run_action("/go", "x/Go", {}, timeout=WAIT)


def test_no_server_is_an_error_that_names_the_address(server):
    server.close()
    with pytest.raises(ConnectionLostError, match=rf"{server.url}: no rosbridge server can be reached"):
        RosbridgeConnection(server.url, timeout=1.0)
    with pytest.raises(ConnectionLostError, match="http://nowhere"):
        RosbridgeConnection("http://nowhere", timeout=1.0)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "1",
        "[" * 100_000,
        '{"op": 1}',
        '{"op": "publish"}',
        '{"op": "publish", "topic": "/a", "msg": 3}',
        '{"op": "action_result", "id": [1]}',
        '{"op": "service_response", "id": {}}',
    ],
    ids=str.__len__,
)
def test_malformed_messages_are_left_out(server, connection, text):
    received = connection.subscribe("/a", "std_msgs/Int32")
    wait_until(lambda: server.is_subscribed("/a"))
    for client in server.connections:
        client.send(text)
    server.publish("/a", {"data": 1})
    assert received.wait(WAIT) == {"data": 1}


def test_what_is_left_out_is_named_once_for_each_kind(server, connection, caplog):
    connection.subscribe("/a", "std_msgs/Int32")
    wait_until(lambda: server.connections and server.is_subscribed("/a"))
    texts = ("{", '{"op": "png", "data": "eJw="}', '{"op": "new"}', '{"op": "fragment", "id": 1}', "[1]")
    for client in server.connections:
        for text in (*texts, *texts, '{"op": "status", "level": "error", "msg": "last"}'):
            client.send(text)
    wait_until(lambda: connection.notes[-1:] == ["last"])
    assert [message.split(": ", 1)[1] for message in caplog.messages] == [
        "a message that is not JSON is left out",
        "an operation 'png' is left out: its data is not a PNG image; expected messages without compression",
        "the operation 'new' is unknown and left out",
        "a fragment without id or data is left out",
        "a message without an operation is left out",
        "last",
    ]


def test_a_lost_connection_leaves_no_traceback_of_another_thread(server, connection, capfd):
    """websockets logs a keepalive that fails with its traceback."""
    socket = connection._socket
    socket.logger.error("keepalive ping failed", exc_info=ValueError("closed"))
    assert capfd.readouterr().err == ""
    assert socket.logger.name == "lcorpp.websockets"


def test_errors_of_the_server_are_kept(server, connection):
    connection.subscribe("/a", "std_msgs/Int32")
    wait_until(lambda: server.connections and server.is_subscribed("/a"))
    for client in server.connections:
        client.send('{"op": "status", "level": "error", "msg": "unknown type"}')
    wait_until(lambda: connection.notes == ["unknown type"])


def test_many_goals_leave_nothing_behind():
    robot = StandIn()
    connection = RosbridgeConnection(robot.url, timeout=WAIT)
    pose = {"pose": {"pose": {"position": {"x": 0.0, "y": 0.0}}}}
    for _ in range(50):
        connection.run_action("/navigate_to_pose", "nav2_msgs/NavigateToPose", pose, timeout=WAIT)
    assert len(connection._replies) == 0
    connection.close()
    robot.close()

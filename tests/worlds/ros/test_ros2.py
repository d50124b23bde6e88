"""ROS 2 for real: rclpy and rosbridge-server-rs, a robot in another process, twenty faults of each kind."""

import re
import statistics
import subprocess
import sys
import threading
import time

import pytest

from lcorpp.errors import ActionFailedError, ConnectionLostError
from lcorpp.learning import save_classifier
from lcorpp.worlds.ros.perception import Frames, Perception
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.ros_world import Behaviour, RosWorld
from lcorpp.worlds.ros.rosbridge import RosbridgeConnection
from lcorpp.worlds.ros.skills import Body, CallAction
from tests.robot.conftest import folder, parts  # noqa: F401
from tests.worlds.ros.processes import HERE, Node, Ros2, fault_program, free_port
from tests.worlds.ros.stand_in import robot_toml
from tests.worlds.ros.test_rosbridge import is_connected, wait_until

pytestmark = pytest.mark.slow

FIBONACCI = "test_msgs/Fibonacci"
N_FAULTS = 20

NOTE = r"note: running Python code of \S+\n"
"""The domain of the tests has a people.py."""


@pytest.fixture(scope="module")
def ros2(tmp_path_factory):
    return Ros2(tmp_path_factory.mktemp("ros2"))


@pytest.fixture
def robot(ros2):
    node = Node([ros2.python, HERE / "ros2_robot.py"], ros2.env)
    node.wait(event="ready")
    yield node
    node.end()


@pytest.fixture
def bridge(ros2, robot):
    port = free_port()
    process = ros2.bridge(port)
    connection = RosbridgeConnection(f"ws://127.0.0.1:{port}")
    while not find_robot(connection):
        pass
    connection.close()
    robot.events.clear()
    yield port
    process.kill()
    process.wait()


def find_robot(connection):
    """Return whether the bridge has found the action server; a goal that it sends before is lost."""
    try:
        return bool(connection.run_action("/move", FIBONACCI, {"order": 3}, timeout=1.0))
    except ActionFailedError:
        return False


def configuration(url, kind):
    """Return a robot.toml for the robot of ros2_robot.py."""
    goal = "goal = {{ order = 3 }}"
    server = f'skill = "action"\nname = "/move"\ntype = "test_msgs/Fibonacci"\n{goal}'
    return robot_toml(
        url,
        connection=f'[connection]\nkind = "{kind}"\nurl = "{{url}}"',
        robot="[robot]\npose = [0, 0, 0]",
        people='[people]\ntopic = "/people"\ntype = "visualization_msgs/MarkerArray"\ndecide_after = 1.0',
        classifiers='[classifiers]\nmotion = "motion.npz"',
        move='[actions.move_forward]\nskill = "say"\ntopic = "/say"\ntype = "std_msgs/String"\ntext = "Hi"\n'
        "seconds = 0.1\nlisten = 5.0",
        turn=f"[actions.turn]\n{server}\nlisten = 5.0",
        beliefs='[beliefs]\nstate = "/belief"',
    )


def run_robot(python, config, env=None):
    """Run `lcorpp robot` in a process of its own for one decision."""
    command = [python, "-c", "from lcorpp.cli.main import main; main()", "robot", "--config", config]
    return subprocess.run(
        [*map(str, command), "--decisions", "1", "--jobs", "1"],
        env=env,
        capture_output=True,
        text=True,
        timeout=300,
    )


def test_a_decision_through_rosbridge(robot, bridge, folder, parts):  # noqa: F811
    save_classifier(parts[1]["motion"], folder / "motion.npz")
    config = folder / "ros2.toml"
    config.write_text(configuration(f"ws://127.0.0.1:{bridge}", "rosbridge"))
    ended = run_robot(sys.executable, config)
    assert (ended.returncode, re.sub(NOTE, "", ended.stderr)) == (0, "")
    assert ": interested" in ended.stdout
    assert robot.wait(event="belief", action="report_interested")


def test_a_decision_by_rclpy(ros2, robot, folder, parts):  # noqa: F811
    save_classifier(parts[1]["motion"], folder / "motion.npz")
    config = folder / "ros2.toml"
    config.write_text(configuration("ws://none", "rclpy"))
    ended = run_robot(ros2.python, config, ros2.env)
    assert (ended.returncode, re.sub(NOTE, "", ended.stderr)) == (0, "")
    assert "(ROS 2)" in ended.stdout
    assert ": interested" in ended.stdout
    assert robot.wait(event="belief", action="report_interested")


def test_the_round_trip_takes_a_few_milliseconds(ros2, bridge):
    echo_node = Node([ros2.python, HERE / "ros2_echo.py"], ros2.env)
    echo_node.wait(event="ready")
    connection = RosbridgeConnection(f"ws://127.0.0.1:{bridge}")
    echo = connection.subscribe("/echo", "std_msgs/String")
    connection.advertise("/ping", "std_msgs/String")
    while echo.wait(0.1) is None:
        connection.publish("/ping", "std_msgs/String", {"data": "first"})
    time.sleep(0.5)
    echo.take()
    seconds = []
    for number in range(600):
        began = time.perf_counter()
        connection.publish("/ping", "std_msgs/String", {"data": str(number)})
        assert echo.wait(10.0) == {"data": str(number)}
        seconds.append(time.perf_counter() - began)
    connection.close()
    echo_node.end()
    print(f"round trip: median {1000 * statistics.median(seconds):.2f} ms")
    # The best of 20 stretches: a busy machine delays some, a slow connection delays all.
    assert min(statistics.median(seconds[start : start + 30]) for start in range(0, 600, 30)) < 0.015


def test_goals_services_and_their_failures(robot, bridge):
    connection = RosbridgeConnection(f"ws://127.0.0.1:{bridge}")
    result = connection.run_action("/move", FIBONACCI, {"order": 3}, timeout=10.0)
    assert result == {"sequence": [0, 1, 2]}
    for order, message in ((0, "goal rejected"), (1, "refused or aborted")):
        with pytest.raises(ActionFailedError, match=message):
            connection.run_action("/move", FIBONACCI, {"order": order}, timeout=10.0)
    with pytest.raises(ActionFailedError, match="no result within 1 s"):
        connection.run_action("/move", FIBONACCI, {"order": 2}, timeout=1.0)
    robot.wait(event="cancel")
    with pytest.raises(ActionFailedError, match="install and source its ROS package"):
        connection.run_action("/move", "nav2_msgs/NavigateToPose", {}, timeout=10.0)
    assert connection.call_service("/set", "std_srvs/SetBool", {"data": True}, timeout=10.0)["success"]
    connection.subscribe("/people", "people_msgs/People")
    wait_until(lambda: any("another type" in note for note in connection.notes))
    connection.close()


def make_world(connection, timeout):
    people = ("/people", "visualization_msgs/MarkerArray")
    perception = Perception(connection, people, Pose(0, 0, 0), Frames())
    while not perception.update(1.0):
        pass
    perception.locate = lambda person: (3.0, 0.4)  # nothing updates it, and the robot may be gone
    hang = Behaviour(CallAction("/move", FIBONACCI, {"order": 2}), timeout=timeout)
    return RosWorld(Body(connection, perception, "2"), {"move": hang})


def measure(world, error, timeout):
    """Run an action that cannot end well; return by how many seconds it exceeds its time-out."""
    began = time.monotonic()
    with pytest.raises(error, match="stop"):
        world.act("move")
    return time.monotonic() - began - timeout


def wait_for_stop(robot, before):
    """Wait until goals were cancelled and a Twist of zeros came after the event number `before`."""
    kinds = {"cancel", "twist"}
    wait_until(lambda: kinds <= robot.kinds(before), lambda: robot.events[before:], timeout=30.0)


def interrupt_goal(robot, function):
    """Call a function in a thread once the robot has received a new goal."""
    goals = robot.count("goal")

    def run():
        wait_until(lambda: robot.count("goal") > goals)
        function()

    threading.Thread(target=run, daemon=True).start()


def test_twenty_goals_without_a_result_end_in_time_with_a_stop(robot, bridge):
    connection = RosbridgeConnection(f"ws://127.0.0.1:{bridge}")
    world = make_world(connection, 1.0)
    for _ in range(N_FAULTS):
        before = len(robot.events)
        assert measure(world, ActionFailedError, 1.0) < 1.0
        wait_for_stop(robot, before)
    connection.close()


def test_twenty_connections_that_are_cut_end_in_time_with_a_stop(robot, bridge):
    connection = RosbridgeConnection(f"ws://127.0.0.1:{bridge}")
    world = make_world(connection, 5.0)
    for _ in range(N_FAULTS):
        before = len(robot.events)
        interrupt_goal(robot, lambda: connection._socket.socket.shutdown(2))
        assert measure(world, ConnectionLostError, 5.0) < 1.0
        wait_for_stop(robot, before)
        wait_until(lambda: is_connected(connection))
    connection.close()


def test_twenty_servers_that_are_killed_end_in_time_with_a_stop_when_they_are_back(ros2, robot):
    port = free_port()
    server = ros2.bridge(port)
    connection = RosbridgeConnection(f"ws://127.0.0.1:{port}")
    world = make_world(connection, 5.0)
    for _ in range(N_FAULTS):
        while not find_robot(connection):
            pass
        before = len(robot.events)
        interrupt_goal(robot, server.kill)
        assert measure(world, ConnectionLostError, 5.0) < 1.0
        server.wait()
        server = ros2.bridge(port)
        wait_for_stop(robot, before)
        wait_until(lambda: is_connected(connection))
    connection.close()
    server.kill()
    server.wait()


def test_twenty_action_servers_that_are_gone_end_in_time(robot, bridge):
    connection = RosbridgeConnection(f"ws://127.0.0.1:{bridge}")
    world = make_world(connection, 1.0)
    robot.end()
    for _ in range(N_FAULTS):
        assert measure(world, ActionFailedError, 1.0) < 1.0
    connection.close()


def test_twenty_goals_by_rclpy_end_in_time_with_a_stop(ros2, robot):
    program = fault_program(
        "rclpy_connection", "Rclpy", 'CallAction("/move", "test_msgs/Fibonacci", {"order": 2})'
    )
    ended = subprocess.run(
        [str(ros2.python), "-c", program], env=ros2.env, capture_output=True, text=True, timeout=300
    )
    lines = ended.stdout.splitlines()
    assert len(lines) == N_FAULTS, ended.stderr
    expected = "no result within 1 s", "an order to stop was sent"
    assert [line for line in lines if not all(words in line for words in expected)] == []
    assert all(float(line.split()[0]) < 2.0 for line in lines)
    wait_until(lambda: robot.count("cancel") >= N_FAULTS, timeout=30.0)
    assert robot.count("twist", angular=0.0) == N_FAULTS

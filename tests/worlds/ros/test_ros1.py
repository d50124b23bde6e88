"""ROS 1 for real: rosmaster, the rospy adapter, and a node that serves move_base, in three processes."""

import os
import subprocess
import sys
import time

import pytest

from lcorpp.learning import save_classifier
from tests.robot.conftest import folder, parts  # noqa: F401
from tests.worlds.ros.processes import HERE, Node, fault_program, free_port, require_ros1, wait_for_port
from tests.worlds.ros.stand_in import robot_toml

pytestmark = pytest.mark.slow

DIST_PACKAGES = "/usr/lib/python3/dist-packages"
"""Debian's rospy; it comes last, so that lcorpp's own packages are found first."""


@pytest.fixture
def env():
    require_ros1()
    port = free_port()
    env = os.environ | {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    master = subprocess.Popen(
        ["rosmaster", "--core", "-p", str(port)],
        env=env,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    wait_for_port(port)
    yield env | {"MASTER_PID": str(master.pid)}
    master.kill()
    master.wait()


@pytest.fixture
def robot(env):
    node = Node([require_ros1(), HERE / "ros1_robot.py"], env)
    node.wait(event="ready")
    yield node
    node.end()


def run_python(text, env):
    """Run a program with rospy and lcorpp in a process of its own."""
    path = f"import sys; sys.path.append({DIST_PACKAGES!r}); sys.path.insert(0, {str(HERE.parents[2])!r})\n"
    return subprocess.run(
        [sys.executable, "-c", path + text], env=env, capture_output=True, text=True, timeout=300
    )


def test_a_decision_by_rospy(env, robot, folder, parts):  # noqa: F811
    save_classifier(parts[1]["motion"], folder / "motion.npz")
    config = folder / "ros1.toml"
    navigate = 'skill = "navigate"\nname = "/move_base"\ntype = "move_base_msgs/MoveBase"\nlisten = 5.0'
    text = robot_toml(
        "ws://none",
        connection='[connection]\nkind = "rospy"',
        people='[people]\ntopic = "/people"\ntype = "visualization_msgs/MarkerArray"\ndecide_after = 1.0',
        classifiers='[classifiers]\nmotion = "motion.npz"',
        move=f"[actions.move_forward]\n{navigate}",
        greet=f"[actions.greet]\n{navigate}",
        turn=f"[actions.turn]\n{navigate}",
        beliefs='[beliefs]\nstate = "/belief"',
    )
    config.write_text(text)
    program = (
        f"sys.argv = ['lcorpp', 'robot', '--config', {str(config)!r}, '--decisions', '1', '--jobs', '1']\n"
    )
    ended = run_python(program + "from lcorpp.cli.main import main; main()", env)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "rospy (ROS 1)" in ended.stdout
    assert ": interested" in ended.stdout
    assert robot.wait(event="belief", action="report_interested")
    assert robot.count("goal") >= 1


FAULTS = fault_program("rospy_connection", "Rospy", 'Navigate("/move_base", "move_base_msgs/MoveBase")')


@pytest.mark.parametrize(
    ("mode", "message"), [("abort", "was aborted: blocked"), ("hang", "has no result within 1 s")]
)
def test_twenty_failures_end_in_time_with_a_stop(env, robot, mode, message):
    robot.command(mode)
    ended = run_python(FAULTS, env)
    lines = ended.stdout.splitlines()
    assert len(lines) == 20, ended.stderr
    assert all(float(line.split()[0]) < 2.0 for line in lines)
    assert [line for line in lines if message not in line or "an order to stop was sent" not in line] == []
    end = time.monotonic() + 30
    while robot.count("twist", linear=0.0) < 20 and time.monotonic() < end:
        time.sleep(0.05)
    assert robot.count("twist", linear=0.0) == 20
    if mode == "hang":
        assert robot.count("cancel") == 20


def test_an_action_server_that_is_gone_is_refused_in_time(env, robot):
    program = FAULTS.replace('"/move_base"', '"/gone"')
    lines = run_python(program, env).stdout.splitlines()
    assert len(lines) == 20
    assert all("there is no action server /gone" in line for line in lines)
    assert all(float(line.split()[0]) < 2.0 for line in lines)


def test_no_master_is_one_typed_error(env):
    program = "from lcorpp.worlds.ros.rospy_connection import RospyConnection; RospyConnection()"
    ended = run_python(program, env | {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}"})
    assert "ConnectionLostError: there is no ROS master at http://127.0.0.1" in ended.stderr

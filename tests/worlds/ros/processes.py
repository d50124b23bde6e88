"""Processes of real ROS systems for slow tests: each is skipped, saying why, where it cannot be had."""

import json
import os
import queue
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

HERE = Path(__file__).parent
START = 60.0
"""Seconds within which a process must be ready, also on a busy machine."""


class Node:
    """A process that prints one JSON object a line; its standard input takes commands."""

    def __init__(self, command, env):
        self.process = subprocess.Popen(
            [str(part) for part in command],
            env=env,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self.events, self._new = [], queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            self.events.append(json.loads(line))
            self._new.put(self.events[-1])

    def wait(self, timeout=START, **fields):
        """Return the first event, from now or before, with these fields."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            for event in list(self.events):
                if all(event.get(name) == value for name, value in fields.items()):
                    return event
            time.sleep(0.02)
        raise AssertionError(f"no event {fields} within {timeout} s; there were {self.events[-10:]}")

    def count(self, event, **fields):
        fields = {"event": event, **fields}
        return sum(all(e.get(name) == value for name, value in fields.items()) for e in list(self.events))

    def kinds(self, before):
        return {event["event"] for event in self.events[before:]}

    def command(self, text):
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()

    def end(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


def fault_program(module, name, skill):
    """Return a program that runs a skill 20 times by a native connection, and prints seconds and errors.

    The skill has a second. The connection is the class NAMEConnection of a module of `lcorpp.worlds.ros`.
    """
    return f"""
import time
from lcorpp.errors import WorldError
from lcorpp.worlds.ros.{module} import {name}Connection
from lcorpp.worlds.ros.perception import Frames, Perception
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.ros_world import Behaviour, RosWorld
from lcorpp.worlds.ros.skills import Body, CallAction, Navigate

connection = {name}Connection()
perception = Perception(connection, ("/people", "visualization_msgs/MarkerArray"), Pose(0, 0, 0), Frames())
while not perception.update(1.0):
    pass
world = RosWorld(Body(connection, perception, "2"), {{"move": Behaviour({skill}, timeout=1.0)}})
for _ in range(20):
    perception.update(1.0)
    began = time.monotonic()
    try:
        world.act("move")
    except WorldError as error:
        print(f"{{time.monotonic() - began:.3f}} {{error}}", flush=True)
connection.close()
"""


def free_port():
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        return made.getsockname()[1]


def wait_for_port(port):
    end = time.monotonic() + START
    while time.monotonic() < end:
        with socket.socket() as made:
            if made.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise AssertionError(f"nothing listens on port {port}")


def require_ros1():
    """Skip without Debian's ROS 1; return its Python."""
    python, needed = (
        "/usr/bin/python3",
        "import rospy, actionlib, move_base_msgs, visualization_msgs, std_srvs",
    )
    found = shutil.which("rosmaster") and subprocess.run([python, "-c", needed], capture_output=True)
    if not found or found.returncode:
        pytest.skip(
            "needs python3-rospy, python3-rosmaster, python3-actionlib, python3-move-base-msgs,"
            " python3-visualization-msgs and python3-std-srvs"
        )
    return python


ROS2_WHEELS = (
    "ros-jazzy-rclpy[fastrtps]",
    "ros-jazzy-std-msgs",
    "ros-jazzy-geometry-msgs",
    "ros-jazzy-nav-msgs",
    "ros-jazzy-test-msgs",
    "ros-jazzy-std-srvs",
    "ros-jazzy-visualization-msgs",
    "rosbridge-server-rs",
)


class Ros2:
    """An environment with ROS 2 from wheels. python: its interpreter. site: its packages."""

    def __init__(self, folder):
        self.folder, self.python = folder, folder / "bin" / "python"
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        install = [
            self.python,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            *ROS2_WHEELS,
        ]
        done = subprocess.run(install, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"the wheels of ROS 2 cannot be had: {done.stderr.strip().splitlines()[-1]}")
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        self.site = folder / "lib" / version / "site-packages"
        # lcorpp and what it needs come from the environment of the tests
        own = next(path for path in sys.path if path.endswith("site-packages"))
        (self.site / "tests.pth").write_text(f"{own}\n{HERE.parents[2] / 'src'}\n")
        self.env = os.environ | {"ROS_DOMAIN_ID": str(50 + os.getpid() % 50), "ROS_DISTRO": "jazzy"}

    def bridge(self, port):
        """Start a rosbridge server; the wheel expects the libraries of a sourced ROS."""
        links = self.folder / "links"
        links.mkdir(exist_ok=True)
        link = links / "librmw_implementation.so"
        if not link.exists():
            link.symlink_to(self.folder / "lib" / "librmw_fastrtps_cpp.so")
        found = subprocess.run(
            [self.python, "-c", "import rclpy, os; print(os.environ['LD_LIBRARY_PATH'])"],
            env=self.env,
            capture_output=True,
            text=True,
            check=True,
        )
        server = self.site / "rosbridge_server_rs" / "rosbridge_server_rs_jazzy"
        server.chmod(0o755)
        import sysconfig

        python = Path(sysconfig.get_config_var("LIBDIR")) / sysconfig.get_config_var("INSTSONAME")
        env = self.env | {
            "LD_LIBRARY_PATH": f"{links}:{found.stdout.strip().splitlines()[-1]}",
            "AMENT_PREFIX_PATH": str(self.folder),
            "LD_PRELOAD": str(python),
        }
        process = subprocess.Popen(
            [server, "--bind", f"127.0.0.1:{port}", "--no-rosapi", "--log-level", "error"],
            env=env,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_for_port(port)
        return process

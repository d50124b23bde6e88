"""A simulated robot in a corridor, which `lcorpp robot` drives as if it were real.

    pip install ir-sim websockets
    python examples/robot/simulate.py                                # the robot, in one terminal
    lcorpp robot --config examples/robot/robot.toml --decisions 3    # what decides, in another

ir-sim moves robot and people (`corridor.py`), and `bridge.py` offers what a robot with ROS 2 offers through
rosbridge: NavigateToPose, cmd_vel, odometry, a people tracker, and speech.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
import time
from math import atan2, cos, sin
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from bridge import ABORTED, CANCELLED, SUCCEEDED, BridgeServer, Goal, Message
from corridor import Corridor
from walkers import draw_visitors

from lcorpp import load_domain
from lcorpp.simulation import Population

SENTENCES = {"pos": "yes please", "neg": "no thank you"}
STATUS = {"succeeded": SUCCEEDED, "cancelled": CANCELLED, "aborted": ABORTED, "none": ABORTED}
DELAY, SPEECH_RATE = 0.5, 0.07
"""Seconds until a person answers, once the robot has finished; seconds that it takes to speak a character."""


class SimulatedRobot:
    """The corridor behind a bridge. The latest belief that the decider publishes names whom it attends to."""

    def __init__(self, corridor: Corridor, port: int) -> None:
        self._corridor, self._lock = corridor, threading.Lock()
        self._person, self._is_turning = 0, False
        self.server = BridgeServer(port)
        self.server.serve_action("/navigate_to_pose", self._navigate)
        self.server.take_topic("/cmd_vel", self._drive)
        self.server.take_topic("/say", self._greet)
        self.server.take_topic("/belief", self._take_belief)

    def step(self) -> None:
        """Advance the simulation, and publish what the sensors perceive."""
        with self._lock:
            self._corridor.step()
            people, (x, y, heading) = list(self._corridor.people), self._corridor.pose
        now = time.time()
        header = {"frame_id": "odom", "stamp": {"sec": int(now), "nanosec": int(now % 1 * 1e9)}}
        orientation = {"x": 0.0, "y": 0.0, "z": sin(heading / 2), "w": cos(heading / 2)}
        pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": orientation}
        self.server.publish("/odom", {"header": header, "pose": {"pose": pose}})
        tracked = [{"name": str(p.person), "position": {"x": p.x, "y": p.y, "z": 0.0}} for p in people]
        self.server.publish("/people", {"header": header, "people": tracked})

    def _navigate(self, goal: Goal) -> tuple[int, Message]:
        pose = goal.content["pose"]["pose"]
        heading = 2 * atan2(pose["orientation"]["z"], pose["orientation"]["w"])
        with self._lock:
            self._corridor.navigate(pose["position"]["x"], pose["position"]["y"], heading)
        while self._corridor.goal_state == "active":
            if goal.is_cancelled.wait(0.05):
                with self._lock:
                    self._corridor.cancel()
        state = self._corridor.goal_state
        if state == "succeeded":
            self._answer("move_forward")
        return STATUS[state], {}

    def _drive(self, twist: Message) -> None:
        turn = twist["angular"]["z"]
        with self._lock:
            self._corridor.set_velocity(twist["linear"]["x"], turn)
        if not turn and self._is_turning:
            self._answer("turn")
        self._is_turning = bool(turn)

    def _greet(self, message: Message) -> None:
        self._answer("greet", SPEECH_RATE * len(message["data"]))

    def _answer(self, action: str, duration: float = 0.0) -> None:
        """Let the person to whom the robot attends answer an action, which still takes `duration` seconds."""
        with self._lock:
            heard = self._corridor.answer(self._person, action)
        if heard in SENTENCES:
            speech = {"data": SENTENCES[heard]}
            threading.Timer(duration + DELAY, self.server.publish, ("/speech", speech)).start()

    def _take_belief(self, message: Message) -> None:
        belief = json.loads(message["data"])
        self._person, action = int(belief["person"]), belief["action"] or ""
        if action.startswith("report_"):
            with self._lock:
                if self._person in self._corridor.visitors:
                    served = self._corridor.report(self._person, action.removeprefix("report_"))
                    print(f"person {self._person}: {action}{', served' if served else ''}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--port", type=int, default=9090)
    parser.add_argument("--people", type=int, default=5, help="largest number of people at a time")
    parser.add_argument("--per-minute", type=float, default=7.5, help="people who come in a minute")
    parser.add_argument("--seconds", type=float, default=3600.0, help="duration")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    domain = load_domain("intention", preset="heard")
    rng = np.random.default_rng(arguments.seed)
    visitors = draw_visitors(
        Population(domain), rng, seconds=arguments.seconds, per_minute=arguments.per_minute
    )
    corridor = Corridor(
        visitors, domain, max_people=arguments.people, step=0.1, real_time_factor=1.0, seed=arguments.seed
    )
    try:
        robot = SimulatedRobot(corridor, arguments.port)
    except OSError as error:
        sys.exit(f"--port {arguments.port}: {error.strerror}; expected a free port")
    print(f"the robot is at {robot.server.url}; Ctrl-C ends it", flush=True)
    try:
        while corridor.time < arguments.seconds:
            robot.step()
    except KeyboardInterrupt:
        pass
    robot.server.close()
    ends = [outcome.end for outcome in corridor.outcomes]
    print(", ".join(f"{ends.count(end)} {end}" for end in dict.fromkeys(ends)) or "nobody came")


if __name__ == "__main__":
    main()

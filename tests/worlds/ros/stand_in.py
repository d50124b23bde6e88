"""A robot without ROS behind the bridge of the examples: it walks, turns, hears, and records its orders."""

import importlib.util
import json
import threading
import time
from math import cos, sin
from pathlib import Path

EXAMPLES = Path(__file__).parents[3] / "examples" / "robot"


def load_example(name):
    spec = importlib.util.spec_from_file_location(f"examples_robot_{name}", EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


bridge = load_example("bridge")


class StandIn:
    """A robot at the origin that faces +y, and people who stand in front of it.

    answer: what people answer to a greeting and when the robot has moved, None for silence.
    navigation: "succeed", "abort", or "hang".
    twists: the Twists received. says: the sentences.

    Args:
        people: id -> position; they move by 1 mm per message, so that they have a motion.
    """

    def __init__(self, people=None, *, answer="yes please", navigation="succeed", port=0):
        self.people = {"7": (0.0, 3.0)} if people is None else people
        self.answer, self.navigation = answer, navigation
        self.pose = [0.0, 0.0, 1.5707963]
        self.twists, self.says, self.goals = [], [], []
        self.server = bridge.BridgeServer(port)
        self.server.take_topic("/say", self._say)
        self.server.take_topic("/cmd_vel", self._drive)
        self.server.serve_action("/navigate_to_pose", self._navigate)
        self.server.serve_service("/wave", lambda request: {"success": request.get("data", True)})
        self._ends, self._last = threading.Event(), time.monotonic()
        self._thread = threading.Thread(target=self._publish, daemon=True)
        self._thread.start()

    @property
    def url(self):
        return self.server.url

    @property
    def stops(self):
        """The number of Twists of zeros."""
        return sum(not twist["linear"]["x"] and not twist["angular"]["z"] for twist in self.twists)

    @property
    def cancels(self):
        calls = [m for m in self.server.received if m.get("op") == "call_service"]
        return sum(call["service"].endswith("cancel_goal") for call in calls)

    def close(self):
        self._ends.set()
        self.server.close()

    def publish_once(self):
        now = time.time()
        header = {"frame_id": "map", "stamp": {"sec": int(now), "nanosec": int(now % 1 * 1e9)}}
        x, y, heading = self.pose
        orientation = {"x": 0.0, "y": 0.0, "z": sin(heading / 2), "w": cos(heading / 2)}
        pose = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": orientation}
        self.server.publish("/pose", {"header": header, "pose": pose})
        people = []
        for name, (px, py) in self.people.items():
            self.people[name] = px, py - 0.001
            people.append({"name": name, "position": {"x": px, "y": py, "z": 0.0}, "reliability": 1.0})
        self.server.publish("/people", {"header": header, "people": people})

    def _publish(self):
        while not self._ends.wait(0.05):
            self.publish_once()

    def _say(self, message):
        self.says.append(message["data"])
        self._answer_soon()

    def _answer_soon(self):
        if self.answer is not None:
            speech = {"data": self.answer}
            threading.Timer(0.2, lambda: self.server.publish("/speech", speech)).start()

    def _drive(self, twist):
        self.twists.append(twist)
        now = time.monotonic()
        self.pose[2] += twist["angular"]["z"] * min(0.2, now - self._last)
        self._last = now
        if not twist["angular"]["z"]:  # the end of a turn
            self._answer_soon()

    def _navigate(self, goal):
        self.goals.append(goal.content)
        if self.navigation == "abort":
            return bridge.ABORTED, {}
        if self.navigation == "hang":
            goal.is_cancelled.wait(60)
            return bridge.CANCELLED, {}
        position = goal.content["pose"]["pose"]["position"]
        self.pose[:2] = position["x"], position["y"]
        self._answer_soon()
        return bridge.SUCCEEDED, {}


def heard_domain(folder):
    """Write the intention domain with a model in which silence is possible; return the folder.

    Silence after a turn means that it did not succeed, as in the domain's own model.
    """
    from lcorpp.domains.loading import SHIPPED_FOLDER

    source = SHIPPED_FOLDER / "intention"
    folder.mkdir()
    for name in ("knowledge.plog", "people.py", "walking.py"):
        (folder / name).write_text((source / name).read_text())
    text = (source / "domain.toml").read_text()
    (folder / "domain.toml").write_text(text[: text.index("[presets")])
    model = (source / "interaction.pomdp").read_text()
    begin, end = model.index("O: move_forward"), model.index("O: turn")
    rows = model[begin:end].replace("0.9 0.1 0.0", "0.8 0.1 0.1").replace("0.1 0.9 0.0", "0.1 0.8 0.1")
    rows = rows.replace("0.8 0.2 0.0", "0.7 0.2 0.1").replace("0.2 0.8 0.0", "0.2 0.7 0.1")
    (folder / "interaction.pomdp").write_text(model[:begin] + rows + model[end:])
    return folder


def robot_toml(url, **changes):
    """Return a robot.toml for the stand-in, with other lines for some keys of `BASE`."""
    return "\n".join(line.format(url=url) for line in ({**BASE, **changes}).values())


BASE = {
    "domain": 'domain = "heard"',
    "connection": '[connection]\nurl = "{url}"\ntimeout = 2.0\nmax_outage = 2.0',
    "robot": '[robot]\npose = {{ topic = "/pose", type = "geometry_msgs/PoseStamped" }}',
    "people": '[people]\ntopic = "/people"\ntype = "people_msgs/People"\ndecide_after = 1.0\n'
    "max_silence = 60.0",
    "answers": '[answers]\ntopic = "/speech"\ntype = "std_msgs/String"',
    "utterances": '[answers.utterances]\npos = ["yes please"]\nneg = ["no thank you"]',
    "facts": '[facts]\nlocation = "classroom"\ntime = {{ morning = 6, afternoon = 12, evening = 18 }}',
    "move": '[actions.move_forward]\nskill = "navigate"\nname = "/navigate_to_pose"\n'
    'type = "nav2_msgs/action/NavigateToPose"\ntimeout = 2.0\nlisten = 5.0',
    "greet": '[actions.greet]\nskill = "say"\ntopic = "/say"\ntype = "std_msgs/String"\ntext = "Hello!"\n'
    "seconds = 0.1\nlisten = 5.0",
    "turn": '[actions.turn]\nskill = "turn"\ntimeout = 3.0\nlisten = 5.0',
    "beliefs": '[beliefs]\nstate = "/belief"\nintent = "/intents"\n'
    'engagement = "/humans/persons/{{person}}/engagement_status"',
}


def published(stand_in, topic):
    """Return the messages that a client has published to a topic."""
    messages = [m for m in stand_in.server.received if m.get("op") == "publish"]
    return [m["msg"] for m in messages if m["topic"] == topic]


def beliefs(stand_in):
    return [json.loads(message["data"]) for message in published(stand_in, "/belief")]

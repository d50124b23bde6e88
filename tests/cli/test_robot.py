"""`lcorpp robot` and `lcorpp check robot.toml`: a whole run against the stand-in, and what they refuse."""

import json
import os
import re
import shutil
import signal
import threading

import pytest

from lcorpp.errors import FileError
from lcorpp.learning import save_classifier
from tests.robot.conftest import folder, parts  # noqa: F401
from tests.worlds.ros.stand_in import BASE, StandIn, robot_toml
from tests.worlds.ros.test_rosbridge import wait_until

CLASSIFIER = '[classifiers]\nmotion = "motion.npz"'
BY_TRUST = BASE["domain"] + '\nstrategy = "LCORPP+trust"'
NOTE = r"note: running Python code of \S+\n"
"""The domain of the tests has a people.py."""


@pytest.fixture
def config(folder, parts):  # noqa: F811
    """Write a robot.toml and return it."""
    save_classifier(parts[1]["motion"], folder / "motion.npz")

    def write(url="ws://127.0.0.1:9", **changes):
        file = folder / "robot.toml"
        file.write_text(robot_toml(url, classifiers=CLASSIFIER, **changes))
        return file

    return write


def test_a_run_decides_and_writes_a_log_that_can_be_replayed(lcorpp, config, tmp_path):
    robot = StandIn()
    log = tmp_path / "robot.jsonl"
    ended = lcorpp("robot", "--config", config(robot.url), "--decisions", 1, "--log", log)
    robot.close()
    assert ended.code == 0
    assert re.fullmatch(NOTE, ended.err)
    assert "intention by LCORPP on rosbridge (ROS 2)" in ended.out
    assert "person 7: interested" in ended.out
    (line,) = log.read_text().splitlines()
    assert json.loads(line)["report"] == "interested"
    assert lcorpp("replay", log).code == 0


SIMULATED = """
from pathlib import Path
from lcorpp.planning import read_pomdp

class Simulated:
    discount = 0.95

    def __init__(self):
        self.pomdp = read_pomdp(Path(__file__).parent / "interaction.pomdp")
        self.actions, self.observations = self.pomdp.actions, self.pomdp.observations

    def start(self, value, rng):
        return self.pomdp.states.index(f"{value}_not_turned")

    def shared(self, state):
        name = self.pomdp.states[state]
        return None if name == "term" else name.removesuffix("_turned").removesuffix("_not")

    def step(self, state, action, rng):
        a = self.actions.index(action)
        after = draw(self.pomdp.transition.row(a, state), rng)
        seen = draw(self.pomdp.observation.row(a, after), rng)
        return after, self.observations[seen], float(self.pomdp.reward[a, state])

    def likelihood(self, observation, state, action, after):
        columns, values = self.pomdp.observation.row(self.actions.index(action), after)
        return float(values[columns == self.observations.index(observation)].sum())


def draw(row, rng):
    columns, values = row
    return int(rng.choice(columns, p=values))


class Angles(Simulated):
    def __init__(self):
        super().__init__()
        self.observations = None

    def step(self, state, action, rng):
        after = self.pomdp.states.index("term") if action.startswith("report") else state
        return after, 1.5, 0.0

    likelihood = lambda *_: 1.0
"""


@pytest.fixture
def simulated(folder, config):  # noqa: F811
    """Write the heard domain with a simulated model, and a robot.toml."""

    def write(url="ws://127.0.0.1:9", kind="Simulated"):
        own = folder / f"simulated_{kind}"
        shutil.copytree(folder / "heard", own)
        (own / "simulated.py").write_text(SIMULATED)
        text = (own / "domain.toml").read_text()
        begin, end = text.index("[planning]"), text.index("[planning.reports]")
        planning = f'[planning]\nmodel = "simulated.py:{kind}"\nsimulations = 500\nparticles = 200\n'
        text = text[:begin] + planning + text[end:]
        begin, end = text.index("[planning.phrases]"), text.index("[simulation]")
        if kind == "Angles":  # they have no names
            text = text[:begin] + text[end:]
        (own / "domain.toml").write_text(text)
        return config(url, domain=f'domain = "{own.name}"')

    return write


def test_a_robot_decides_with_a_simulated_model(lcorpp, simulated, tmp_path):
    robot, log = StandIn(), tmp_path / "robot.jsonl"
    ended = lcorpp("robot", "--config", simulated(robot.url), "--decisions", 1, "--log", log)
    robot.close()
    assert ended.code == 0, ended.err
    assert "person 7: interested" in ended.out
    assert json.loads(log.read_text())["report"] == "interested"
    assert "1 decisions, 0 differences" in lcorpp("replay", log).out


def test_a_robot_needs_observations_with_names(lcorpp, simulated):
    ended = lcorpp("check", simulated(kind="Angles"))
    assert ended.code == 2
    assert "observes numbers, and no answer of a person is one; expected observations with names" in ended.err


def test_what_is_learnt_from_people_outlasts_a_run(lcorpp, config, tmp_path):
    state, log = tmp_path / "learnt" / "trust.json", tmp_path / "robot.jsonl"
    people = BASE["people"] + "\npermanent_ids = true"
    for n in range(2):
        robot = StandIn()
        file = config(robot.url, domain=BY_TRUST, people=people)
        ended = lcorpp("robot", "--config", file, "--decisions", 1, "--state", state, "--log", log)
        robot.close()
        assert ended.code == 0
        assert (f"note: {state}: learnt from 1 person\n" in ended.out) == (n == 1)
        content = json.loads(state.read_text())
        assert (content["domain"], content["strategy"]) == ("intention", "LCORPP+trust")
        assert content["state"]["people"] == n + 1
    records = content["state"]["learners"][0]["people"]["people"]
    assert list(records) == ["7"]  # the same person twice
    assert lcorpp("replay", log).code == 0  # the second decision follows from the first one


@pytest.mark.parametrize(
    ("strategy", "text", "message"),
    [
        ("LCORPP", None, "LCORPP does not learn from people, so it has no state; expected e.g. LCORPP+trust"),
        ("LCORPP+trust", "{", "trust.json: it is damaged, not JSON"),
        (
            "LCORPP+trust",
            '{"format": "lcorpp session", "version": 1, "domain": "museum"}',
            "trust.json: the state is of the domain 'museum'; expected 'intention'",
        ),
        (
            "LCORPP+trust",
            '{"format": "lcorpp session", "version": 1, "domain": "intention", "strategy": "LCORPP+trust"}',
            'trust.json: it is damaged; expected an object "state"',
        ),
    ],
)
def test_a_state_that_does_not_fit_is_refused_before_a_robot_is_sought(
    lcorpp, config, tmp_path, strategy, text, message
):
    state = tmp_path / "trust.json"
    if text is not None:
        state.write_text(text)
    ended = lcorpp(
        "robot", "--config", config(domain=BASE["domain"] + f'\nstrategy = "{strategy}"'), "--state", state
    )
    assert ended.code == 2
    assert message in ended.err
    assert text is None or state.read_text() == text


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_stops_the_robot(lcorpp, config, number):
    robot = StandIn(navigation="hang")
    navigate = (
        'skill = "navigate"\nname = "/navigate_to_pose"\ntype = "nav2_msgs/NavigateToPose"\ntimeout = 600'
    )
    names = {"move": "move_forward", "greet": "greet", "turn": "turn"}
    file = config(robot.url, **{key: f"[actions.{name}]\n{navigate}" for key, name in names.items()})

    def interrupt_when_it_moves():
        wait_until(lambda: robot.goals, timeout=600.0)
        os.kill(os.getpid(), number)

    interrupter = threading.Thread(target=interrupt_when_it_moves)
    interrupter.start()
    ended = lcorpp("robot", "--config", file)
    interrupter.join()
    assert ended.code == 130
    error = ended.err
    begin = "lcorpp: interrupted after 0 decisions; an order to stop was sent"
    assert re.match(NOTE + re.escape(begin), error)
    assert "/navigate_to_pose has confirmed the cancellation" in error
    wait_until(lambda: robot.stops and robot.cancels)
    robot.close()


def test_a_log_that_cannot_be_written_stops_the_robot(lcorpp, config, tmp_path, monkeypatch):
    def fail(self, lines):
        raise FileError(f"{self.path}: cannot be written: No space left on device")

    monkeypatch.setattr("lcorpp.logs.decision_log.DecisionLog.append_lines", fail)
    robot, log = StandIn(), tmp_path / "robot.jsonl"
    ended = lcorpp("robot", "--config", config(robot.url), "--log", log)
    assert ended.code == 2
    words = f"lcorpp: {log}: cannot be written: No space left on device; ended after 1 decision, the last one"
    assert re.match(NOTE + re.escape(f"{words} is not in the log; an order to stop was sent"), ended.err)
    wait_until(lambda: robot.stops)
    robot.close()


def test_no_robot_is_one_message_before_the_training(lcorpp, config, monkeypatch):
    monkeypatch.setattr("lcorpp.assembly.track_robot.set_up_track_robot", None)  # is not called
    ended = lcorpp("robot", "--config", config())
    assert ended.code == 2
    words = r"lcorpp: ws://127\.0\.0\.1:9: no rosbridge server can be reached.*\n"
    assert re.fullmatch(NOTE + words, ended.err)


def test_a_configuration_is_checked_without_a_robot(lcorpp, config):
    ended = lcorpp("check", config())
    assert ended.code == 0
    assert "robot.toml: intention by LCORPP; rosbridge for ROS 2 at ws://127.0.0.1:9;" in ended.out
    assert "3 actions: OK" in ended.out


def test_check_names_what_the_robot_does_not_perceive(lcorpp, config):
    ended = lcorpp("check", config(facts="", answers="", utterances=""))
    assert "note: the robot does not observe time, location" in ended.out
    assert "note: the robot cannot hear: every observation is none" in ended.out


def test_check_locates_a_mistake(lcorpp, config):
    ended = lcorpp("check", config(turn='[actions.turn]\nskill = "spin"'))
    assert ended.code == 2
    assert "[actions.turn] skill: 'spin'; expected one of navigate, turn" in ended.err


def test_trust_in_a_model_that_it_cannot_follow_is_refused(lcorpp, config, folder):  # noqa: F811
    file = folder / "heard" / "interaction.pomdp"
    text = file.read_text()
    begin, end = text.index("O: turn"), text.index("O: report_interested")
    rows = text[begin:end].replace("0.9 0.1 0.0", "0.8 0.1 0.1").replace("0.1 0.9 0.0", "0.1 0.8 0.1")
    try:
        file.write_text(text[:begin] + rows + text[end:])
        ended = lcorpp("robot", "--config", config(domain='domain = "heard"\nstrategy = "LCORPP+trust"'))
    finally:
        file.write_text(text)
    assert ended.code == 2
    assert "after 'turn' and 'none' the planner's own variables may have several values" in ended.err

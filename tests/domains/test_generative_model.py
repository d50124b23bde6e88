"""Domains whose model is simulated: against tables, Bayes' rule by hand, and logs that replay."""

from __future__ import annotations

import pickle
import shutil
from math import exp
from pathlib import Path

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.decision import strategies
from lcorpp.errors import DomainError, ModelError, ObservationError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning import GenerativeModel, GenerativePlanner, SearchOptions, Widening
from tests.planning.models import DOOR

KNOWLEDGE = """
sides = {left, right}.  times = {early, late}.
side : sides.  time : times.
random(side).  random(time).
pr(side=left | time=early) = 0.7.
"""
TOML = """name = "door"
[reasoning]
program = "knowledge.plog"
observed = ["time"]
shared = ["side"]
[planning]
reports = "open_{side}"
[presets.tables.planning]
model = "door.pomdp"
terminal = "over"
[presets.simulated.planning]
model = "door.py:Door"
simulations = 1000
particles = 200
[presets.bounded.planning]
model = "door.py:Bounded"
particles = 200
samples = 40
expansions = 30
[presets.many.planning]
model = "door.py:Many"
particles = 200
samples = 50
expansions = 40
[presets.numbers.planning]
model = "door.py:Numbers"
simulations = 2000
particles = 4000
widening = [3, 0.1]
"""
CODE = """from math import exp

import numpy as np


class Door:
    actions, discount, observations = ("listen", "open_left", "open_right"), 0.95, ("l", "r")

    def start(self, value, rng):
        return value

    def shared(self, state):
        return None if state == "over" else state

    def step(self, state, action, rng):
        if action != "listen":
            return "over", "l", 10.0 if action == "open_" + state else -20.0
        right = rng.random() < 0.8
        return state, "l" if right == (state == "left") else "r", -1.0

    def likelihood(self, observation, state, action, next_state):
        if action != "listen":
            return float(observation == "l")
        return 0.8 if observation == next_state[0] else 0.2


class Numbers(Door):
    observations = None

    def step(self, state, action, rng):
        if action != "listen":
            return "over", 0.0, 10.0 if action == "open_" + state else -20.0
        return state, rng.normal(-1.0 if state == "left" else 1.0), -1.0

    def likelihood(self, observation, state, action, next_state):
        if action != "listen":
            return float(observation == 0.0)
        return exp(-0.5 * (observation - (-1.0 if next_state == "left" else 1.0)) ** 2)


class Bounded(Door):
    def lower(self, state):
        return -20.0

    def upper(self, state):
        return 10.0


class Many:
    vectorised = True
    actions, discount = Door.actions, Door.discount

    def __init__(self, values):
        self.sides = values["side"]

    def start(self, value, count, rng):
        return np.full((count, 1), self.sides.index(value))

    def shared(self, states):
        return np.where(states[:, 0] == 2, -1, states[:, 0])

    def step(self, states, actions, rng):
        side = states[:, 0]
        rewards = np.select([actions == 0, actions - 1 == side], [-1.0, 10.0], -20.0)
        heard = np.where(actions == 0, rng.normal(2.0 * side - 1), 0.0)
        return np.where(actions == 0, side, 2)[:, None], heard, rewards

    def likelihood(self, observations, states, actions, after):
        density = np.exp(-0.5 * (observations - (2.0 * states[:, 0] - 1)) ** 2)
        return np.where(actions == 0, density, observations == 0)

    def lower(self, states):
        return np.full(len(states), -20.0)

    def upper(self, states):
        return np.full(len(states), 10.0)
"""


@pytest.fixture
def door(tmp_path):
    for name, text in (
        ("knowledge.plog", KNOWLEDGE),
        ("door.pomdp", DOOR),
        ("domain.toml", TOML),
        ("door.py", CODE),
    ):
        (tmp_path / name).write_text(text)
    return tmp_path


def load_numbers(folder):
    return load_domain(folder, preset="numbers")


@pytest.mark.parametrize("preset", ["simulated", "bounded"])
def test_simulated_decisions_earn_what_the_tables_say(door, preset):
    tables, simulated = (load_domain(door, preset=name) for name in ("tables", preset))
    chosen = strategies(["R", "P", "R+P"], [])
    exact = compare_strategies(tables, ComparisonOptions(chosen, trials=None))
    sampled = compare_strategies(simulated, ComparisonOptions(chosen, trials=500, seed=3))
    assert sampled.solution is None
    for one, other in zip(exact.scores, sampled.scores, strict=True):
        deviation = (other.return_.high - other.return_.low) / 4
        assert one.return_.estimate == pytest.approx(other.return_.estimate, abs=3 * deviation), one.strategy
    assert sampled.scores[2].return_.estimate > sampled.scores[0].return_.estimate + 1


@pytest.mark.parametrize("preset", ["numbers", "many"])
def test_beliefs_follow_bayes_rule(door, preset):
    domain = load_domain(door, preset=preset)
    planner = GenerativePlanner(domain.model, SearchOptions(particles=200, widening=Widening()))
    belief, odds = np.array([0.9, 0.1, 0.0]), 0.1 / 0.9
    for heard in (0.3, -0.2, 2.0):
        belief = planner.update(belief, "listen", str(heard))
        odds *= exp(2 * heard)
        # the side does not change, so that each side's particles have one likelihood: no error of sampling
        assert belief[1] == pytest.approx(odds / (1 + odds), abs=1e-9)
    assert belief[2] == 0


@pytest.mark.parametrize("preset", ["numbers", "many"])
def test_improbable_values_keep_their_particles(door, preset):
    model = load_domain(door, preset=preset).model
    planner = GenerativePlanner(model, SearchOptions(particles=100, widening=Widening()))
    belief = planner.update(np.array([1 - 1e-6, 1e-6, 0.0]), "listen", "0.0")
    for _ in range(10):
        belief = planner.update(belief, "listen", "1.0")
    assert belief[1] == pytest.approx(1e-6 * exp(20) / (1 + 1e-6 * exp(20)), rel=1e-4)


def test_results_depend_on_the_history_alone(door):
    domain = load_numbers(door)
    one, other = (GenerativePlanner(domain.model, domain.planning.search) for _ in range(2))
    other.action(np.array([0.2, 0.8, 0.0]))  # an earlier search changes nothing
    prior = np.array([0.6, 0.4, 0.0])
    beliefs = [planner.update(prior, "listen", "0.25") for planner in (one, other)]
    np.testing.assert_array_equal(*beliefs)
    np.testing.assert_array_equal(one.search(beliefs[0]).values, other.search(beliefs[1]).values)
    assert one.search(beliefs[0]) is one.search(beliefs[0])


def test_the_model_goes_to_other_processes_by_its_file(door):
    model = load_numbers(door).model
    again = pickle.loads(pickle.dumps(model))
    assert again.actions == model.actions
    assert again.fingerprint == model.fingerprint
    assert repr(again) == "<GenerativeModel Numbers: 2 values, 3 actions, observations that are numbers>"


def test_a_logged_decision_repeats(lcorpp, door):
    log = door / "log.jsonl"
    ended = lcorpp("explain", door, "--preset", "numbers", "--fact", "time=early", "--seed", 4, "--log", log)
    assert ended.code == 0, ended.err
    assert "search at each step: 2000 simulations, 4000 particles" in ended.out
    assert "value about" in ended.out
    assert "1 decisions, 0 differences" in lcorpp("replay", log).out
    (door / "domain.toml").write_text(TOML.replace("simulations = 2000", "simulations = 3"))
    assert "changed since the log: domain: " in lcorpp("replay", log).out


def test_a_logged_decision_of_a_search_with_bounds_repeats(lcorpp, door):
    log = door / "log.jsonl"
    ended = lcorpp("explain", door, "--preset", "many", "--fact", "time=late", "--seed", 4, "--log", log)
    assert ended.code == 0, ended.err
    expected = (
        "search at each step: 40 expansions of 50 particles, 200 particles; bounds on values are estimates"
    )
    assert expected in " ".join(ended.out.split())
    assert " to " in ended.out.partition("value about ")[2].splitlines()[0]
    assert "1 decisions, 0 differences" in lcorpp("replay", log).out
    (door / "domain.toml").write_text(TOML.replace("expansions = 40", "expansions = 3"))
    assert "changed since the log: domain: " in lcorpp("replay", log).out


GUIDE = """class Guide:
    actions, discount = ("point", "to_lab", "to_office", "to_store"), 0.9
    observations = ("yes", "no", "shrug", "silence")
    right = {"lab": "yes", "office": "no", "store": "shrug"}

    def start(self, value, rng):
        return value

    def shared(self, state):
        return state

    def step(self, state, action, rng):
        if action != "point":
            return None, "silence", 10.0 if action == "to_" + state else -10.0
        others = [answer for answer in ("yes", "no", "shrug") if answer != self.right[state]]
        return state, self.right[state] if rng.random() < 0.8 else others[int(rng.integers(2))], -1.0

    def likelihood(self, observation, state, action, next_state):
        if action != "point":
            return float(observation == "silence")
        return 0.8 if observation == self.right[next_state] else 0.1
"""


def test_algorithm_1_decides_with_the_model_and_its_log_repeats(lcorpp, tmp_path):
    folder = tmp_path / "rooms"
    shutil.copytree(Path(__file__).parent / "rooms", folder)
    (folder / "guide.py").write_text(GUIDE)
    text = (folder / "domain.toml").read_text().partition("[presets.calm]")[0]
    for line in ('states = "wants_{goal}"', 'terminal = "gone"', "noise = 0.2"):
        text = text.replace(f"{line}\n", "")
    text = "\n".join(line for line in text.splitlines() if not line.startswith("feedback"))
    (folder / "domain.toml").write_text(text.replace('"guide.pomdp"', '"guide.py:Guide"\nsimulations = 300'))
    log = tmp_path / "log.jsonl"
    options = ("--learner", "summaries", "--tracks", 30, "--batch-size", 10, "--max-batches", 1, "--jobs", 1)
    ended = lcorpp("learn", folder, *options, "--log", log)
    assert ended.code == 0, ended.err
    assert "batch 1: 40 tracks" in ended.out
    assert "10 decisions, 0 differences" in lcorpp("replay", log).out


def test_runs_in_two_processes_are_those_of_one(lcorpp, door):
    ended = lcorpp("run", door, "--preset", "simulated", "--trials", 300, "--jobs", 2, "--seed", 1)
    assert ended.code == 0, ended.err
    assert "300 trials" in ended.out
    assert "LCORPP+trust is left out" in ended.out
    alone = lcorpp("run", door, "--preset", "simulated", "--trials", 300, "--jobs", 1, "--seed", 1)
    assert alone.out == ended.out


def test_people_at_the_keyboard_answer_with_numbers(lcorpp, door, monkeypatch):
    typed = iter(["many", "[1, 2", "-3.5", "-3.5"])
    monkeypatch.setattr("lcorpp.cli.console.ask", lambda _question: next(typed))
    ended = lcorpp("explain", door, "--preset", "numbers", "--interactive", "--fact", "time=late")
    assert ended.code == 0, ended.err
    assert ended.out.count("expected a number, or numbers as in [1, 2.5]") == 2
    assert "side = left" in ended.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "--exact"), "the model is simulated, without the tables that are needed here"),
        (("run", "--solver", "sarsop"), "--solver: "),
        (("run", "--time-limit", "3"), "--time-limit: "),
        (("explain", "--fact", "time=early", "--answers", "loud"), "--answers 'loud': the observation"),
        (("show",), "the model is simulated"),
    ],
)
def test_what_needs_tables_is_refused(lcorpp, door, arguments, message):
    command, *rest = arguments
    ended = lcorpp(command, door, "--preset", "numbers", *rest)
    assert ended.code == 2
    assert message in ended.err
    assert "Traceback" not in ended.err


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("def shared", "def of", "Door: has no method shared"),
        ('("l", "r")', "3", "observations = 3; expected a tuple of distinct names"),
        ('("listen", "open_left"', '("listen", "listen"', "expected a tuple of distinct names"),
        ("0.95", "1.0", "discount = 1.0; expected a number above 0 and below 1"),
        ("else state\n", "else state[0]\n", "shared() returned 'l'; expected one of left, right"),
        ("return value", "return 'right'", "start('left') has the shared value 'right'"),
        ('else "r", -1.0', 'else "r"', "for 'listen'; expected (next state, observation, reward)"),
        ("-1.0\n\n    def likelihood", 'float("nan")\n\n    def likelihood', "the reward of 'listen' is nan"),
        ('"over", "l"', '"over", "x"', "step() observed 'x'; expected one of l, r"),
        (
            "return 0.8 if",
            "return 1 / 0 if",
            "door.py:24: the simulation of its actions failed: ZeroDivision",
        ),
        ("return 0.8 if", "return 0.0 if", "expected a number above 0"),
        ("rng.random()", "rng.random(", "SyntaxError"),
        ("rng.random() <", "rng.rnd() <", "door.py:18: the simulation of its actions failed: AttributeError"),
    ],
)
def test_mistakes_are_found_before_work_starts(door, before, after, message):
    assert before in CODE
    (door / "door.py").write_text(CODE.replace(before, after, 1))
    with pytest.raises((DomainError, ModelError)) as error:
        load_domain(door, preset="simulated")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('solver = "sarsop"', "is simulated, it has no tables; expected no 'solver'"),
        ('terminal = "over"', "expected no 'terminal'"),
        ("simulations = 0", "simulations"),
        ("widening = 4", "expected [FACTOR, POWER], e.g. [4, 0.05]"),
        ("widening = [4, 2]", "the power of widening is 2"),
    ],
)
def test_wrong_keys_name_their_line(door, line, message):
    text = TOML[: TOML.index("simulations = 2000")] + line
    (door / "domain.toml").write_text(text)
    with pytest.raises(DomainError) as error:
        load_numbers(door)
    assert message in str(error.value)
    assert f"domain.toml:{len(text.splitlines())}" in str(error.value)


@pytest.mark.parametrize(
    ("preset", "key", "message"),
    [
        (
            "bounded",
            "simulations",
            "has bounds, so that the search is another one; expected no 'simulations'",
        ),
        ("many", "widening", "has bounds, so that the search is another one; expected no 'widening'"),
        ("simulated", "expansions", "has no methods lower and upper; expected no 'expansions'"),
        ("numbers", "samples", "has no methods lower and upper; expected no 'samples'"),
    ],
)
def test_keys_of_the_other_search_are_refused(door, preset, key, message):
    with pytest.raises(DomainError) as error:
        load_domain(door, preset=preset, changes={"planning": {key: 3}})
    assert message in str(error.value)


def test_keys_of_the_search_need_a_simulated_model(door):
    with pytest.raises(DomainError, match=r"door.pomdp has tables, .* expected no 'particles'"):
        load_domain(door, preset="tables", changes={"planning": {"particles": 3}})


def test_feedback_is_part_of_the_simulation(door):
    with pytest.raises(DomainError, match="simulates the answers; expected no 'noise'"):
        load_domain(door, preset="simulated", changes={"simulation": {"noise": 0.1}})


def test_impossible_and_unknown_observations_are_errors(door):
    planner = GenerativePlanner(load_domain(door, preset="simulated").model)
    with pytest.raises(ObservationError, match="unknown observation 'x'; expected one of l, r"):
        planner.update(planner.start, "listen", "x")
    with pytest.raises(ObservationError, match="impossible in all"):
        planner.update(planner.start, "open_left", "r")
    with pytest.raises(ModelError, match="unknown action 'wait'"):
        planner.update(planner.start, "wait", "l")
    with pytest.raises(ModelError, match="is no prior"):
        planner.action(np.array([0.5, 0.2, 0.0]))


class Scale:
    """A value in tuples of numbers; a weight that is worth what it weighs."""

    actions, discount = ("weigh", "say_a", "say_b"), 0.5

    def start(self, value, rng):
        return value

    def shared(self, state):
        return state

    def step(self, state, action, rng):
        return state, (1, (np.float64(0.1), 2.0)), float("inf") if rng.random() < self.share else 1.0

    share = 0.0

    def likelihood(self, observation, state, action, next_state):
        return 1.0


def test_tuples_travel_as_json_and_infinite_rewards_are_refused():
    model = GenerativeModel(scale := Scale(), ("a", "b"))
    text = model.format_observation((1, (np.float64(0.1), 2.0)))
    assert text == "[1, [0.1, 2.0]]"
    assert model.read_observation(text) == (1, (0.1, 2.0))
    scale.share = 0.5
    planner = GenerativePlanner(model)
    with pytest.raises(ModelError, match="Scale: a reward or value in the search is not finite"):
        planner.action(planner.start)


def test_a_shared_value_named_over_is_no_problem():
    model = GenerativeModel(Scale(), ("over", "b"))
    assert model.states == ("over", "b", "over_")

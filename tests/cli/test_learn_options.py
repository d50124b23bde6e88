"""`lcorpp learn` with the options that `run` has: threshold, prevalence, smoothing, policy and world."""

import json
import re

import pytest

from lcorpp import load_domain
from lcorpp.assembly.solving import solve_domain
from lcorpp.planning import write_policy

pytestmark = pytest.mark.usefixtures("unrendered")

FAST_OPTIONS = ("--tracks", 40, "--learner", "summaries", "--batch-size", 4, "--epsilon", 0, "--jobs", 1)

WORLD = """
class Honest:
    def __init__(self, person, rng):
        self.answer = "pos" if person["intention"] == "interested" else "neg"
    def act(self, action):
        return self.answer
    def report(self, action):
        pass
"""


def learn(lcorpp, *options, batches=1):
    ended = lcorpp("learn", *FAST_OPTIONS, "--max-batches", batches, *options)
    assert ended.code == 0, ended.err
    return [line for line in ended.out.splitlines() if line.startswith("batch")]


@pytest.mark.parametrize("labels", ["hard", pytest.param("corrected", marks=pytest.mark.slow)])
def test_the_threshold_determines_the_labels_and_the_matrix(lcorpp, labels):
    always = learn(lcorpp, "--threshold", 0, "--labels", labels)
    assert all("interested 0.9" in line and "not_interested 0.0" in line for line in always)
    few = learn(lcorpp, "--threshold", "accuracy", "--prevalence", 0.01, "--labels", labels)
    assert re.search(r"not_interested (0.9|1.0)", few[1])
    if labels == "hard":
        assert learn(lcorpp, "--threshold", 0.5) == learn(lcorpp)


def test_a_resumed_run_keeps_its_threshold(lcorpp, tmp_path):
    store = ("--threshold", "youden", "--store", tmp_path / "s.tracks")
    learn(lcorpp, *store)
    resumed = lcorpp("learn", *FAST_OPTIONS, *store, "--max-batches", 2).out
    batches = [line for line in resumed.splitlines() if line.startswith("batch")]
    assert batches == learn(lcorpp, "--threshold", "youden", batches=2)[-1:]
    other = lcorpp("learn", *FAST_OPTIONS, *store[2:], "--threshold", 0.7, "--max-batches", 3)
    assert "threshold was youden, and is 0.7 now; trained on all that is stored" in other.out


def test_the_same_policy_from_a_file_decides_alike(lcorpp, tmp_path):
    policy = tmp_path / "intention.policy"
    write_policy(solve_domain(load_domain("intention")).policy, policy)
    options = ("--policy", policy, "--out", tmp_path / "out", "--format", "svg")
    assert learn(lcorpp, *options, "--log", tmp_path / "log.jsonl") == learn(lcorpp)
    assert json.loads((tmp_path / "out" / "batches.json").read_text())["solution"] is None
    replayed = lcorpp("replay", tmp_path / "log.jsonl")
    assert (replayed.code, "4 decisions, 0 differences" in replayed.out) == (0, True)


OWN = """
from dataclasses import replace

class Silent:
    def __init__(self, robot):
        self.robot, self.start = robot, robot.planner.start

    def action(self, belief):
        return self.robot.domain.report_action("not_interested")

    def update(self, belief, action, observation):
        return belief

def silent(robot):
    return replace(robot, planner=Silent(robot))

def broken(robot):
    return replace(robot, planner=Broken(robot))

class Broken(Silent):
    def action(self, belief):
        return 1 / 0
"""


def test_another_strategy_decides_and_a_resumed_run_needs_the_same(lcorpp, tmp_path):
    own, log, store = tmp_path / "own.py", tmp_path / "log.jsonl", tmp_path / "s.tracks"
    own.write_text(OWN)
    learn(lcorpp, "--strategy", f"{own}:silent", "--log", log, "--store", store)
    decisions = [json.loads(line) for line in log.read_text().splitlines()]
    reports = [step["action"] for line in decisions for step in line.get("steps", ())]
    assert reports == ["report_not_interested"] * 4
    assert "4 decisions, 0 differences" in lcorpp("replay", log).out
    command = ("learn", *FAST_OPTIONS, "--max-batches", 2, "--store", store)
    words = (
        "silent decided in the run of this store, and LCORPP does in this one; expected the same --strategy"
    )
    refused = lcorpp(*command)
    assert (refused.code, words in " ".join(refused.err.split())) == (2, True)
    assert lcorpp(*command, "--strategy", f"{own}:silent").code == 0
    failed = lcorpp("learn", *FAST_OPTIONS, "--strategy", f"{own}:broken")
    assert failed.code == 2
    assert "own.py:22: strategy 'broken' failed" in failed.err
    assert "ZeroDivisionError" in failed.err


def test_learning_without_the_knowledge_logs_decisions_of_that_strategy(lcorpp, tmp_path):
    log = tmp_path / "log.jsonl"
    learn(lcorpp, "--strategy", "L+P", "--log", log)
    replayed = lcorpp("replay", log)
    assert (replayed.code, "4 decisions, 0 differences" in replayed.out) == (0, True)
    assert "L+P" in log.read_text()


def test_smoothing_changes_the_rules_and_no_matrix(lcorpp):
    lines = [
        learn(lcorpp, "--tracks", 60, "--batch-size", 40, *smoothing)
        for smoothing in ((), ("--smoothing", "laplace"))
    ]
    assert lines[0][0] == lines[1][0]
    assert lines[0][1] != lines[1][1]


def test_an_own_world_answers(lcorpp, tmp_path):
    (tmp_path / "own.py").write_text(WORLD)
    honest = ("--world", f"{tmp_path / 'own.py'}:Honest", "--batch-size", 40)
    accuracy, expected = (
        float(re.search(r"F1 ([.\d]+)", learn(lcorpp, *options)[1])[1]) for options in (honest, honest[2:])
    )
    assert accuracy > 0.95 > expected


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--threshold", "best"), "unknown goal 'best'; expected one of accuracy, f1, youden or two costs"),
        (("--threshold", 0.4, "--evidence", "soft"), "--threshold determines labels"),
        (("--smoothing", "laplace", "--evidence", "soft"), "--smoothing applies to the labels"),
        (("--prevalence", 0.1), "--prevalence: it is for thresholds; expected --threshold, too"),
        (("--policy", "no.policy"), "no.policy"),
        (("--policy", "no.policy", "--solver", "exact"), "--solver: nothing is solved, as --policy gives"),
        (("--world", "own.py"), "the world 'own.py': expected FILE.py:NAME"),
        (("--strategy", "L+Q"), "unknown strategy 'L+Q'; expected one of"),
        (("--strategy", "random"), "strategy 'random' draws its actions; expected one that does not"),
        (("--strategy", "L+P", "--trust"), "--strategy: --trust is --strategy LCORPP+trust; expected one of"),
    ],
)
def test_options_without_effect_or_meaning_are_refused(lcorpp, options, words):
    refused = lcorpp("learn", *FAST_OPTIONS, *options)
    assert (refused.code, words in refused.err, "Traceback" in refused.err) == (2, True, False)

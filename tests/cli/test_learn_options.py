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
    ],
)
def test_options_without_effect_or_meaning_are_refused(lcorpp, options, words):
    refused = lcorpp("learn", *FAST_OPTIONS, *options)
    assert (refused.code, words in refused.err, "Traceback" in refused.err) == (2, True, False)

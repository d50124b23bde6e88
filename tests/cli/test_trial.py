"""`lcorpp run --trial`: one trial of a comparison, step by step."""

import json
import re

import pytest

from tests.cli.planner import refused

pytestmark = pytest.mark.usefixtures("unrendered")

CHANNEL = ("--classifier", "channel")


def read_decision(text):
    """The evidence, actions with observations, report, cost and return of a printed decision."""
    (given,) = re.findall(r"2  reasoning   given (.*)", text)
    steps = re.findall(r"^\d+  (\w+)   (?:observes (\w+)|the decision)$", text, re.M)
    report, verdict, cost, return_ = re.search(
        r"^\S.* = (\S+) \((.*)\)\ncost (\S+), return (\S+)$", text, re.M
    ).groups()
    return given, steps, report, verdict == "correct", float(cost), float(return_)


def read_logged(decision, shared):
    """The same of a line of a log."""
    known = decision["simulated"]
    given = ", ".join(f"{name} = {value}" for name, value in decision["evidence"].items())
    steps = [(step["action"], step["observation"] or "") for step in decision["steps"]]
    report, right = decision["report"], decision["report"] == known["truth"][shared]
    return given, steps, report, right, known["cost"], known["return"]


@pytest.mark.parametrize(
    ("domain", "shared", "trials", "options"),
    [
        ("intention", "intention", 110, (*CHANNEL, "--strategy", "L", "--strategy", "random")),
        ("intention", "intention", 110, ("--strategy", "R+P", "--preset", "authors", "--seed", 7)),
        ("museum", "wish", 20, (*CHANNEL, "--strategy", "LCORPP-motion", "--strategy", "LCORPP+trust")),
    ],
)
def test_a_trial_is_that_of_the_log(lcorpp, tmp_path, domain, shared, trials, options):
    """Also one of the last chunk, which is not full, and with actions that are drawn."""
    log = tmp_path / "log.jsonl"
    command = ("run", domain, "--trials", trials, "--jobs", 1, *options)
    assert lcorpp(*command, "--log", log).code == 0
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    for trial in (17, trials - 1):
        ended = lcorpp(*command, "--trial", trial)
        assert ended.code == 0, ended.err
        _, *printed = re.split(rf"^trial {trial}, (.*)$", ended.out, flags=re.M)
        logged = [line for line in lines if line["simulated"]["trial"] == trial]
        assert printed[::2] == [line["strategy"]["name"] for line in logged]
        for text, line in zip(printed[1::2], logged, strict=True):
            assert read_decision(text) == read_logged(line, shared)
            state, probability = next(iter(line["prior"].items()))
            assert re.search(rf"the prior belief\n +{state} +{probability:.6f} ", text)


def test_a_strategy_meets_the_same_people_alone(lcorpp):
    """Also without the first sense, whose signals are drawn before those of the second."""
    command = ("run", "museum", *CHANNEL, "--trials", 20)
    for trial in (0, 19):
        both = lcorpp(*command, "--strategy", "L", "--strategy", "LCORPP-motion", "--trial", trial)
        alone = lcorpp(*command, "--strategy", "LCORPP-motion", "--trial", trial)
        title = f"\ntrial {trial}, LCORPP-motion\n"
        assert alone.out.partition(title)[2] == both.out.partition(title)[2] != ""


def test_all_trials_together_are_the_table(lcorpp, tmp_path):
    command = ("run", *CHANNEL, "--trials", 6, "--jobs", 1, "--strategy", "LCORPP")
    assert lcorpp(*command, "--out", tmp_path, "--format", "svg").code == 0
    (results,) = json.loads((tmp_path / "results.json").read_text())["strategies"]
    decisions = [read_decision(lcorpp(*command, "--trial", trial).out) for trial in range(6)]
    assert sum(right for _, _, _, right, _, _ in decisions) / 6 == pytest.approx(results["accuracy"])
    assert sum(cost for *_, cost, _ in decisions) / 6 == pytest.approx(results["cost"])
    assert sum(return_ for *_, return_ in decisions) / 6 == pytest.approx(results["return"])


def test_a_trial_with_a_trained_classifier_and_soft_evidence(lcorpp, tmp_path):
    log = tmp_path / "log.jsonl"
    training = ("--learner", "summaries", "--tracks", 60, "--evidence", "soft", "--jobs", 1)
    command = ("run", "--trials", 4, "--strategy", "LCORPP", *training)
    assert lcorpp(*command, "--log", log).code == 0
    line = json.loads(log.read_text().splitlines()[2])
    ended = lcorpp(*command, "--trial", 2)
    assert "the classifier's likelihood, scaled to a maximum of 1" in ended.out
    text = ended.out.partition("trial 2, LCORPP")[2]
    assert read_decision(text)[1:] == read_logged(line, "intention")[1:]
    for value, likelihood in line["labels"]["motion"].items():
        assert re.search(rf"^ +{value} +{likelihood:.6f} ", text, re.M)


def test_wrong_trials_are_refused_before_the_work(lcorpp, tmp_path):
    refused(lcorpp("run", "--trial", 5000), "--trial 5000: expected 0 to 4999, as there are 5000 trials")
    refused(lcorpp("run", "--trials", 10, "--trial", 10), "--trial 10: expected 0 to 9")
    for options in (("--exact", *CHANNEL), ("--log", tmp_path / "log"), ("--out", tmp_path)):
        ended = lcorpp("run", *options, "--trial", 1)
        refused(ended, f"{options[0]}: one trial is printed with --trial, nothing is scored")
    refused(lcorpp("run", "--trial", -1), "-1 is not in the range x>=0")

"""The engine of the page: its replies are those of the library."""

import numpy as np
import pytest

from lcorpp import Instance, Robot, dt_control
from lcorpp.learning import StreamingClassifier
from lcorpp.web.session import draw_index
from tests.web.conftest import Page

FACTS = {"time": "afternoon", "location": "classroom"}


class Answers:
    """A world that gives prepared answers."""

    def __init__(self, answers):
        self._answers = iter(answers)

    def act(self, action):
        return next(self._answers)

    def report(self, action):
        pass


def test_a_trial_is_algorithm_2(page, intention):
    page.send("observe", facts=FACTS, labels={})
    page.walk(1.0)
    first, *steps = page.answer_all("neg")
    streams = StreamingClassifier.from_trained(intention.classifiers["motion"])
    for i in range(30):
        streams.push(i / 10, 0, 1.0, 9 - i / 10)
    robot = Robot(
        {"motion": streams.classifier(0)}, intention.robot.reasoner, intention.robot.planner, intention.domain
    )
    signals = {"motion": np.zeros((2, 30))}  # the classifier already has its prediction
    episode = dt_control(robot, Instance(signals, FACTS), Answers([step["heard"] for step in steps]))
    assert first["shared"] == pytest.approx(list(episode.marginal.probabilities))
    asked = [first["action"], *[step["action"] for step in steps]]
    assert asked == [step.action for step in episode.steps]
    for reply, step in zip(steps, episode.steps, strict=False):
        belief = dict(zip(intention.domain.pomdp.states, step.belief, strict=True))
        assert reply["belief"] == pytest.approx({state: p for state, p in belief.items() if p})
    assert steps[-1]["report"] == [episode.report]


def test_marginals_are_those_of_the_reasoner(page, intention):
    reply = page.send("observe", facts=FACTS, labels={})
    for name, marginal in reply["marginals"].items():
        expected = intention.robot.reasoner.posterior(name, FACTS)
        assert marginal == pytest.approx(list(expected.probabilities))


def test_rules_that_fire_are_sentences(page):
    reply = page.send("observe", facts={"time": "afternoon", "location": "library"}, labels={})
    sentences = [rule["sentence"] for rule in reply["fired"]]
    assert "If identity is visitor, location is library with probability 80 %." in sentences
    assert reply["world"]["identity"] == "visitor"
    reply = page.send("observe", facts={"time": "afternoon", "location": "classroom"}, labels={})
    (sentence,) = [rule["sentence"] for rule in reply["fired"] if rule["about"] == "location"]
    assert sentence.startswith("If identity is visitor, location is library with probability 80 %; here it ")
    assert sentence.endswith("it is classroom.")


def test_the_label_of_a_track_becomes_evidence(page):
    page.send("observe", facts=FACTS, labels={})
    prediction = page.walk(1.0)
    assert sum(prediction["probabilities"]) == pytest.approx(1)
    reply = page.send("observe", facts=FACTS, labels={})
    assert reply["evidence"] == {**FACTS, "classifier": prediction["label"]}


def test_labels_of_other_senses_are_chosen(museum):
    page = Page(museum)
    reply = page.send("observe", facts={"group": "family"}, labels={"gaze": "at_robot"})
    assert reply["evidence"] == {"group": "family", "gaze": "at_robot"}
    refused = page.send("observe", facts={}, labels={"gaze": "up"})
    assert refused["message"].startswith("observe: labels: gaze 'up'; expected one of at_robot")


def test_values_of_actions_are_bellmans(page, intention):
    first = page.send("decide")
    values = {row["action"]: row["value"] for row in first["values"]}
    policy, domain = intention.parts.policy, intention.domain
    prior = np.array([first["belief"].get(state, 0) for state in domain.pomdp.states])
    assert values[first["action"]] == pytest.approx(policy.value(prior), abs=0.01)
    assert max(values.values()) >= policy.value(prior) - 1e-9


def test_outcomes_are_what_follows(page):
    first = page.send("decide")
    expected = {row["observation"]: row for row in first["outcomes"]}
    step = page.send("answer", said="pos", draw=0.0)
    assert step["heard"] == "pos"
    assert step["action"] == expected["pos"]["action"]
    assert step["shared"] == pytest.approx(expected["pos"]["shared"])


def test_the_fan_is_the_value_function(page, intention):
    first = page.send("decide")
    fan = np.array([row["values"] for row in first["fan"]])
    prior = np.array([first["belief"].get(state, 0) for state in intention.domain.pomdp.states])
    assert max(fan @ first["shared"]) == pytest.approx(intention.parts.policy.value(prior), abs=1e-3)


def test_hearing_is_that_of_the_domain(page):
    noise = page.send("hello")["noise"]["greet"]["pos"]
    assert noise == pytest.approx([0.7, 0.3, 0])
    page.send("start")
    page.send("decide")
    assert page.send("answer", said="pos", draw=0.69)["heard"] == "pos"
    page.send("start")
    page.send("decide")
    assert page.send("answer", said="pos", draw=0.71)["heard"] == "neg"


def test_a_draw_above_a_rounded_sum_is_the_last_possible_index():
    assert draw_index([0.5, 0.5 - 1e-12, 0.0], 1 - 1e-13) == 1


def test_a_record_is_a_line_of_the_decision_log(page, tmp_path):
    import json

    from lcorpp.logs.decision_log import read_log

    page.send("observe", facts=FACTS, labels={})
    page.answer_all("pos")
    line = page.send("record")["line"]
    (tmp_path / "log").write_text(json.dumps(line) + "\n")
    (logged,) = read_log(tmp_path / "log")
    assert logged.context == FACTS
    assert len(logged.content["steps"]) == len(line["steps"])


def test_each_decision_is_logged_when_it_ends(intention):
    lines = []
    page = Page(intention, log=lines.append)
    page.answer_all("pos")
    assert len(lines) == 1


def test_a_judged_trial_is_kept_once(intention):
    kept = []

    def keep(trial):
        kept.append(trial)
        return {"stored": 1, "batch": 5}

    page = Page(intention, keep=keep)
    page.walk(1.0)
    reported = page.answer_all("pos")[-1]["report"][0]
    wrong = page.send("judge", right=False, truth=[reported])
    assert wrong["message"] == f"judge: truth: {reported} is what the robot reported; expected another value"
    assert page.send("judge", right=True, truth=None) == {
        "id": page.n_sent,
        "type": "judged",
        "learns": True,
        "stored": 1,
        "batch": 5,
    }
    assert page.send("judge", right=True, truth=None)["code"] == "out_of_order"
    assert [trial.truth for trial in kept] == [reported]


ORDER = {
    "answer before a decision": ([], "answer", {"said": "pos", "draw": 0.1}, "the robot has not asked"),
    "judge before a report": (["decide"], "judge", {"right": True, "truth": None}, "has not reported"),
    "a second decision": (["decide"], "decide", {}, "the robot is already deciding"),
    "facts after the decision": (["decide"], "observe", {"facts": {}, "labels": {}}, "is already deciding"),
    "a record of nothing": ([], "record", {}, "there is no decision"),
}


@pytest.mark.parametrize(("before", "type", "fields", "message"), ORDER.values(), ids=ORDER)
def test_requests_out_of_order_change_nothing(page, before, type, fields, message):
    for earlier in before:
        page.send(earlier)
    reply = page.send(type, **fields)
    assert (reply["type"], reply["code"]) == ("error", "out_of_order")
    assert message in reply["message"]
    assert page.send("start")["type"] == "started"


WRONG = {
    "an unknown fact": ("observe", {"facts": {"weather": "rain"}, "labels": {}}, "'weather' is not observed"),
    "an unknown value": ("observe", {"facts": {"time": "noon"}, "labels": {}}, "time cannot be 'noon'"),
    "a label of a track": ("observe", {"facts": {}, "labels": {"motion": "one"}}, "labels: 'motion'"),
    "an unknown sense": ("samples", {"sense": "ears", "samples": [[0, 1, 2]]}, "sense: 'ears'"),
    "too few numbers": ("samples", {"sense": "motion", "samples": [[0, 1]]}, "expected time, x, y"),
}


@pytest.mark.parametrize(("type", "fields", "message"), WRONG.values(), ids=WRONG)
def test_wrong_names_are_refused(page, type, fields, message):
    reply = page.send(type, **fields)
    assert (reply["type"], reply["code"]) == ("error", "invalid")
    assert message in reply["message"]


def test_an_unknown_answer_keeps_the_question(page):
    asked = page.send("decide")["action"]
    assert page.send("answer", said="maybe", draw=0.1)["message"].startswith(
        "answer: said: 'maybe'; expected"
    )
    assert page.send("answer", said="pos", draw=0.1)["answered"] == asked


def test_a_track_has_a_maximum_length(page, monkeypatch):
    monkeypatch.setattr("lcorpp.web.session.MAX_TRACK", 2)
    page.send("samples", sense="motion", samples=[[0, 1, 2], [1, 1, 2]])
    refused = page.send("samples", sense="motion", samples=[[2, 1, 2]])
    assert (refused["code"], refused["message"]) == (
        "too_large",
        "samples: expected at most 2 of them in a trial",
    )

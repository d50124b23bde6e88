"""The service behind a page: what it infers, classifies, keeps and logs, and what it refuses."""

import json
from dataclasses import replace

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly.options import TrainingOptions
from lcorpp.errors import UndefinedError
from lcorpp.learning import StreamingClassifier
from lcorpp.logs.decision_log import read_log
from lcorpp.logs.replay import replay_log
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.web import service as web_service
from lcorpp.web.knowledge import Knowledge
from lcorpp.web.model import make_model
from lcorpp.web.robot import PlayRobot
from lcorpp.web.server import PageServer
from lcorpp.web.service import Service
from lcorpp.web.setup import set_up_robot
from tests.web.conftest import Asker, play, serve

FACTS = {"time": "afternoon", "location": "classroom"}


def test_the_model_comes_with_the_first_trial_and_with_another_robot(asker, intention):
    assert asker.send("start")["model"] is None
    asker.robot = PlayRobot(intention.parts, intention.classifiers)
    assert asker.send("start")["model"] == make_model(intention, learns=False)
    assert asker.send("start")["model"] is None


def test_another_robot_does_not_change_the_trial(asker):
    before = asker.send("infer", facts=FACTS, labels={})
    asker.robot = None
    assert asker.send("infer", facts=FACTS, labels={}) | {"id": before["id"]} == before


def test_nothing_is_done_before_a_trial(intention):
    asker = Asker(intention)
    for type, fields in REQUESTS.items():
        assert asker.send(type, **fields)["code"] == "out_of_order"


def test_rules_that_fire_are_sentences(asker):
    reply = asker.send("infer", facts={"time": "afternoon", "location": "library"}, labels={})
    sentences = [rule["sentence"] for rule in reply["fired"]]
    assert "If identity is visitor, location is library with probability 80 %." in sentences
    assert reply["world"]["identity"] == "visitor"
    reply = asker.send("infer", facts=FACTS, labels={})
    (sentence,) = [rule["sentence"] for rule in reply["fired"] if rule["about"] == "location"]
    assert sentence.startswith("If identity is visitor, location is library with probability 80 %; here it ")
    assert sentence.endswith("it is classroom.")


def test_samples_are_classified_as_they_arrive(asker, intention):
    streams = StreamingClassifier.from_trained(intention.classifiers["motion"])
    for i in range(30):
        sample = [i / 10, 1.0, 9 - i / 10]
        prediction = streams.push(sample[0], 0, *sample[1:])
        reply = asker.send("samples", sense="motion", samples=[sample])
        assert reply["points"] == prediction.points
    assert reply["probabilities"] == pytest.approx(list(prediction.probabilities))
    assert reply["class"] == streams.classifier(0).classify(np.zeros(1))
    asker.send("start")
    assert asker.send("samples", sense="motion", samples=[sample])["points"] == 1


def test_a_track_has_a_maximum_length(asker, monkeypatch):
    monkeypatch.setattr(web_service, "MAX_TRACK", 2)
    track = [[i, 1, 2] for i in range(3)]
    asker.send("samples", sense="motion", samples=track[:2])
    judged = {"facts": {}, "samples": {"motion": track}, "value": ["interested"]}
    for reply in (
        asker.send("samples", sense="motion", samples=track[2:]),
        asker.send("judge", **judged),
    ):
        assert reply["code"] == "too_large"
        assert reply["message"].endswith(": expected at most 2 samples in a trial")


def test_a_judged_trial_is_kept(intention):
    kept = []

    def keep(trial):
        kept.append(trial)
        return {"stored": 1, "batch": 5}

    asker = Asker(intention, keep=keep)
    assert asker.send("start")["model"]["domain"]["learns"]
    reply = asker.send("judge", facts=FACTS, samples={"motion": [[0, 1, 2]]}, value=["interested"])
    assert (reply["stored"], reply["batch"]) == (1, 5)
    (trial,) = kept
    assert (trial.facts, trial.samples, trial.truth) == (FACTS, {"motion": [(0.0, 1.0, 2.0)]}, "interested")


def test_a_logged_decision_is_that_of_the_library_and_can_be_replayed(intention, tmp_path):
    file = tmp_path / "log"
    asker = Asker(intention, log=file.write_bytes)
    labels = {"motion": "interested"}
    steps = play(asker, facts=FACTS, labels=labels, said="neg")
    assert asker.send("log", facts=FACTS, labels=labels, steps=steps)["type"] == "logged"
    (logged,) = read_log(file)
    assert logged.context == FACTS
    assert [[own["action"], own["observation"]] for own in logged.content["steps"]] == steps
    (replayed,) = [own for own in replay_log(file, cache=find_cache_folder()) if hasattr(own, "differences")]
    assert replayed.differences == ()


FALSE_DECISIONS = {
    "another action": ([["turn", "pos"]], "steps: turn; expected "),
    "an unknown action": ([["dance", "pos"]], "steps: dance; expected "),
    "an unknown observation": ([["FIRST", "maybe"]], "'maybe'"),
    "no end": ([["FIRST", "pos"]], "steps: the decision has not ended; expected "),
    "a report at once": ([["report_interested", None]], "steps: report_interested; expected "),
    "steps after the report": (["ALL", ["greet", "pos"]], "expected those up to the report"),
    "an observation of the report": (["ALL", "OBSERVED"], "expected those up to the report"),
    "too many steps": ([["greet", "pos"]] * 501, "501 steps; expected at most 500"),
}


@pytest.mark.parametrize(("steps", "message"), FALSE_DECISIONS.values(), ids=FALSE_DECISIONS)
def test_false_decisions_are_not_logged(intention, steps, message):
    logged = []
    asker = Asker(intention, log=logged.append)
    right = play(asker)
    if steps[0] == "ALL":
        end = [right[-1][0], "pos"]
        steps = [*right[:-1], end] if steps[1] == "OBSERVED" else [*right, steps[1]]
    elif steps[0][0] == "FIRST":
        steps = [[right[0][0], steps[0][1]]]
    reply = asker.send("log", facts={}, labels={}, steps=steps)
    assert reply["code"] in ("invalid", "too_large")
    assert message in reply["message"]
    assert logged == []
    assert asker.send("log", facts={}, labels={}, steps=right)["type"] == "logged"


REQUESTS = {
    "infer": {"facts": {}, "labels": {}},
    "samples": {"sense": "motion", "samples": [[0, 1, 2]]},
    "judge": {"facts": {}, "samples": {}, "value": ["interested"]},
    "log": {"facts": {}, "labels": {}, "steps": [["greet", "pos"]]},
}
WRONG = {
    "an unknown fact": ("infer", {"facts": {"weather": "rain"}}, "'weather' is not observed"),
    "an unknown value": ("infer", {"facts": {"time": "noon"}}, "time cannot be 'noon'"),
    "a hidden attribute": ("infer", {"facts": {"intention": "interested"}}, "'intention' is not observed"),
    "an unknown sense": ("infer", {"labels": {"ears": "one"}}, "'ears'"),
    "an unknown class": ("infer", {"labels": {"motion": "one"}}, "unknown class 'one'"),
    "samples of an unknown sense": ("samples", {"sense": "ears"}, "sense: 'ears'; expected one of motion"),
    "too few numbers": ("samples", {"samples": [[0, 1]]}, "2 numbers; expected time, x, y"),
    "a judged unknown fact": ("judge", {"facts": {"weather": "rain"}}, "'weather' is not observed"),
    "a judged unknown sense": ("judge", {"samples": {"ears": [[0, 1, 2]]}}, "sense: 'ears'"),
    "a judged short sample": ("judge", {"samples": {"motion": [[0, 1]]}}, "2 numbers; expected time, x, y"),
    "a judged unknown value": ("judge", {"value": ["curious"]}, "value: curious; expected one of"),
    "a logged unknown fact": ("log", {"facts": {"weather": "rain"}}, "'weather' is not observed"),
    "a logged unknown class": ("log", {"labels": {"motion": "one"}}, "unknown class 'one'"),
}


@pytest.mark.parametrize(("type", "fields", "message"), WRONG.values(), ids=WRONG)
def test_wrong_names_are_refused_and_change_nothing(intention, type, fields, message):
    kept, logged = [], []
    asker = Asker(intention, keep=kept.append, log=logged.append)
    asker.send("start")
    reply = asker.send(type, **{**REQUESTS[type], **fields})
    assert (reply["type"], reply["code"]) == ("error", "invalid")
    assert message in reply["message"]
    assert kept == logged == []
    assert asker.send("infer", facts=FACTS, labels={})["type"] == "posterior"


def test_impossible_evidence_is_refused(asker, monkeypatch):
    def infer(knowledge, evidence):
        raise UndefinedError("no possible world satisfies this evidence")

    monkeypatch.setattr(Knowledge, "infer", infer)
    reply = asker.send("infer", facts=FACTS, labels={})
    assert (reply["code"], reply["message"]) == (
        "invalid",
        "infer: no possible world satisfies this evidence",
    )


def test_a_classifier_that_the_page_cannot_run_runs_in_the_server(node):
    domain, trained = load_domain("intention"), TrainingOptions("summaries", tracks=60)
    robot = set_up_robot(domain, {"motion": trained}, domain.planning.solver, cache=find_cache_folder())
    assert make_model(robot, learns=False)["classifiers"] == {}
    streams = StreamingClassifier.from_trained(robot.classifiers["motion"])
    with serve(PageServer(lambda: Service(lambda: robot))) as port:
        node(server=f"ws://127.0.0.1:{port}/session")
        node(call=["start"])
        for i in range(30):
            sample = [i / 10, 1.0, 9 - i / 10]
            prediction = streams.push(sample[0], 0, *sample[1:])
            found = node(call=["addSamples", "motion", [sample]])
        assert found["probabilities"] == pytest.approx(list(prediction.probabilities))
        label = domain.find_sense("motion").label_of[streams.classifier(0).classify(np.zeros(1))]
        assert found["label"] == label
        assert node(call=["decide"])["evidence"] == {"classifier": label}
        node(close=None)


def test_the_floor_of_a_policy_for_all_states_may_be_infinite(intention):
    """As with discount 1."""
    policy = replace(intention.parts.policy, floor=-np.inf)
    robot = PlayRobot(replace(intention.parts, policy=policy), intention.classifiers)
    json.dumps(make_model(robot, learns=True), allow_nan=False)

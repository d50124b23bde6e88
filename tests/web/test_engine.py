"""The engine of the page: what it refuses, what learns, and what a connection that ends leaves."""

import pytest

from lcorpp.assembly.options import TrainingOptions
from lcorpp.assembly.training_data import make_training_data
from lcorpp.learning import StreamingClassifier
from lcorpp.web import server as server_module
from lcorpp.web.learning import BatchLearner, find_learning_sense
from lcorpp.web.model import make_exported_model, write_model
from lcorpp.web.server import PageServer
from lcorpp.web.service import Service
from tests.web.conftest import serve
from tests.web.test_learning import Inline


@pytest.fixture
def engine(intention, node, tmp_path):
    """A function that calls a method of an engine without a server, in a trial that has begun."""
    (tmp_path / "model.json").write_text(write_model(make_exported_model(intention)))
    node(model=str(tmp_path / "model.json"))
    node(call=["start"])
    return lambda *call: node(call=call)


def answer_all(engine, said):
    """Give the same answer until the robot reports; return the last reply."""
    reply = engine("decide")
    while not reply["done"]:
        reply = engine("answer", said, 0.1)
    return reply


REFUSED = {
    "an unknown fact": (["observe", {"weather": "rain"}, {}], "unknown fact 'weather'; expected one of time"),
    "a name of all objects": (["observe", {"constructor": "a"}, {}], "unknown fact 'constructor'"),
    "an unknown value": (["observe", {"time": "noon"}, {}], "time cannot be 'noon'; expected one of morning"),
    "a label of a track": (["observe", {}, {"motion": "one"}], "unknown label 'motion'; expected none"),
    "too many samples": (["addSamples", "motion", [[0, 1, 2]] * 10_001], "expected at most 10000 samples"),
    "an early answer": (["answer", "pos", 0.1], "the robot has not asked"),
    "an early record": (["record"], "there is no decision"),
    "an early line": (["log"], "the decision has not ended"),
    "an early judgement": (["judge", None], "the robot has not reported"),
}
REFUSED_LATER = {
    "facts": (["observe", {}, {}], "the robot is already deciding"),
    "samples": (["addSamples", "motion", [[0, 1, 2]]], "the robot is already deciding"),
    "a second decision": (["decide"], "the robot is already deciding"),
    "an unknown answer": (["answer", "maybe", 0.1], "unknown answer 'maybe'; expected one of pos, neg"),
    "an answer of all objects": (["answer", "constructor", 0.1], "unknown answer 'constructor'"),
}


@pytest.mark.parametrize(("call", "message"), REFUSED.values(), ids=REFUSED)
def test_calls_before_the_decision(engine, call, message):
    assert message in engine(*call)["refused"]
    assert engine("decide")["evidence"] == {}


@pytest.mark.parametrize(("call", "message"), REFUSED_LATER.values(), ids=REFUSED_LATER)
def test_calls_after_the_decision(engine, call, message):
    asked = engine("decide")["action"]
    assert message in engine(*call)["refused"]
    assert engine("answer", "pos", 0.1)["answered"] == asked


def test_a_trial_is_judged_once_with_another_value(engine):
    report = answer_all(engine, "pos")["report"]
    assert "what the robot reported" in engine("judge", report)["refused"]
    assert "unknown value 'curious'; expected one of" in engine("judge", ["curious"])["refused"]
    assert "the decision has ended" in engine("answer", "pos", 0.1)["refused"]
    assert engine("judge", None) == {"stored": 0, "batch": 0}
    assert "already judged" in engine("judge", None)["refused"]


def test_hearing_is_that_of_the_domain(engine):
    action = engine("decide")["action"]
    noise = engine("start")["noise"][action]["pos"]
    assert noise == pytest.approx([0.7, 0.3, 0])
    for draw, heard in ((0.69, "pos"), (0.71, "neg"), (1 - 1e-16, "neg")):
        engine("start")
        engine("decide")
        assert engine("answer", "pos", draw)["heard"] == heard


def test_after_a_training_the_next_trial_has_the_new_classifier(intention, node):
    sense = find_learning_sense(intention.domain, intention.classifiers)
    data = make_training_data(intention.domain, sense, TrainingOptions(tracks=60), 0).dataset
    learner = BatchLearner(intention, sense, data, batch_size=1, make_executor=Inline)
    page = PageServer(lambda: Service(lambda: learner.robot, learner.keep))
    walk = [[i / 10, 1.0, 9 - i / 10] for i in range(30)]

    def classify(robot):
        streams = StreamingClassifier.from_trained(robot.classifiers["motion"])
        prediction = streams.push_many((at, 0, *values) for at, *values in walk)[0]
        return pytest.approx(list(prediction.probabilities), rel=0, abs=1e-6)

    with serve(page) as port:
        learner.notify = page.notify
        node(server=f"ws://127.0.0.1:{port}/session")
        before = node(call=["start"])
        assert before["learns"]
        found = node(call=["addSamples", "motion", walk[:30]])
        assert found["probabilities"] == classify(intention)
        answer_all(lambda *call: node(call=call), "pos")
        assert node(call=["judge", None]) == {"stored": 1, "batch": 1}
        assert [message["type"] for message in node(pushed=None)] == ["learning", "learnt"]
        after = node(call=["start"])
        found = node(call=["addSamples", "motion", walk[:30]])
        assert found["probabilities"] == classify(learner.robot) != classify(intention)
        priors = [
            next(own["prior"] for own in domain["attributes"] if own["name"] == "classifier")
            for domain in (before, after)
        ]
        expected = [robot.knowledge.infer({}).marginals["classifier"] for robot in (intention, learner.robot)]
        assert priors == expected
        assert priors[0] != priors[1]
        node(close=None)


def test_a_page_too_many_is_refused_with_the_reason(intention, node, monkeypatch):
    monkeypatch.setattr(server_module, "MAX_PAGES", 0)
    with serve(PageServer(lambda: Service(lambda: intention))) as port:
        node(server=f"ws://127.0.0.1:{port}/session")
        assert node(call=["start"])["refused"] == "0 pages are open; expected fewer"


def test_a_connection_that_ends_refuses_what_waits_and_what_follows(intention, node):
    with serve(PageServer(lambda: Service(lambda: intention))) as port:
        node(server=f"ws://127.0.0.1:{port}/session")
        node(call=["start"])
    for _ in range(2):
        assert node(call=["start"])["refused"].startswith("The connection has ended. Start lcorpp play")

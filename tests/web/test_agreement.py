"""The engine in the page and the session of the server give the same replies to the same requests."""

import gzip
import json
import random

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly.options import TrainingOptions
from lcorpp.assembly.track_robot import find_track_senses
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.web.export import bundle_page
from lcorpp.web.model import make_model, write_model
from lcorpp.web.session import Session
from lcorpp.web.setup import find_page_folder, set_up_robot


def make_requests(domain, rng):
    """Make the requests of one trial, up to its answers."""
    tracked = {sense["name"] for sense in domain["senses"] if sense["kind"] == "track"}
    facts = {fact["name"]: rng.choice(fact["values"]) for fact in domain["facts"] if rng.random() < 0.8}
    labels = {
        sense["name"]: rng.choice(sense["labels"])["label"]
        for sense in domain["senses"]
        if sense["name"] not in tracked and rng.random() < 0.8
    }
    requests = [{"type": "start"}, {"type": "observe", "facts": facts, "labels": labels}]
    for name in tracked:
        if rng.random() < 0.8:
            requests += walk(name, rng)
    return [*requests, {"type": "decide"}]


def walk(sense, rng):
    """Make requests with the samples of a walk, some of them late, repeated, far away or after a gap."""
    time, x, y, requests = rng.uniform(0, 2e9), rng.uniform(-5, 5), rng.uniform(2, 12), []
    for _ in range(rng.randrange(1, 25)):
        samples = []
        for _ in range(rng.choice([1, 1, 3])):
            time += (
                rng.choice([0.05, 0.1, 0.1, 0.1, 0.3, 0.0, -0.1, 1.5, -3.0]) if rng.random() < 0.3 else 0.1
            )
            x, y = x + rng.gauss(0, 0.05), y + rng.gauss(-0.1, 0.05)
            samples.append([time, x + (30 if rng.random() < 0.01 else 0), y])
        requests.append({"type": "samples", "sense": sense, "samples": samples})
    return requests


def compare(expected, found, place=""):
    """Compare replies: beliefs to 1e-9, probabilities of classes to 1e-6, all but texts of errors exactly."""
    if isinstance(expected, dict):
        assert expected.keys() == found.keys(), place
        skipped = {"message", "fan", "values"} if "outcomes" in expected else {"message", "fan"}
        for name in expected.keys() - skipped:
            compare(expected[name], found[name], f"{place}.{name}")
    elif isinstance(expected, list):
        assert len(expected) == len(found), place
        for i, (one, other) in enumerate(zip(expected, found, strict=True)):
            compare(one, other, f"{place}[{i}]")
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, rel=0, abs=1e-6 if "probabilities" in place else 1e-9), place
    else:
        assert expected == found, place


def compare_values(expected, found, *, is_whole):
    """Compare the values of actions and of alpha vectors, which have nine digits in the page.

    A part of a policy bounds them from below, and has fewer alpha vectors.
    """
    one, other = ({row["action"]: row["value"] for row in reply["values"]} for reply in (expected, found))
    assert one.keys() == other.keys()
    for action, value in one.items():
        if is_whole:
            assert other[action] == pytest.approx(value, rel=1e-6, abs=1e-5), action
        assert other[action] <= value + 1e-5 * max(1, abs(value)), action
    if is_whole and expected["fan"] is not None:
        corners, others = (np.array([row["values"] for row in reply["fan"]]) for reply in (expected, found))
        mixtures = np.random.default_rng(0).dirichlet(np.ones(corners.shape[1]), 20)
        tops = [(mixtures @ own.T).max(axis=1) for own in (corners, others)]
        assert tops[1] == pytest.approx(tops[0], rel=1e-6, abs=1e-5)


def load_model(robot, node, folder):
    """Begin a session of the page's engine with the model of a robot; return the model."""
    model = make_model(robot)
    (folder / "model.json").write_text(write_model(model))
    node(model=str(folder / "model.json"))
    return model


def check_histories(robot, node, folder, count, seed=0):
    """Compare random trials of both engines; half of their answers are those of people, half arbitrary."""
    rng, session = random.Random(seed), Session(lambda: robot)
    model = load_model(robot, node, folder)
    is_whole = sum(len(part["actions"]) for part in model["planner"]["sets"]) == len(robot.parts.policy)

    def ask(request, number):
        expected = session.handle(json.dumps({"id": number, **request}))
        found = node(request={"id": number, **request})
        for reply in () if is_whole else (expected, found):
            for row in reply.get("outcomes", []):
                del row["action"]  # a part of a policy may predict another one after an improbable answer
        compare(expected, found, f"{number} {request['type']}")
        if "outcomes" in expected:
            compare_values(expected, found, is_whole=is_whole)
        return expected

    domain = ask({"type": "hello"}, 0)
    for number in range(count):
        for request in make_requests(domain, rng):
            reply = ask(request, number)
        if reply["type"] == "error":
            continue  # impossible evidence
        likely = rng.random() < 0.5
        while not reply["done"]:
            names = domain["answers"][reply["action"]]
            weights = [1.0] * len(names)
            if likely:
                chances = {row["observation"]: row["probability"] for row in reply["outcomes"]}
                weights = [chances.get(name, 0) for name in names]
            said = rng.choices(names, weights)[0]
            reply = ask({"type": "answer", "said": said, "draw": rng.random()}, number)
            if reply["type"] == "error":
                break  # an impossible observation
        ask({"type": "record"}, number)
        ask({"type": "judge", "right": True, "truth": None}, number)


def test_trials_of_the_paper(intention, node, tmp_path):
    check_histories(intention, node, tmp_path, 30)


def test_trials_with_chosen_labels(museum, node, tmp_path):
    check_histories(museum, node, tmp_path, 20)


BAD_REQUESTS = [
    {"type": "constructor"},
    {"type": 7},
    {"type": "start", "facts": {}},
    {"type": "observe", "facts": {}},
    {"type": "observe", "facts": [], "labels": {}},
    {"type": "observe", "facts": {"time": 3}, "labels": {}},
    {"type": "observe", "facts": {"time": "x" * 201}, "labels": {}},
    {"type": "observe", "facts": {"time": "constructor"}, "labels": {}},
    {"type": "observe", "facts": {"__proto__": "a"}, "labels": {}},
    {"type": "observe", "facts": {"intention": "interested"}, "labels": {}},
    {"type": "observe", "facts": {}, "labels": {"motion": "interested"}},
    {"type": "observe", "facts": {}, "labels": {"constructor": "name"}},
    {"type": "samples", "sense": "motion", "samples": []},
    {"type": "samples", "sense": "motion", "samples": [[0, 1, 2]] * 65},
    {"type": "samples", "sense": "motion", "samples": [[0, 1]]},
    {"type": "samples", "sense": "motion", "samples": [[0, 1, 2, 3]]},
    {"type": "samples", "sense": "motion", "samples": [[0, 1, None]]},
    {"type": "samples", "sense": "motion", "samples": [[0, 1, "2"]]},
    {"type": "samples", "sense": "motion", "samples": [[0, 1, True]]},
    {"type": "samples", "sense": "constructor", "samples": [[0, 1, 2]]},
    {"type": "answer", "said": "pos", "draw": 1},
    {"type": "answer", "said": "pos", "draw": -0.1},
    {"type": "answer", "said": "pos", "draw": "0"},
    {"type": "answer", "said": "constructor", "draw": 0.5},
    {"type": "answer", "said": "", "draw": 0.5},
    {"type": "answer", "said": "pos", "draw": 0.5},
    {"type": "judge", "right": 1, "truth": None},
    {"type": "judge", "right": True, "truth": ["interested"]},
    {"type": "judge", "right": False, "truth": None},
    {"type": "judge", "right": False, "truth": []},
    {"type": "judge", "right": False, "truth": ["constructor"]},
    {"type": "judge", "right": False, "truth": ["interested"]},
    {"type": "judge", "right": False, "truth": ["not_interested"]},
    {"type": "record"},
    {"type": "decide"},
]


def test_both_engines_refuse_the_same(intention, node, tmp_path):
    load_model(intention, node, tmp_path)
    session, rng, codes = Session(lambda: intention), random.Random(0), set()
    good = [{"type": "start"}, {"type": "observe", "facts": {"time": "morning"}, "labels": {}}]
    for number in range(1500):
        request = {"id": number, **rng.choice(BAD_REQUESTS + good)}
        if rng.random() < 0.03:
            request["id"] = rng.choice([-1, 0.5, "a", None])
        expected, found = session.handle(json.dumps(request)), node(request=request)
        assert (found["type"], found["id"]) == (expected["type"], expected["id"]), request
        if expected["type"] == "error":
            assert found["code"] == expected["code"], request
            codes.add(found["code"])
    assert codes == {"malformed", "unknown_type", "invalid", "out_of_order"}


DOMAINS = [
    ("intention", None),
    ("intention", "authors"),
    ("museum", None),
    ("shopping", "small"),
    ("shopping", "office"),
]
MAX_BYTES = 400_000
"""Of the page, compressed."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "preset"), DOMAINS)
def test_ten_thousand_trials_of_a_small_page(name, preset, node, tmp_path):
    domain = load_domain(name, preset=preset)
    training = {sense.name: TrainingOptions("lstm-fast") for sense in find_track_senses(domain)}
    robot = set_up_robot(domain, training, domain.planning.solver, cache=find_cache_folder())
    check_histories(robot, node, tmp_path, 10_000)
    page = bundle_page(find_page_folder(), make_model(robot))
    assert len(gzip.compress(page.encode())) <= MAX_BYTES

"""The engine of the page and the library decide, infer and classify the same in the same random histories."""

import gzip
import json
import random
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lcorpp import Instance, dt_control, load_domain
from lcorpp.assembly.options import TrainingOptions
from lcorpp.assembly.track_robot import find_track_senses
from lcorpp.decision import LCORPP
from lcorpp.decision.dt_control import infer_prior
from lcorpp.errors import ObservationError, UndefinedError
from lcorpp.learning import StreamingClassifier
from lcorpp.logs.decision_log import format_decision
from lcorpp.planning.belief import observation_probabilities, update
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.simulation.simulated_classifier import PrecomputedLabel
from lcorpp.values.probabilities import MIN_BRANCH
from lcorpp.web.export import bundle_page
from lcorpp.web.model import make_exported_model, write_model
from lcorpp.web.page_planner import PagePlanner
from lcorpp.web.server import PageServer
from lcorpp.web.service import Service
from lcorpp.web.setup import find_page_folder, set_up_robot
from lcorpp.worlds import ScriptedWorld
from tests.web.conftest import serve


class Library:
    """What the page has to show, by the library: inferences, and the one-step lookahead of the policy."""

    def __init__(self, robot):
        self.robot, self.domain, self.policy = robot, robot.domain, robot.parts.policy
        self._priors = {}

    def infer(self, facts, classes):
        """Return what follows from facts and classes, and the prior; or raise UndefinedError."""
        key = json.dumps([facts, classes], sort_keys=True)
        if key not in self._priors:
            self._priors[key] = infer_prior(self.robot.parts.robot, facts, classes)
        evidence, marginal, prior = self._priors[key]
        shown = {
            "evidence": dict(evidence),
            **self.robot.knowledge.infer(evidence).content,
            "shared": marginal.probabilities.tolist(),
            "belief": self.list_belief(prior),
        }
        return shown, prior

    def list_belief(self, belief):
        return {state: p for state, p in zip(self.domain.pomdp.states, belief.tolist(), strict=True) if p}

    def find_action(self, belief, found):
        """Return the policy's action; that of the page if it is as good, but for rounding."""
        return PagePlanner(self.robot.parts.robot.planner, [found]).action(belief)

    def view(self, belief, found):
        """Return what is to be shown of a belief; found: by the page, whose actions count if as good."""
        following = {row["observation"]: row["action"] for row in found["outcomes"]}
        domain, pomdp, policy = self.domain, self.domain.pomdp, self.policy
        shown = {"belief": self.list_belief(belief), "shared": list(domain.marginal(belief).probabilities)}
        if domain.is_terminal(belief):
            return shown | {"action": None, "done": True, "report": None, "values": [], "outcomes": []}
        chosen = self.find_action(belief, found["action"])
        report = domain.reported_value(chosen)
        values, outcomes = {}, []
        for a, action in enumerate(pomdp.actions):
            values[action] = float(belief @ pomdp.reward[a])
            for o, p in enumerate(observation_probabilities(pomdp, belief, a)):
                after = update(pomdp, belief, a, o) if p >= MIN_BRANCH else None
                if after is None or domain.is_terminal(after):
                    continue
                values[action] += pomdp.discount * p * policy.value(after)
                if action == chosen and report is None:
                    outcome = {"observation": pomdp.observations[o], "probability": float(p)}
                    outcome["action"] = self.find_action(after, following.get(pomdp.observations[o]))
                    outcomes.append({**outcome, "shared": list(domain.marginal(after).probabilities)})
        return shown | {
            "action": chosen,
            "done": report is not None,
            "report": None if report is None else list(domain.reasoning.split(report).values()),
            "values": [{"action": name, "value": value} for name, value in values.items()],
            "outcomes": outcomes,
        }

    def find_corners(self, belief):
        """Return (V, S) the belief given each shared value; the initial one for a value of probability 0."""
        planning = self.domain.planning
        joint = planning.state_values.T * belief
        totals = joint.sum(axis=1)[:, None]
        return np.where(totals > 0, joint / np.where(totals > 0, totals, 1), planning.initial_states)

    def decide(self, facts, classes, heard, actions):
        """Return the decision of Algorithm 2 with answers and actions of the page, as a line of the log."""
        parts = self.robot.parts
        classifiers = {name: PrecomputedLabel(own) for name, own in classes.items()}
        instance = Instance(dict.fromkeys(classes, np.zeros((1, 1))), facts)
        planner = PagePlanner(parts.robot.planner, actions)
        robot = replace(parts.robot, classifiers=classifiers, planner=planner)
        episode = dt_control(robot, instance, ScriptedWorld(heard))
        return json.loads(format_decision(parts, LCORPP, facts, replace(episode, seconds={})))


def draw_choices(domain, rng):
    """Draw facts, and labels of the senses without tracks."""
    facts = {fact["name"]: rng.choice(fact["values"]) for fact in domain["facts"] if rng.random() < 0.8}
    labels = {
        sense["name"]: rng.choice(sense["labels"])["label"]
        for sense in domain["senses"]
        if sense["kind"] == "choice" and rng.random() < 0.8
    }
    return facts, labels


def draw_walk(rng):
    """Yield samples of a walk, some of them late, repeated, far away or after a gap, a few at a time."""
    time, x, y = rng.uniform(0, 2e9), rng.uniform(-5, 5), rng.uniform(2, 12)
    for _ in range(rng.randrange(1, 25)):
        samples = []
        for _ in range(rng.choice([1, 1, 3])):
            time += (
                rng.choice([0.05, 0.1, 0.1, 0.1, 0.3, 0.0, -0.1, 1.5, -3.0]) if rng.random() < 0.3 else 0.1
            )
            x, y = x + rng.gauss(0, 0.05), y + rng.gauss(-0.1, 0.05)
            samples.append([time, x + (30 if rng.random() < 0.01 else 0), y])
        yield samples


def compare(expected, found, place=""):
    """Compare JSON: beliefs to 1e-9, probabilities of classes to 1e-6, all else exactly."""
    if isinstance(expected, dict):
        assert expected.keys() == found.keys(), place
        for name in expected:
            compare(expected[name], found[name], f"{place}.{name}")
    elif isinstance(expected, list):
        assert len(expected) == len(found), place
        for i, (one, other) in enumerate(zip(expected, found, strict=True)):
            compare(one, other, f"{place}[{i}]")
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, rel=0, abs=1e-6 if "probabilities" in place else 1e-9), place
    else:
        assert expected == found, place


def compare_view(library, belief, found, place, *, is_whole):
    """Compare what is shown of a belief; the values of actions and vectors have nine digits in the page.

    A part of a policy bounds them from below, has fewer alpha vectors, and may predict another next action
    after an improbable answer.
    """
    expected, fan = library.view(belief, found), found.pop("fan")
    one, other = ({row["action"]: row["value"] for row in reply.pop("values")} for reply in (expected, found))
    if not is_whole:
        for row in (*expected["outcomes"], *found["outcomes"]):
            del row["action"]
    compare(expected, found, place)
    assert list(other.values()) == sorted(other.values(), reverse=True), place
    assert one.keys() == other.keys(), place
    for action, value in one.items():
        if is_whole:
            assert other[action] == pytest.approx(value, rel=1e-6, abs=1e-5), (place, action)
        assert other[action] <= value + 1e-5 * max(1, abs(value)), (place, action)
    n_values = len(expected["shared"])
    assert (fan is not None) == (n_values in (2, 3) and expected["action"] is not None), place
    if is_whole and fan:
        points = draw_grid_points(n_values)  # where the page compares the vectors
        tops = (points @ np.array([row["values"] for row in fan]).T).max(axis=1)
        values = [library.policy.value(point @ library.find_corners(belief)) for point in points]
        assert tops == pytest.approx(values, rel=1e-6, abs=1e-5), place


@cache
def draw_grid_points(n_values):
    """Return some distributions without zeros of the grid of 4000 steps, or of 40 in a triangle."""
    rng, steps = np.random.default_rng(0), {2: 4000, 3: 40}[n_values]
    return rng.multinomial(steps - n_values, np.ones(n_values) / n_values, 5) / steps + 1 / steps


def check_walk(library, node, sense, rng, place):
    """Compare the predictions of a random walk; return its class."""
    trained = library.robot.classifiers[sense]
    streams, label_of = StreamingClassifier.from_trained(trained), library.domain.find_sense(sense).label_of
    named = None
    for samples in draw_walk(rng):
        prediction = streams.push_many((time, 0, *values) for time, *values in samples)[0]
        row = prediction.probabilities
        named = None if row is None else streams.classifier(0).classify(np.zeros(1))
        expected = {
            "points": prediction.points,
            "track": prediction.track,
            "probabilities": None if row is None else row.tolist(),
            "label": label_of.get(named),
        }
        compare(expected, node(call=["addSamples", sense, samples]), f"{place} samples")
    return named


def check_histories(robot, node, count, *, is_whole=True, seed=0):
    """Compare random trials of the engine, which has begun, with the library; return the lines of decisions.

    Half of the answers are those of people, half are arbitrary.
    """
    rng, library, lines = random.Random(seed), Library(robot), []
    pomdp, planner = robot.domain.pomdp, robot.parts.robot.planner
    for number in range(count):
        domain = node(call=["start"])
        facts, labels = draw_choices(domain, rng)
        classes = {}
        for sense in domain["senses"]:
            names = {own["label"]: own["class"] for own in sense["labels"]}
            if sense["name"] in labels:
                classes[sense["name"]] = names[labels[sense["name"]]]
        seen = node(call=["observe", facts, labels])
        try:
            expected, _ = library.infer(facts, classes)
        except UndefinedError:
            assert "no possible world" in seen["refused"]
            continue
        assert (seen.pop("fan") is not None) == (len(domain["values"]) in (2, 3))
        compare(expected, seen, f"{number} observe")
        for sense in domain["senses"]:
            if sense["kind"] == "track" and rng.random() < 0.8:
                named = check_walk(library, node, sense["name"], rng, number)
                if named is not None:
                    classes[sense["name"]] = named
        found = node(call=["decide"])
        try:
            expected, belief = library.infer(facts, classes)
        except UndefinedError:
            assert "no possible world" in found["refused"]
            continue
        inferred = expected.keys() - {"shared", "belief"}  # those are in the view
        compare({name: expected[name] for name in inferred}, {name: found.pop(name) for name in inferred})
        compare_view(library, belief, dict(found), number, is_whole=is_whole)
        likely, heard = rng.random() < 0.5, []
        while not found["done"]:
            action = found["action"]
            names = domain["answers"][action]
            weights = [1.0] * len(names)
            if likely:
                chances = {row["observation"]: row["probability"] for row in found["outcomes"]}
                weights = [chances.get(name, 0) for name in names]
            said, draw = rng.choices(names, weights)[0], rng.random()
            noise = np.cumsum(domain["noise"][action][said])
            heard.append(pomdp.observations[int(np.searchsorted(noise, draw, side="right"))])
            found = node(call=["answer", said, draw])
            try:
                belief = planner.update(belief, action, heard[-1])
            except ObservationError:
                assert "is impossible after action" in found["refused"]
                break
            step = {name: found.pop(name) for name in ("said", "heard", "answered")}
            assert step == {"said": said, "heard": heard[-1], "answered": action}
            compare_view(library, belief, dict(found), f"{number} after {heard}", is_whole=is_whole)
        else:
            record = node(call=["record"])
            line = library.decide(facts, classes, heard, [step["action"] for step in record["steps"]])
            compare(line, record, f"{number} record")
            assert node(call=["log"]) == {}
            lines.append(line)
            if found["report"] is not None:
                assert node(call=["judge", None]) == {"stored": 0, "batch": 0}
    return lines


def export(robot, node, folder):
    """Begin an engine of the exported page; return whether it has the whole policy."""
    model = make_exported_model(robot)
    (folder / "model.json").write_text(write_model(model))
    node(model=str(folder / "model.json"))
    return sum(len(part["actions"]) for part in model["planner"]["sets"]) == len(robot.parts.policy)


@pytest.mark.parametrize(
    ("name", "count"), [("intention", 15), pytest.param("museum", 6, marks=pytest.mark.slow)]
)
def test_trials_without_a_server(name, count, node, tmp_path, request):
    robot = request.getfixturevalue(name)
    assert export(robot, node, tmp_path)
    assert check_histories(robot, node, count)


@pytest.mark.parametrize(("name", "count"), [("intention", 6), ("museum", 3)])
def test_trials_with_a_server_and_their_log(name, count, node, request):
    robot, logged = request.getfixturevalue(name), []
    with serve(PageServer(lambda: Service(lambda: robot, log=logged.append))) as port:
        node(server=f"ws://127.0.0.1:{port}/session")
        lines = check_histories(robot, node, count)
        node(close=None)
    assert lines
    assert [json.loads(line) for line in logged] == lines


def test_marginals_are_those_of_the_reasoner(intention, node, tmp_path):
    export(intention, node, tmp_path)
    node(call=["start"])
    facts = {"time": "afternoon", "location": "classroom"}
    for name, marginal in node(call=["observe", facts, {}])["marginals"].items():
        expected = intention.parts.robot.reasoner.posterior(name, facts)
        assert marginal == pytest.approx(list(expected.probabilities))


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
    is_whole = export(robot, node, tmp_path)
    assert check_histories(robot, node, 10_000, is_whole=is_whole)
    page = bundle_page(find_page_folder(), make_exported_model(robot))
    assert len(gzip.compress(page.encode())) <= MAX_BYTES

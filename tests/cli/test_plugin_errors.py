"""Errors of own learners, strategies and worlds name the user's file and line, and what was expected."""

import re

import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("unrendered")

LEARNERS = """
import numpy as np
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

class Mine(ClassifierMixin, BaseEstimator):
    def __init__(self, result=None, classes=None):
        self.result, self.classes = result, classes
    def fit(self, X, y):
        if self.result == "fit":
            raise ValueError("no luck")
        self.classes_ = np.unique(y if self.classes is None else self.classes)
        return self
    def predict_proba(self, X):
        if self.result == "predict":
            return X["steam"]
        return [self.result] * len(X)

class Changed(Mine):
    def __init__(self, result=None):
        self.result = [result]

def fit(): return Mine("fit")
def predict(): return Mine("predict")
def classes(): return Mine(classes=("beer", "coffee", "tea"))
def nothing(): return Mine(None)
def text(): return Mine("often")
def narrow(): return Mine((0.5, 0.5))
def nan(): return Mine((0.5, np.nan, 0.5))
def negative(): return Mine((0.5, -0.5, 1.0))
def large(): return Mine((0.5, 0.5, 0.5))
def piped(): return make_pipeline(StandardScaler(), Mine("fit"))
def theirs(): return make_pipeline(StandardScaler(), LogisticRegression(C=-1))
def make_changed(): return Changed()
def no_learner(): return 3
def works(): return make_pipeline(StandardScaler(), Mine((0.2, 0.3, 0.5)))
"""
STRATEGIES = """
from dataclasses import replace
import numpy as np

class Part:
    def __init__(self, robot, result, start=None):
        self.robot, self.result = robot, result
        self.start = robot.planner.start if start is None else start
    def classify(self, signal):
        return self.result
    def posterior(self, attribute, evidence):
        return self.result
    def action(self, belief):
        return "dance" if self.result == "dance" else "ask"
    def update(self, belief, action, observation):
        if self.result == "wrong":
            return self.robot.planner.update(belief, "dance", observation)
        return self.result

def plan(robot, result):
    return replace(robot, planner=Part(robot, result))

def none(robot): return plan(robot, None)
def twice(robot): return plan(robot, (2, 1, 0, 0))
def nan(robot): return plan(robot, (np.nan, 1, 0, 0))
def short(robot): return plan(robot, (0.5, 0.5))
def dance(robot): return plan(robot, "dance")
def wrong(robot): return plan(robot, "wrong")
def start(robot):
    return replace(robot, reasoner=Part(robot, None), planner=Part(robot, None, (1, 1, 0, 0)))
def label(robot): return replace(robot, classifiers={"cup": Part(robot, "beer")})
def sense(robot): return replace(robot, classifiers={"mug": Part(robot, "tea")})
def reason(robot): return replace(robot, reasoner=Part(robot, {"tea": 1}))
def listed(robot):
    planner = robot.planner
    class Lists(Part):
        def action(self, belief):
            return planner.action(np.array(belief))
        def update(self, belief, action, observation):
            return planner.update(belief, action, observation).tolist()
    return replace(robot, planner=Lists(robot, None))
"""
WORLDS = """
class Silent:
    def __init__(self, person, rng):
        pass
    def act(self, action):
        return "nothing"
    def report(self, action):
        pass

class NoReport:
    def __init__(self, person, rng):
        self.act = print

class NoAct:
    def __init__(self, person, rng):
        self.report = print

def neither(person, rng):
    return 3
"""


@pytest.fixture
def refused(tmp_path, lcorpp, monkeypatch):
    """Run a command on the domain `drinks`, and check that it ends with one message of these words."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("own.py", LEARNERS), ("strategy.py", STRATEGIES), ("world.py", WORLDS)):
        (tmp_path / name).write_text(text)
    flags = ("--fact", "time=morning,evening", "--shared", "wish=tea,coffee,water", "--sense", "cup")
    assert lcorpp("new", "drinks", *flags).code == 0

    def check(words, *command):
        ended = lcorpp(*command)
        assert (ended.code, "Traceback" in ended.err, ended.err.count("lcorpp: ")) == (2, False, 1)
        assert re.search(words, ended.err), ended.err

    return check


def write_guests():
    rng = np.random.default_rng(0)
    with open("guests.csv", "w") as table:
        print("steam,foam,label,person", file=table)
        for person in range(60):
            label = ["tea", "coffee", "water"][person % 3]
            print(f"{rng.normal():.3f},{rng.normal():.3f},{label},guest {person}", file=table)


def learn(name):
    options = ("--learner", f"own.py:{name}", "--strategy", "L+R", "--trials", 5, "--jobs", 1)
    return ("run", "drinks", "--data", "guests.csv", *options)


@pytest.mark.parametrize(
    ("name", "line", "words"),
    [
        ("fit", 13, r"Mine failed in fit: ValueError: no luck; expected fit\(X, y\) to accept X of shape \("),
        ("predict", 18, r"Mine failed in predict_proba: IndexError: .*; expected probabilities of shape \("),
        ("classes", 11, r"learnt the classes \['beer', .*\]; expected \['coffee', 'tea', 'water'\]"),
        ("nothing", 16, r"gave shape \(\d+,\) in predict_proba; expected \(\d+, 3\)"),
        ("text", 16, r"failed in predict_proba: .*; expected probabilities of shape \(\d+, 3\) for X"),
        ("narrow", 16, r"gave shape \(\d+, 2\) in predict_proba; expected \(\d+, 3\)"),
        ("nan", 16, r"gave \[0.5, nan, 0.5\] in predict_proba for case 0 .*; expected a distribution"),
        ("negative", 16, r"gave \[0.5, -0.5, 1.0\] .*; expected a distribution: 3 numbers from 0 to 1 with"),
        ("large", 16, r"gave \[0.5, 0.5, 0.5\] .*; expected a distribution: 3 numbers .* with the sum 1"),
        ("piped", 13, r"Mine failed in fit: ValueError: no luck; expected"),
        ("theirs", 35, r"LogisticRegression failed in fit: InvalidParameterError: .*; expected fit\(X, y\)"),
        (
            "make_changed",
            36,
            r"Changed failed in clone: RuntimeError: .*; expected an __init__ that keeps its",
        ),
        ("no_learner", 37, r"3 is not an estimator; expected an object with fit, predict_proba"),
    ],
)
def test_an_own_learner(refused, name, line, words):
    write_guests()
    refused(rf"own\.py:{line}: the learner own\.py:{name}: .*{words}", *learn(name))


@pytest.mark.slow
def test_an_own_learner_in_another_process(refused):
    write_guests()
    refused(r"own\.py:13: the learner own\.py:fit: Mine failed in fit", *learn("fit")[:-1], 2)


def test_a_classifier_that_cannot_be_saved_is_reported_once(refused, lcorpp):
    write_guests()
    ended = lcorpp(*learn("works"), "--out", "out")
    assert ended.code == 0, ended.err
    assert ended.out.count("saved") == 1


BELIEF = r"expected a belief, a probability for each of the 4 states \(tea, coffee, water, done\)"


@pytest.mark.parametrize(
    ("name", "line", "words"),
    [
        ("none", 15, rf"update\(\) returned None; .*; {BELIEF}"),
        ("twice", 15, rf"update\(\) returned \(2, 1, 0, 0\); .* it sums to 3; {BELIEF}"),
        ("nan", 15, rf"update\(\) returned \(nan, 1, 0, 0\); .*; {BELIEF}"),
        ("short", 15, rf"update\(\) returned \(0.5, 0.5\); .* cannot have shape \(2,\); {BELIEF}"),
        ("dance", 13, r"action\(\) returned 'dance'; expected one of ask, report_tea, report_coffee"),
        ("wrong", 17, r"update\(\) failed: ModelError: .*'dance'.*expected one of ask"),
        ("start", 6, rf"start returned \(1, 1, 0, 0\); .*; {BELIEF}"),
        ("label", 9, r"classify\(\) of the sense 'cup' returned 'beer'; expected one of tea, coffee, water"),
        (
            "reason",
            11,
            r"posterior\(\) returned {'tea': 1}; coffee is missing; expected a probability of each",
        ),
        ("sense", 32, r"has a classifier of the sense 'mug'; expected one of cup"),
    ],
)
def test_an_own_strategy(refused, name, line, words):
    places = rf"strategy\.py:{line}: strategy '{name}':? {words}"
    chosen = ("--strategy", f"strategy.py:{name}")
    refused(places, "run", "drinks", *chosen, "--trials", 5, "--jobs", 1)
    refused(places, "run", "drinks", *chosen, "--exact")
    if name != "label":  # the label that is explained is drawn or given
        refused(places, "explain", "drinks", *chosen)


def test_a_belief_may_be_a_list(refused, lcorpp):
    chosen = ("--strategy", "strategy.py:listed", "--strategy", "LCORPP")
    ended = lcorpp("run", "drinks", *chosen, "--trials", 50, "--jobs", 1)
    assert ended.code == 0, ended.err
    differences = ended.out.partition("LCORPP minus")[2]
    assert re.search(r"listed +0\.00 +0\.00 *\n", differences)


def test_an_unknown_strategy_is_named_as_it_was_typed(refused):
    refused(r"unknown strategy 'Lcorpp2'; expected one of L, R", "run", "drinks", "--strategy", "Lcorpp2")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        (
            "Silent",
            r"world\.py:5: act\(\): observation 'nothing' is impossible after action 'ask' in belief {tea",
        ),
        (
            "Silent",
            r"} of the model .*interaction\.py:\d+; expected one of hear_tea, hear_coffee, hear_water",
        ),
        ("NoReport", r"world\.py:11: NoReport\(\) returned NoReport, which lacks report; expected"),
        ("NoAct", r"world\.py:15: NoAct\(\) returned NoAct, which lacks act; expected an object with"),
        ("neither", r"world\.py:18: neither\(\) returned int, which lacks act and report; expected"),
    ],
)
def test_an_own_world(refused, name, words):
    chosen = ("--world", f"world.py:{name}")
    refused(words, "run", "drinks", *chosen, "--trials", 5, "--jobs", 1)
    refused(words, "explain", "drinks", *chosen)

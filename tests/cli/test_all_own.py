"""A domain, data, a learner, a world and a strategy of one's own, all by flags, from what the guides say."""

import json

import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("unrendered")

PIPELINE = """
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

def pipeline():
    return make_pipeline(StandardScaler(), LogisticRegression())
"""
WORLD = """
class Guest:
    def __init__(self, person, rng):
        self.person, self.rng = person, rng

    def act(self, action):
        wish = self.person["wish"]
        return "hear_" + (wish if self.rng.random() < 0.7 else self.rng.choice(["tea", "coffee", "water"]))

    def report(self, action):
        pass
"""
STRATEGY = """
from dataclasses import replace

class AskOnce:
    def __init__(self, robot):
        self.domain, self.planner = robot.domain, robot.planner
        self.start, self.asked = robot.planner.start, False

    def action(self, belief):
        if self.asked:
            return self.domain.report_action(self.domain.marginal(belief).most_likely())
        self.asked = True
        return "ask"

    def update(self, belief, action, observation):
        return self.planner.update(belief, action, observation)

def ask_once(robot):
    return replace(robot, planner=AskOnce(robot))
"""


def test_three_classes_of_a_table_with_own_parts(tmp_path, lcorpp, monkeypatch):
    """Each class has its own feature, so the classifier is mostly right; planned questions add to it."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    with open("guests.csv", "w") as table:
        print("steam,foam,drops,label,person", file=table)
        for person in range(90):
            features = rng.normal(2 * np.eye(3)[person % 3], 1.0)
            label = ["tea", "coffee", "water"][person % 3]
            print(",".join(f"{x:.3f}" for x in features), label, f"guest {person}", sep=",", file=table)
    for name, text in (("own.py", PIPELINE), ("guest.py", WORLD), ("once.py", STRATEGY)):
        (tmp_path / name).write_text(text)
    flags = ("--fact", "time=morning,evening", "--shared", "wish=tea,coffee,water", "--sense", "cup")
    for command in (
        ("new", "drinks", *flags),
        ("check", "drinks"),
        ("data", "describe", "guests.csv"),
        ("explain", "drinks", "--strategy", "once.py:ask_once", "--world", "guest.py:Guest"),
    ):
        ended = lcorpp(*command)
        assert ended.code == 0, ended.err
    parts = ("--data", "guests.csv", "--learner", "own.py:pipeline", "--world", "guest.py:Guest")
    rows = ("--strategy", "once.py:ask_once", "--strategy", "L+R", "--strategy", "LCORPP")
    ended = lcorpp("run", "drinks", *parts, *rows, "--trials", 200, "--jobs", 1, "--out", "out")
    assert ended.code == 0, ended.err
    written = json.loads((tmp_path / "out" / "results.json").read_text())
    scores = {row["strategy"]: row for row in written["strategies"]}
    assert list(scores) == ["L+R", "LCORPP", "ask_once"]
    assert scores["ask_once"]["cost"] == 1
    assert scores["L+R"]["accuracy"] > 0.7
    assert scores["LCORPP"]["return"] > scores["L+R"]["return"]
    assert written["configuration"]["world"] == "guest.py:Guest"

"""`lcorpp run` and `explain` with an own strategy and an own world."""

import json
import re

import pytest

from tests.domains.deliveries import write_domain

pytestmark = pytest.mark.usefixtures("unrendered")

OWN = """
from dataclasses import replace

class Guess:
    def __init__(self, robot):
        self.domain, self.start, self.update = robot.domain, robot.planner.start, robot.planner.update
    def action(self, belief):
        return self.domain.report_action(self.domain.marginal(belief).most_likely())

def guess(robot):
    return replace(robot, planner=Guess(robot))

class Echo:
    def __init__(self, person, rng):
        self.person = person
    def act(self, action):
        return self.person[action.removeprefix("ask_")]
    def report(self, action):
        pass

class Mute(Echo):
    def act(self, action):
        return None
"""


@pytest.fixture
def own(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    return f"{tmp_path / 'own.py'}:"


def test_a_comparison_with_own_parts(tmp_path, own, lcorpp):
    """In a world without noise P is right; guessing the most likely value is R."""
    folder = write_domain(tmp_path / "deliveries")
    strategies = ("--strategy", f"{own}guess", "--strategy", "R", "--strategy", "always-report")
    ended = lcorpp("run", folder, "--exact", *strategies, "--out", tmp_path / "out", "--format", "svg")
    assert ended.code == 0, ended.err
    rows = json.loads((tmp_path / "out" / "results.json").read_text())["strategies"]
    assert [row["strategy"] for row in rows] == ["R", "always-report", "guess"]
    assert rows[0]["return"] == rows[1]["return"] == pytest.approx(rows[2]["return"], abs=1e-12)
    out = ("--trials", 60, "--jobs", 1, "--out", tmp_path / "out", "--format", "svg")
    ended = lcorpp("run", folder, "--world", f"{own}Echo", "--strategy", "P", *out)
    assert ended.code == 0, ended.err
    written = json.loads((tmp_path / "out" / "results.json").read_text())
    assert written["configuration"]["world"] == f"{own}Echo"
    assert written["strategies"][0]["accuracy"] > 0.9
    for options, words in (
        (("--exact", "--world", f"{own}Echo"), "--world: --exact needs the probabilities of the answers"),
        (("--exact", "--strategy", "random"), "strategy 'random' draws its actions"),
        (("--trials", 5, "--world", f"{own}Mute"), "act() answered None to 'ask_"),
        (("--world", "own.py"), "the world 'own.py': expected FILE.py:NAME"),
        (("--strategy", f"{own}nobody"), "has no function 'nobody'; expected one of"),
    ):
        refused = lcorpp("run", folder, *options)
        assert (refused.code, "Traceback" in refused.err) == (2, False)
        assert words in refused.err


def without_seconds(text):
    return re.sub(r"[\d.]+ s\n", "", text)


def test_a_decision_with_own_parts(own, lcorpp):
    ended = lcorpp("explain", "--strategy", f"{own}guess", "--seed", 1)
    assert ended.code == 0, ended.err
    assert "4  report_" in ended.out
    ended = lcorpp("explain", "--strategy", "random", "--seed", 1)
    assert ended.code == 0, ended.err
    again = lcorpp("explain", "--strategy", "random", "--seed", 1)
    assert without_seconds(ended.out) == without_seconds(again.out)
    assert "classifier" not in ended.out
    assert "identity\n" not in ended.out  # nothing is inferred without a reasoner
    for options, words in (
        (("--world", f"{own}Echo", "--answers", "pos"), "and --answers both answer the robot; expected one"),
        (("--world", f"{own}Echo", "--interactive"), "and --interactive both answer the robot"),
        (("--world", f"{own}Mute"), "own.py:22: act() answered None"),
        (("--strategy", "R", "--label", "one"), "the strategy R does not use the classifier motion"),
    ):
        refused = lcorpp("explain", *options)
        assert (refused.code, "Traceback" in refused.err) == (2, False)
        assert words in refused.err

"""`lcorpp run` and `explain` on a domain with three shared variables, without senses and with two."""

import json
import re

import numpy as np
import pytest

from lcorpp.decision.strategies import list_strategies
from lcorpp.domains import load_domain
from lcorpp.reasoning import Reasoner
from tests.domains.deliveries import GAZE, TRIPLES, VARIABLES, VOICE, write_domain

pytestmark = pytest.mark.usefixtures("unrendered")


@pytest.fixture
def folder(tmp_path):
    return write_domain(tmp_path / "deliveries")


def test_a_domain_without_senses_runs_and_names_no_classifier(folder, lcorpp):
    assert [row.name for row in list_strategies([])] == ["R", "P", "R+P"]
    ended = lcorpp("run", folder, "--trials", 100, "--jobs", 1)
    assert ended.code == 0, ended.err
    assert "classifier" not in ended.out + ended.err
    assert [line.split()[0] for line in ended.out.splitlines() if line.split()[:1] in (["R"], ["P"], ["R+P"])]
    for option in (("--classifier", "channel"), ("--data", "x.csv"), ("--learner", "lstm"), ("--tracks", 90)):
        refused = lcorpp("run", folder, *option)
        assert refused.code == 2
        assert f"{option[0]}: the domain has no [learning], so nothing is classified" in refused.err
    refused = lcorpp("run", folder, "--strategy", "LCORPP")
    assert refused.code == 2
    assert "in a domain without classifiers; expected one of R, P, R+P" in refused.err
    ended = lcorpp("explain", folder, "--truth", "tea,bob,hall", "--seed", 3)
    assert ended.code == 0, ended.err
    assert "item, person, room" in ended.out
    assert "classifier" not in ended.out
    refused = lcorpp("explain", folder, "--truth", "tea")
    assert (refused.code, "expected one of tea,ann,lab, tea,ann,hall," in refused.err) == (2, True)
    refused = lcorpp("explain", folder, "--label", "left")
    assert (refused.code, "the domain has no [learning]" in refused.err) == (2, True)


def test_two_senses_each_have_their_rates_and_their_row(tmp_path, lcorpp):
    folder = write_domain(tmp_path / "two", senses=GAZE + VOICE)
    ended = lcorpp("run", folder, "--exact")
    assert ended.code == 0, ended.err
    for words in (
        "LCORPP-gaze",
        "LCORPP-voice",
        "classifier of gaze: a noisy",
        "classifier of voice: a noisy",
    ):
        assert words in ended.out
    ended = lcorpp("explain", folder, "--label", "gaze=left", "--likelihood", "voice:low=0.2", "--seed", 1)
    assert ended.code == 0, ended.err
    assert "gaze's classifier's label" in ended.out
    assert "voice's classifier's likelihood" in ended.out
    for option, words in (
        (("--label", "left"), "expected the name of a sense first: gaze, voice"),
        (("--label", "nose=left"), "no sense 'nose'; expected one of gaze, voice"),
        (("--label", "gaze=low"), "expected one of left, right"),
        (("--label", "gaze=left", "--likelihood", "gaze:left=1"), "are both evidence of the classifier gaze"),
    ):
        refused = lcorpp("explain", folder, *option)
        assert refused.code == 2
        assert words in refused.err


def test_results_name_the_values_that_the_counts_are_about(folder, lcorpp, tmp_path):
    assert lcorpp("run", folder, "--exact", "--out", tmp_path, "--format", "svg").code == 0
    content = json.loads((tmp_path / "results.json").read_text())
    assert content["configuration"]["shared"] == list(VARIABLES)
    assert content["configuration"]["values"] == [list(triple) for triple in TRIPLES]
    assert np.shape(content["strategies"][0]["counts"]) == (8, 9)  # the last column: no report


def test_senses_without_a_label_are_left_out_where_another_has_one(lcorpp, tmp_path):
    facts = {"time": "morning", "crowd": "quiet", "group": "alone"}
    options = [option for name, value in facts.items() for option in ("--fact", f"{name}={value}")]
    ended = lcorpp("explain", "museum", "--label", "gaze=robot", *options, "--log", tmp_path / "log")
    assert ended.code == 0, ended.err
    assert "note: left out, as no label is given: motion" in ended.out
    assert "given time = morning, crowd = quiet, group = alone, gaze = at_robot\n" in ended.out
    posterior = Reasoner(load_domain("museum").program).posterior("wish", {**facts, "gaze": "at_robot"})
    for value, p in posterior:
        assert re.search(rf"{value} +{p:.6f} ", ended.out)
    assert "1 decisions, 0 differences" in lcorpp("replay", tmp_path / "log").out
    both = lcorpp("explain", "museum", "--label", "gaze=robot", "--label", "motion=tour", *options)
    assert "left out" not in both.out
    assert "motion = waits, gaze = at_robot\n" in both.out


def test_explain_leaves_out_attributes_that_may_have_no_value(lcorpp):
    ended = lcorpp("explain", "museum", "--seed", 3, "--no-cache")
    assert ended.code == 0, ended.err
    assert "attention" in ended.out
    assert "tours_are_over" not in ended.out

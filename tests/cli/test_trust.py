"""LCORPP+trust in `lcorpp run`, `learn`, `explain` and `replay`."""

import csv
import shutil
from pathlib import Path

import pytest

from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.trust.options import DEFAULT_OPTIONS

ROOMS = Path(__file__).parents[1] / "domains" / "rooms"


def test_explain_is_about_the_first_person_and_run_prints_the_weights(lcorpp, tmp_path):
    log = tmp_path / "log"
    likelihood = ("--likelihood", "interested=0.3")
    for rest in ((), likelihood):
        ended = lcorpp("explain", "--strategy", "lcorpp+trust", "--log", log, *rest)
        assert ended.code == 0, ended.err
        assert "weight of each source after 0 people" in ended.out
    assert lcorpp("replay", "-q", log).out == "2 decisions, 0 differences\n"
    trial = ("run", ROOMS, "--trials", 20, "--trial", 12, "--strategy", "LCORPP+trust")
    assert "weight of each source after 12 people" in lcorpp(*trial).out


def test_the_default_table_has_trust_where_it_can_follow(lcorpp, tmp_path):
    """Where the domain hides whether the robot has turned, it is left out with a note or refused by name."""
    folder = shutil.copytree(SHIPPED_FOLDER / "intention", tmp_path / "intention")
    model = folder / "interaction.pomdp"
    text = model.read_text()
    blind = "O: turn\n0.0 0.0 1.0\n0.0 0.0 1.0\n"
    assert blind in text
    model.write_text(text.replace(blind, "O: turn\n0.9 0.1 0.0\n0.1 0.9 0.0\n"))
    options = ("--classifier", "channel", "--trials", 10, "--jobs", 1)
    left_out = lcorpp("run", folder, *options)
    assert left_out.code == 0
    assert "note: LCORPP+trust is left out: " in left_out.err + left_out.out
    named = lcorpp("run", folder, *options, "--strategy", "LCORPP+trust")
    assert named.code == 2
    assert "the dialogue cannot be followed" in named.err
    learning = lcorpp("learn", folder, "--trust", "--learner", "summaries")
    assert (learning.code, learning.out) == (2, "")
    assert "the dialogue cannot be followed" in learning.err
    exact = lcorpp("run", "--classifier", "channel", "--exact", "--strategy", "LCORPP+trust")
    assert (exact.code, "learns from each person" in exact.err) == (2, True)


def test_trust_and_alarm_of_algorithm_1_are_in_the_results(lcorpp, tmp_path, few_faults):
    log, store, out = tmp_path / "log", tmp_path / "s.tracks", tmp_path / "out"
    few = ("--tracks", 60, "--learner", "summaries", "--batch-size", 120, "--max-batches", 1, "--jobs", 1)
    learn = ("learn", *few, "--store", store)
    ended = lcorpp(*learn, "--trust", "--watch", "--log", log, "--out", out)
    assert ended.code == 0, ended.err
    with (out / "batches.csv").open() as file:
        last = list(csv.DictReader(file))[-1]
    weights = {name: float(last[name]) for name in last if name.startswith("weight_")}
    assert set(weights) > {"weight_knowledge", "weight_learnt", "weight_no_evidence"}
    assert sum(weights.values()) == pytest.approx(1)
    best = max(weights, key=lambda name: weights[name])
    assert f"; trust: {best.removeprefix('weight_')} {weights[best]:.2f}, " in ended.out
    assert f"; noise {float(last['noise']):.2f}" in ended.out
    assert f"note: batch 1, {last['alarm']}\n" in ended.out + ended.err
    assert ": the answers " in last["alarm"]
    assert lcorpp("replay", "-q", log).out == "120 decisions, 0 differences\n"
    for options, words in (
        ((), "LCORPP+trust decided in the run of this store, and LCORPP does in this one; expected"),
        (("--watch",), "LCORPP+trust decided in the run of this store"),
        (("--strategy", "R+P"), "LCORPP+trust decided in the run of this store, and R+P does in this one"),
    ):
        refused = lcorpp(*learn, *options)
        assert (refused.code, "batch" in refused.out) == (2, False)
        assert f"{store}: " in refused.err
        assert words in refused.err


def test_an_alarm_needs_the_evidence_of_all_stored_decisions(lcorpp, tmp_path):
    few = ("--tracks", 60, "--learner", "summaries", "--batch-size", 3, "--max-batches", 1, "--jobs", 1)
    learn = ("learn", ROOMS, *few, "--store", tmp_path / "s.tracks")
    assert lcorpp(*learn).code == 0
    refused = lcorpp(*learn, "--watch")
    assert (refused.code, "batch" in refused.out) == (2, False)
    assert "it has decisions of a run without --watch, which lack their evidence" in refused.err


def test_the_budget_for_asking_is_an_option_and_in_logs(lcorpp, tmp_path):
    log = tmp_path / "log"
    run = ("run", ROOMS, "--trials", 30, "--jobs", 1, "--seed", 4, "--strategy", "LCORPP+trust")
    usual, free = (lcorpp(*run, *more) for more in ((), ("--ask-budget", 0)))
    assert (usual.code, free.code) == (0, 0), free.err
    assert usual.out != free.out
    logged = lcorpp(*run, "--ask-budget", 0, "--log", log)
    assert logged.code == 0, logged.err
    assert '"strategy": {"name": "LCORPP+trust", "ask_budget": 0.0' in log.read_text()
    assert lcorpp("replay", "-q", log).out == "30 decisions, 0 differences\n"
    refused = lcorpp("run", ROOMS, "--strategy", "LCORPP", "--ask-budget", 0.5)
    assert refused.code == 2
    assert "the strategy 'LCORPP' never asks to learn" in refused.err


def test_the_default_of_the_help_is_that_of_the_options():
    assert DEFAULT_OPTIONS.ask_budget == 1  # `AskBudgetOption` names it without loading trust

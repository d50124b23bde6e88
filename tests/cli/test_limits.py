"""`lcorpp solve --limit`, and limits of a domain in run, explain, sweep and replay."""

from __future__ import annotations

import csv
import json
import re

import pytest

from lcorpp.domains.loading import SHIPPED_FOLDER
from lcorpp.planning import read_pomdp, read_randomised_policy
from tests.cli.planner import refused

MODEL = SHIPPED_FOLDER / "intention" / "interaction.pomdp"
LIMIT = "move_forward,greet|not_interested<=.1"


def test_solve_within_limits(lcorpp, tmp_path):
    out = tmp_path / "a.json"
    picture = tmp_path / "a.png"
    ended = lcorpp(
        "solve", MODEL, "-o", out, "--limit", LIMIT, "--precision", 0.05, "--check", "--plot", picture
    )
    assert (ended.code, ended.err) == (0, "")
    assert re.search(r"interaction.pomdp: return 65\.\d+, at most 65\.\d+ within the limits", ended.out)
    assert "move_forward,greet|not_interested: 0.1, at most 0.1; one more unit is worth 3." in ended.out
    assert "verdict: confirmed" in ended.out
    policy = read_randomised_policy(out, read_pomdp(MODEL))
    assert f"wrote {len(policy.controller)} nodes to {out}" in ended.out
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_deterministic_policy_and_another_model(lcorpp, tmp_path):
    out = tmp_path / "a.json"
    more = ["--deterministic", "--limit-model", MODEL, "--precision", 0.5]
    ended = lcorpp("solve", MODEL, "-o", out, "--limit", LIMIT, *more)
    assert (ended.code, ended.err) == (0, "")
    assert "nothing is drawn" in ended.out
    assert read_randomised_policy(out, read_pomdp(MODEL)).is_deterministic


def test_a_broken_limit_has_the_exit_code_of_a_refuted_check(lcorpp, tmp_path, monkeypatch):
    """A solver that promises too much: its policy is written all the same."""
    from dataclasses import replace

    from lcorpp.planning import solve_limited

    def boastful(pomdp, limits, **options):
        return replace(solve_limited(pomdp, limits, **options), value=80.0, upper=81.0)

    monkeypatch.setattr("lcorpp.planning.solve_limited", boastful)
    out = tmp_path / "a.json"
    ended = lcorpp("solve", MODEL, "-o", out, "--limit", LIMIT, "--precision", 0.5, "--check")
    assert ended.code == 1
    assert "verdict: refuted" in ended.out
    assert out.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--limit", "dance<=.1"], ["no action 'dance'", "expected one of"]),
        (["--limit", "greet<="], ["not a number"]),
        (["--limit", "total(*)<=.5"], ["no policy keeps the limits", "total(*) <= 1"]),
        (["--limit", "greet<=1", "--solver", "qmdp"], ["--limit goes with sarsop"]),
        (["--limit", "greet<=1", "--horizon", "3"], ["--limit goes with sarsop"]),
        (["--deterministic"], ["go with --limit"]),
        (["--limit", "greet<=1", "--limit-model", "none.pomdp"], ["none.pomdp"]),
    ],
)
def test_what_is_refused(lcorpp, tmp_path, options, words):
    out = tmp_path / "a.json"
    refused(lcorpp("solve", MODEL, "-o", out, *options), *words)
    assert not out.exists()


def test_the_file_has_another_suffix(lcorpp, tmp_path):
    refused(lcorpp("solve", MODEL, "-o", tmp_path / "a.policy", "--limit", LIMIT), "ends in .json")


def test_run_prints_the_shares_and_replay_repeats(lcorpp, tmp_path):
    log = tmp_path / "log.jsonl"
    rows = ["--strategy", "LCORPP", "--strategy", "LCORPP+limits", "--classifier", "channel"]
    ended = lcorpp(
        "run", "intention", "--preset", "limit_5", *rows, "--trials", 150, "--log", log, "--jobs", 1
    )
    assert (ended.code, ended.err) == (0, "")
    assert re.search(r"at most\s+0\.05\s+planned\s+0\.0[45]\d\d\s+LCORPP\s+1\.0000 \[.*, 1\.000\]", ended.out)
    assert "LCORPP+limits: planned return 67." in ended.out
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert {line["strategy"]["name"] for line in lines} == {"LCORPP", "LCORPP+limits"}
    assert all(("seed" in line["strategy"]) == (line["strategy"]["name"] != "LCORPP") for line in lines)
    ended = lcorpp("replay", log)
    assert "300 decisions, 0 differences" in ended.out


def test_run_without_limits_and_exactly(lcorpp):
    refused(lcorpp("run", "intention", "--strategy", "LCORPP+limits", "--classifier", "channel"), "needs one")
    exact = ["--preset", "limit_5", "--exact", "--strategy", "LCORPP+limits"]
    ended = lcorpp("run", "intention", *exact)
    assert ended.code == 2
    assert "draws its actions, so it has no exact scores" in ended.err


def test_explain_draws_by_its_seed(lcorpp):
    options = [
        "--preset",
        "limit_5",
        "--strategy",
        "LCORPP+limits",
        "--label",
        "one",
        "--classifier",
        "channel",
    ]
    first, second = (lcorpp("explain", "intention", *options, "--seed", 4) for _ in range(2))
    assert first.code == 0
    assert first.out == second.out
    assert "the decision" in first.out


def test_a_sweep_of_a_bound_is_a_frontier(lcorpp, tmp_path):
    (tmp_path / "frontier.toml").write_text(
        'preset = "limit_5"\nstrategies = ["LCORPP", "LCORPP+limits"]\ntrials = 100\n'
        "[axes]\nlimit.bothered = [0.0, 0.3, 1.0]\n"
    )
    out = tmp_path / "out"
    ended = lcorpp("sweep", tmp_path / "frontier.toml", "--jobs", 1, "--out", out, "--format", "svg")
    assert (ended.code, ended.err) == (0, "")
    rows = list(csv.DictReader((out / "sweep.csv").read_text().splitlines()))
    limited = [row for row in rows if row["strategy"] == "LCORPP+limits"]
    returns = [float(row["planned_return"]) for row in limited]
    assert returns == sorted(returns)
    assert [float(row["planned_limit_bothered"]) for row in limited][:2] == pytest.approx([0, 0.3], abs=1e-6)
    assert all(row["planned_return"] == "" for row in rows if row["strategy"] == "LCORPP")
    assert "planned return, discounted" in (out / "sweep.svg").read_text() or (out / "sweep.svg").exists()
    (tmp_path / "frontier.toml").write_text('preset = "limit_5"\n[axes]\nlimit.bothered = [2.0]\n')
    refused(lcorpp("sweep", tmp_path / "frontier.toml", "--out", tmp_path / "other"), "above 1")

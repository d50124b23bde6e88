"""Every command on good input: what it prints and what it writes."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from lcorpp.planning import read_policy, read_pomdp
from lcorpp.reasoning.diagram import decision_diagram
from lcorpp.scoring.metrics import METRICS

COLUMNS = ("strategy", *(f"{name}{end}" for name in METRICS for end in ("", "_low", "_high")))
"""The columns of results.csv."""

ROOT = Path(__file__).parents[2]
INTENTION = ROOT / "src/lcorpp/domains/intention"
ROOMS = ROOT / "tests/domains/rooms"
AUTHORS = ROOT.parent / "shared/data/authors"


def test_ask_the_golden_query(lcorpp):
    """Shows 2."""
    evidence = "obs(time=afternoon), obs(location=classroom), obs(classifier=zero)"
    ended = lcorpp("ask", INTENTION / "knowledge.plog", f"identity | {evidence}")
    assert ended.code == 0
    for value, p in (("student", ".359531"), ("professor", ".359079"), ("visitor", ".281390")):
        assert f"{value:<9}  0{p}" in ended.out
    ended = lcorpp("ask", INTENTION / "knowledge.plog", f"intention=interested | {evidence}")
    assert "0.220250" in ended.out
    ended = lcorpp("ask", INTENTION / "knowledge.plog", "intention=interested", "--exact")
    assert ended.out.split()[-1] == "2/5"


def test_ask_the_programs_own_queries(lcorpp, tmp_path):
    file = tmp_path / "coin.plog"
    file.write_text(
        "s = {heads, tails}.\ncoin : s.\n[r] random(coin).\n[r] pr(coin=heads) = 1/4.\n?{coin=tails}.\n"
    )
    assert "0.750000" in lcorpp("ask", file).out


def test_solve_the_authors_model(lcorpp, tmp_path):
    """Shows 3."""
    out = tmp_path / "a.policy"
    ended = lcorpp("solve", INTENTION / "authors.pomdp", "-o", out)
    assert ended.code == 0
    words = ended.out.replace(",", " ").split()
    lower, upper = float(words[words.index("lower") + 1]), float(words[words.index("upper") + 1])
    assert 51.656 <= lower <= upper <= 51.658
    pomdp = read_pomdp(INTENTION / "authors.pomdp")
    assert read_policy(out, pomdp).value(np.full(5, 0.2)) == pytest.approx(lower, abs=1e-6)
    assert lcorpp("check", out, "--model", INTENTION / "authors.pomdp").code == 0


def test_explain_follows_the_paper(lcorpp):
    facts = ("--fact", "time=afternoon", "--fact", "location=classroom", "--label", "zero", "--seed", 1)
    ended = lcorpp("explain", *facts)
    assert ended.code == 0
    for words in ("0.359531", "0.220250", "1  learning", "2  reasoning", "3  planning", "intention = "):
        assert words in ended.out


def test_explain_asks_you(lcorpp, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("afternoon\nclass\nzero\npos\npos\npos\n"))
    ended = lcorpp("explain", "--preset", "authors", "--interactive")
    assert ended.code == 0
    *_, reported, gap = ended.out.splitlines()
    assert reported == "intention = interested"
    assert gap.startswith("gap at this prior at most ")


def test_run_writes_table_figure_and_configuration(lcorpp, tmp_path):
    ended = lcorpp(
        "run", "--classifier", "channel", "--trials", 20, "--seed", 4, "--jobs", 1, "--out", tmp_path
    )
    assert ended.code == 0
    with (tmp_path / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert [row["strategy"] for row in rows] == ["L", "R", "P", "L+R", "R+P", "L+P", "LCORPP", "LCORPP+trust"]
    for row in rows:
        for name in ("f1", "precision", "recall", "accuracy", "cost", "return"):
            assert float(row[f"{name}_low"]) <= float(row[name]) <= float(row[f"{name}_high"])
    content = json.loads((tmp_path / "results.json").read_text())
    assert content["configuration"]["seed"] == 4
    assert content["configuration"]["trials"] == 20
    assert content["configuration"]["senses"]["motion"]["rates"]["interested"]["interested"] == pytest.approx(
        0.76
    )
    assert content["versions"]["lcorpp"]
    assert content["strategies"][0]["f1"] == float(rows[0]["f1"])
    assert (tmp_path / "results.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("unrendered")
def test_files_have_the_accuracy_of_each_variable_and_paired_differences(lcorpp, tmp_path):
    ended = lcorpp("run", "shopping", "--preset", "small", "--trials", 20, "--jobs", 1, "--out", tmp_path)
    assert ended.code == 0
    with (tmp_path / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = [f"accuracy_{name}{end}" for name in ("item", "person", "room") for end in ("", "_low", "_high")]
    assert tuple(rows[0]) == (*COLUMNS, *names)
    found = json.loads((tmp_path / "results.json").read_text())["strategies"]
    assert [row["strategy"] for row in found] == ["R", "P", "R+P", "LCORPP+trust"]
    reference = found.pop(2)
    assert reference["difference"] is None
    for row in found:
        difference = row["difference"]
        assert difference["reference"] == "R+P"
        for name in ("cost", "return"):
            assert difference[name] == pytest.approx(reference[name] - row[name])
            assert difference[f"{name}_low"] <= difference[name] <= difference[f"{name}_high"]


def test_run_exactly(lcorpp):
    ended = lcorpp("run", "--preset", "authors", "--exact", "--strategy", "lcorpp", "--strategy", "P")
    assert ended.code == 0
    row = next(line.split() for line in ended.out.splitlines() if line.split()[:1] == ["LCORPP"])
    assert (row[1], row[5], row[6]) == ("0.891", "8.18", "58.45")
    assert "R+P" not in ended.out


def test_run_with_a_solved_policy(lcorpp, tmp_path):
    policy = tmp_path / "rooms.policy"
    assert lcorpp("solve", ROOMS / "guide.pomdp", "-o", policy).code == 0
    common = ("run", ROOMS, "--classifier", "channel", "--strategy", "P", "--trials", 100, "--jobs", 1)
    assert lcorpp(*common, "--policy", policy).code == 0


@pytest.mark.usefixtures("unrendered")
def test_run_trains_an_lstm_on_another_domain_and_loads_it_again(lcorpp, tmp_path):
    """Shows 5 and 6; the classifier it saved is used again, and gives the same decisions."""
    common = ("run", ROOMS, "--trials", 20, "--jobs", 1, "--strategy", "LCORPP")
    first = lcorpp(*common, "--epochs", 3, "--out", tmp_path)
    assert first.code == 0, first.err
    assert "true class lab (20 cases); predicted: lab" in first.out
    again = lcorpp(*common, "--classifier", tmp_path / "classifier.npz")
    assert again.code == 0, again.err
    table = [line for line in first.out.splitlines() if line.split()[:1] == ["LCORPP"]]
    assert table == [line for line in again.out.splitlines() if line.split()[:1] == ["LCORPP"]]


@pytest.mark.skipif(not AUTHORS.is_dir(), reason="the authors' trajectories are not there")
def test_run_on_the_authors_tracks(lcorpp):
    """Shows 8, with few epochs: the whole path, and the warning."""
    options = ("--epochs", 2, "--trials", 20, "--jobs", 1, "--strategy", "LCORPP")
    ended = lcorpp("run", "--data", AUTHORS, *options)
    assert ended.code == 0, ended.err
    assert "leaks its label" in ended.out
    assert "LCORPP" in ended.out


def test_learn_grows_and_keeps_every_batch(lcorpp, tmp_path):
    options = "--tracks 30 --epochs 1 --batch-size 5 --max-batches 2 --epsilon 0 --jobs 1"
    ended = lcorpp("learn", ROOMS, *options.split(), "--out", tmp_path)
    assert ended.code == 0, ended.err
    with (tmp_path / "batches.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["tracks"]) for row in rows] == [30, 35, 40]
    assert (tmp_path / "batches.png").read_bytes().startswith(b"\x89PNG")
    text = " ".join(ended.out.split())
    assert "the confusion matrix has not converged: with 95 % confidence it changed by at most" in text
    assert float(rows[2]["change_low"]) == 0 < float(rows[2]["change"]) < float(rows[2]["change_high"])


@pytest.mark.parametrize(
    "path",
    [INTENTION, INTENTION / "domain.toml", INTENTION / "knowledge.plog", INTENTION / "authors.pomdp", ROOMS],
)
def test_check_prints_ok(lcorpp, path):
    ended = lcorpp("check", path)
    note = f"note: running Python code of {ROOMS}\n" if path == ROOMS else ""
    assert (ended.code, ended.err) == (0, note)
    assert ended.out.rstrip().endswith("OK")


def test_check_knows_shipped_domains(lcorpp):
    assert lcorpp("check", "intention").out.count("OK") == 10  # presets


def test_check_of_a_program_that_is_too_large(lcorpp, tmp_path, monkeypatch):
    monkeypatch.setattr(decision_diagram.build_decision_diagram, "__defaults__", (200_000,))
    program = tmp_path / "objects.plog"
    program.write_text(
        "n = {1..20}. at : n -> n. #domain n(A; B; X). random(at(A)). :- at(A) = X, at(B) = X, A < B."
    )
    ended = lcorpp("check", program)
    assert ended.code == 0
    line = " ".join(ended.out.split())
    assert "1 attributes, names and sorts are OK; the possible worlds are not checked:" in line
    assert "more than 0.1907 MiB of arcs in the decision diagram" in line

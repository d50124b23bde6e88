"""Bad input: one message that names the place, exit code 2, no traceback, nothing written."""

import io
import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
INTENTION = ROOT / "src/lcorpp/domains/intention"
ROOMS = ROOT / "tests/domains/rooms"


def refused(ended, *words: str) -> None:
    assert ended.code == 2
    assert "Traceback" not in ended.err + ended.out
    for word in words:
        assert word in ended.err


FILES = [
    ("a.plog", "s = {a, b}.\nx : s.\n[r] random(x.\n", "a.plog:3:"),
    ("a.plog", "s = {a, b}.\nx : t.\n", "a.plog:2:"),
    ("a.plog", "s = {a, b}.\nx : s.\n[r] random(x).\n[r] pr(x=c) = 1/2.\n", "a.plog:4:"),
    ("a.plog", "s = {a, b}.\nx : s.\n[r] random(x).\n[r] pr(x=a) = 3/2.\n", "a.plog:4:"),
    (
        "a.pomdp",
        "discount: 0.9\nvalues: reward\nstates: 2\nactions: 1\nobservations: 1\nT: 0\n0.5 0.6\n1 0\n",
        "a.pomdp:7:1",
    ),
    ("a.pomdp", "", "a.pomdp"),
    ("domain.toml", "name = 'a\n", "domain.toml:1:"),
    ("domain.toml", "name = 'a'\n", "reasoning is missing"),
    ("a.txt", "", "unknown kind of file"),
    ("a.policy", "", "give --model"),
]


@pytest.mark.parametrize(("name", "text", "words"), FILES, ids=[f"{f[0]}-{i}" for i, f in enumerate(FILES)])
def test_check_locates_what_is_wrong(lcorpp, tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    refused(lcorpp("check", tmp_path / name), words)


def test_missing_files(lcorpp, tmp_path):
    refused(lcorpp("ask", tmp_path / "no.plog"), "no.plog: cannot be read: No such file")
    refused(lcorpp("solve", tmp_path / "no.pomdp", "-o", tmp_path / "x"), "no.pomdp: cannot be read")
    refused(lcorpp("check", tmp_path / "nosuch"), "nosuch: No such file or directory")
    refused(lcorpp("run", tmp_path / "no"), "no folder with a domain.toml")
    refused(lcorpp("run", "--data", tmp_path), "interposx.csv")
    assert os.listdir(tmp_path) == []


def test_ask_what_cannot_be_answered(lcorpp):
    knowledge = INTENTION / "knowledge.plog"
    refused(lcorpp("ask", knowledge), "has no query of its own")
    refused(lcorpp("ask", knowledge, "mood"), "<query>:1:1", "mood")
    refused(lcorpp("ask", knowledge, "intention=bored"), "<query>:1:", "bored", "not_interested")
    refused(lcorpp("ask", knowledge, "intention | obs(time=noon)"), "noon")
    refused(lcorpp("ask", knowledge, "intention | obs(time=morning), obs(time=evening)"), "possible world")


def test_solve_leaves_nothing_behind(lcorpp, tmp_path):
    refused(
        lcorpp("solve", INTENTION / "authors.pomdp", "-o", tmp_path / "no" / "x.policy"), "cannot be written"
    )
    refused(lcorpp("solve", INTENTION / "knowledge.plog", "-o", tmp_path / "x.policy"), "knowledge.plog:")
    assert os.listdir(tmp_path) == []


def test_a_policy_of_another_model(lcorpp, tmp_path):
    out = tmp_path / "paper.policy"
    assert lcorpp("solve", INTENTION / "interaction.pomdp", "-o", out).code == 0
    refused(lcorpp("check", out, "--model", INTENTION / "authors.pomdp"), "paper.policy", "another model")
    refused(lcorpp("check", out, "--model", ROOMS / "guide.pomdp"), "paper.policy")
    refused(lcorpp("run", "--preset", "authors", "--policy", out, "--trials", 1), "another model")


def test_wrong_options_end_in_one_message(lcorpp, tmp_path):
    refused(lcorpp("run", "--preset", "wild"), "unknown preset 'wild'; expected one of paper, authors")
    refused(lcorpp("run", "--strategy", "X"), "unknown strategy 'X'")
    refused(lcorpp("run", "--classifier", tmp_path / "none.npz"), "none.npz")
    refused(lcorpp("run", "--trials", 0), "--trials")
    refused(lcorpp("run", "--seed", -1), "--seed")
    refused(lcorpp("run", "--exact", "--classifier", "lstm"), "--exact needs --classifier channel")
    refused(lcorpp("run", ROOMS, "--data", tmp_path), "interposx.csv: cannot be read")
    refused(lcorpp("explain", "--fact", "time"), "expected NAME=VALUE")
    refused(lcorpp("explain", "--fact", "mood=good"), "'mood' is not observed")
    refused(lcorpp("explain", "--fact", "time=noon"), "time cannot be 'noon'")
    refused(lcorpp("explain", "--label", "two"), "'two'", "one, zero")
    refused(
        lcorpp("solve", INTENTION / "authors.pomdp", "-o", tmp_path / "x", "--precision", -1), "precision"
    )
    (tmp_path / "file").write_text("")
    refused(lcorpp("run", "--out", tmp_path / "file"), "is a file; --out expects a folder")


def test_an_end_of_the_input_is_an_error(lcorpp, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("morning\n"))
    refused(lcorpp("explain", "--interactive"), "the input ended")


def test_recorded_tracks_that_are_malformed(lcorpp, tmp_path):
    row = "7," + ",".join(["100"] * 304)
    (tmp_path / "interposx.csv").write_text(f"{row},1\n{row},2\n")
    (tmp_path / "interposy.csv").write_text(f"{row},1\n{row},2\n")
    refused(lcorpp("check", tmp_path), "interposx.csv:2:")
    (tmp_path / "interposx.csv").write_text(f"{row},1\n{row[:-3]}nan,1\n")
    refused(lcorpp("check", tmp_path), "interposx.csv:2:")
    for name in ("interposx.csv", "interposy.csv"):
        (tmp_path / name).write_text(f"{row},1\n{row.replace('100', '101')},1\n")
    refused(lcorpp("check", tmp_path), "class")

"""`lcorpp sweep`."""

import csv
import json
import re

import pytest

from lcorpp.experiments.sweeps.definition import read_sweep
from lcorpp.experiments.sweeps.running import run_sweep
from lcorpp.work_units.store import UnitStore

SWEEP = """
strategies = ["P", "R+P", "LCORPP"]
[axes]
noise = [0.2, 0.3]
cost.greet = [1, 2]
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "small.toml").write_text(SWEEP)
    return tmp_path / "small.toml"


def test_the_files_of_a_sweep(lcorpp, file, tmp_path):
    ended = lcorpp("sweep", file, "--jobs", 1, "--out", tmp_path / "out", "--format", "svg")
    assert (ended.code, ended.err) == (0, "")
    assert "4 configurations of intention, preset paper, exact scores" in ended.out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names - {"sweep.parquet"} == {"sweep.csv", "sweep.json", "sweep.svg", "sweep.txt", "units.sqlite"}
    rows = list(csv.DictReader((tmp_path / "out" / "sweep.csv").read_text().splitlines()))
    assert len(rows) == 12
    at = {"noise": "0.3", "cost.greet": "2"}
    paper = {row["strategy"]: row for row in rows if at.items() <= row.items()}
    assert round(float(paper["LCORPP"]["return"]), 2) == 51.53
    assert round(float(paper["P"]["return_difference"]), 2) == 4.60
    assert paper["P"]["return_hypothesis"] == paper["P"]["cost_hypothesis"] == "holds"


@pytest.mark.usefixtures("unrendered")
def test_a_finished_sweep_is_not_computed_again(lcorpp, file, tmp_path):
    lcorpp("sweep", file, "--jobs", 1, "--out", tmp_path / "out")
    before = (tmp_path / "out" / "sweep.csv").read_text()
    ended = lcorpp("sweep", file, "--jobs", 1, "--out", tmp_path / "out")
    assert "4 of 4 configurations are of an earlier run" in ended.out
    assert (tmp_path / "out" / "sweep.csv").read_text() == before
    file.write_text(SWEEP.replace("[0.2, 0.3]", "[0.2, 0.25, 0.3]"))
    ended = lcorpp("sweep", file, "--jobs", 1, "--out", tmp_path / "out")
    assert "4 of 6 configurations are of an earlier run" in ended.out


@pytest.mark.usefixtures("unrendered")
def test_another_sweep_in_the_same_folder_is_refused(lcorpp, file, tmp_path):
    lcorpp("sweep", file, "--jobs", 1, "--out", tmp_path / "out")
    for change, words in (
        ("trials = 100", "trials was none, exact scores, now 100"),
        ('preset = "authors"', "of another run: preset was paper, now authors"),
        ("seed = 1", "seed was 0, now 1"),
    ):
        file.write_text(change + SWEEP)
        ended = lcorpp("sweep", file, "--jobs", 1, "--out", tmp_path / "out")
        assert (ended.code, ended.err.count("\n")) == (2, 1)
        assert words in ended.err
        assert "units.sqlite: its 4 results are of another run" in ended.err


@pytest.mark.slow
def test_simulated_scores_do_not_depend_on_the_processes(file, tmp_path):
    file.write_text("trials = 110" + SWEEP.replace("cost.greet = [1, 2]", ""))
    sweep = read_sweep(file)
    one, two = (run_sweep(sweep, tmp_path / str(jobs), jobs=jobs).rows for jobs in (1, 2))
    assert one == two
    assert {row["return_hypothesis"] for row in one} <= {"holds", "is not decided", "does not hold"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("missing.toml",), "missing.toml: cannot be read: No such file or directory"),
        (("small.toml", "--cluster", "tcp://127.0.0.1:9", "--jobs", 2), "--jobs: the workers of --cluster"),
        (("small.toml", "--out", "small.toml"), "small.toml: is a file; --out expects a folder"),
    ],
)
def test_bad_input_ends_with_one_message(lcorpp, file, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    ended = lcorpp("sweep", *arguments)
    assert (ended.code, ended.out) == (2, "")
    assert words in ended.err


IMPOSSIBLE = "known.classifier.interested = 1, known.classifier.not_interested = 0"


@pytest.mark.usefixtures("unrendered")
def test_an_impossible_configuration_is_named_and_the_others_are_scored(lcorpp, tmp_path):
    """A robot that is sure of its classifier sees a person who is impossible by its model."""
    (tmp_path / "s.toml").write_text(
        'strategies = ["R+P", "L+R"]\n'
        "[axes.known.classifier]\ninterested = [0.9, 1]\nnot_interested = [0, 0.6]\n"
    )
    for _ in range(2):
        ended = lcorpp("sweep", tmp_path / "s.toml", "--jobs", 1, "--out", tmp_path / "out")
        assert ended.code == 0
        assert ended.err.startswith(f"warning: without scores: {IMPOSSIBLE}: ")
        assert ended.err.count("\n") == 1
        assert "3 configurations of intention" in ended.out
    assert "3 of 4 configurations are of an earlier run" in ended.out
    rows = list(csv.DictReader((tmp_path / "out" / "sweep.csv").read_text().splitlines()))
    assert [row["known.classifier.interested"] for row in rows] == ["0.9"] * 4 + ["1"] * 2
    (failed,) = json.loads((tmp_path / "out" / "sweep.json").read_text())["failed"]
    assert failed.startswith(IMPOSSIBLE)


def test_a_sweep_without_any_possible_configuration_ends(lcorpp, tmp_path):
    (tmp_path / "s.toml").write_text(
        'strategies = ["L+R"]\n[axes.known.classifier]\ninterested = [1]\nnot_interested = [0]'
    )
    ended = lcorpp("sweep", tmp_path / "s.toml", "--jobs", 1, "--out", tmp_path / "out")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert ended.err.startswith(f"lcorpp: {IMPOSSIBLE}: ")


def test_an_interrupted_sweep_continues(lcorpp, file, tmp_path, monkeypatch):
    """Ctrl-C after the second of four configurations."""
    add, added = UnitStore.add, []

    def add_and_interrupt(store, *unit):
        add(store, *unit)
        added.append(unit)
        if len(added) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(UnitStore, "add", add_and_interrupt)
        ended = lcorpp("sweep", file, "--out", tmp_path / "out", "--jobs", 1)
    assert ended.code == 130
    kept = r"interrupted while evaluating configurations; finished .* kept in .*out; the same"
    assert re.search(kept, ended.err)
    result = run_sweep(read_sweep(file), tmp_path / "out")
    assert result.resumed == 2
    assert '<th scope="col">strategy</th><th scope="col">f1</th>' in result._repr_html_()
    assert result.rows == run_sweep(read_sweep(file), tmp_path / "again").rows

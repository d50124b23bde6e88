"""`lcorpp figures` from the command line."""

import subprocess
import sys
from importlib import import_module
from inspect import signature

import pytest

from lcorpp.experiments.figures import running
from lcorpp.experiments.figures.registry import FIGURES, PaperFigure
from tests.experiments.figures.made_up import make_figure


@pytest.fixture
def small(monkeypatch):
    def make(options, progress):
        return make_figure(options, progress, name="strategies")

    monkeypatch.setattr(running, "FIGURES", {"strategies": PaperFigure(make, 10, 1)})


def test_figures_and_report_are_written_and_reused(small, lcorpp, tmp_path):
    first = lcorpp("figures", "strategies", "--fast", "--out", tmp_path / "out")
    assert first.code == 0, first.err
    assert first.out.splitlines()[-1] == f"wrote {tmp_path / 'out' / 'report.html'}"
    second = lcorpp("figures", "strategies", "--fast", "--out", tmp_path / "out")
    assert second.out.startswith("strategies: kept from an earlier run (1 of 1)")
    refused = lcorpp("figures", "strategies", "--out", tmp_path / "out")
    assert refused.code == 2
    assert "made with fast = True, not False; expected another folder (--out), or --again" in refused.err
    assert lcorpp("figures", "strategies", "--again", "--out", tmp_path / "out").code == 0


def test_an_unknown_name_is_refused_with_the_list(lcorpp):
    ended = lcorpp("figures", "strategys")
    assert ended.code == 2
    assert ended.err.startswith(f"lcorpp: unknown figure 'strategys'; expected one of {', '.join(FIGURES)}")


def test_names_are_known_without_the_code_of_the_figures():
    """An unknown name is refused at once: matplotlib and scikit-learn take seconds to import."""
    code = "import sys, lcorpp.experiments.figures.registry; print(*sys.modules)"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"matplotlib", "sklearn", "scipy"}.isdisjoint(ended.stdout.split())


@pytest.mark.parametrize("name", FIGURES)
def test_each_name_has_a_module_that_makes_its_figure(name):
    module = import_module(f"lcorpp.experiments.figures.{name}")
    assert list(signature(module.make_figure).parameters) == ["options", "progress"]


def test_too_few_trials_are_refused(lcorpp):
    ended = lcorpp("figures", "--trials", 20)
    assert ended.code == 2
    assert "the number of trials is 20; expected at least 100, as intervals of fewer people" in ended.err


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(lcorpp, tmp_path):
    (tmp_path / "file").write_text("")
    ended = lcorpp("figures", "--out", tmp_path / "file")
    assert (ended.code, ended.out) == (2, "")
    assert "is a file; --out expects a folder" in ended.err


def test_ctrl_c_keeps_the_finished_figures(lcorpp, tmp_path, monkeypatch):
    def interrupt(options, progress):
        raise KeyboardInterrupt

    monkeypatch.setattr(running, "FIGURES", {"strategies": PaperFigure(interrupt, 10, 1)})
    ended = lcorpp("figures", "strategies", "--out", tmp_path)
    assert ended.code == 130
    assert (
        "interrupted while making strategies; no figure is finished; the same command continues" in ended.err
    )


def test_without_pyarrow_one_line_says_so(small, lcorpp, tmp_path, monkeypatch):
    monkeypatch.setattr("lcorpp.experiments.tables.find_spec", lambda name: None)
    ended = lcorpp("figures", "strategies", "--out", tmp_path)
    assert "tables are written as CSV alone; Parquet needs the extra lcorpp[parquet]" in ended.out
    assert not (tmp_path / "strategies.parquet").exists()


def test_help_names_all_figures(lcorpp):
    text = " ".join(lcorpp("figures", "--help").out.split())
    assert f"{', '.join(FIGURES)}; all by default" in text

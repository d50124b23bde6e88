"""Runs of figures: finished figures are kept, reused and reported, also after an interrupt."""

import csv
import json
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser

import pytest

from lcorpp.assembly.progress import no_progress
from lcorpp.assembly.solving import solve_domain
from lcorpp.domains import load_domain
from lcorpp.errors import DataError, FileError
from lcorpp.experiments.figures import evaluation, running, storage
from lcorpp.experiments.figures.registry import PaperFigure
from lcorpp.experiments.figures.result import FigureOptions
from lcorpp.experiments.figures.running import FigureRun, RemainingTime
from lcorpp.planning.policy_cache import find_cache_folder
from tests.experiments.figures.made_up import make_figure

OPTIONS = FigureOptions(fast=True)


@pytest.fixture
def made(monkeypatch):
    """Two figures, `small` and `other`; the list of those that were computed."""
    calls = []

    def make(name, options, progress):
        calls.append(name)
        if "interrupt" in calls[:1] and name == "other":
            raise KeyboardInterrupt
        return make_figure(options, progress, name=name)

    table = {name: PaperFigure(partial(make, name), 10, 1) for name in ("small", "other")}
    monkeypatch.setattr(running, "FIGURES", table)
    return calls


def run(folder, *names, options=OPTIONS, **more):
    return list(FigureRun(folder, names or ("small", "other"), options, **more).make(no_progress))


def test_all_files_are_written_and_the_next_run_reuses_them(made, tmp_path):
    assert [figure.reused for figure in run(tmp_path / "out")] == [False, False]
    names = {path.name for path in (tmp_path / "out").iterdir()}
    ends = (".csv", ".parquet", ".svg", ".pdf", ".png", "-column.svg", ".json")
    assert names == {f"{name}{end}" for name in ("small", "other") for end in ends} | {"report.html"}
    before = (tmp_path / "out" / "report.html").read_bytes()
    assert [figure.reused for figure in run(tmp_path / "out")] == [True, True]
    assert made == ["small", "other"]
    assert (tmp_path / "out" / "report.html").read_bytes() == before


def test_tables_are_the_rows_of_the_result(made, tmp_path):
    from pyarrow import parquet

    run(tmp_path, "small")
    with (tmp_path / "small.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert row == {"strategy": "L", "trials": "", "f1": "0.5", "f1_low": "0.4", "f1_high": "0.6"}
    (row,) = parquet.read_table(tmp_path / "small.parquet").to_pylist()
    assert row == {"strategy": "L", "trials": None, "f1": 0.5, "f1_low": 0.4, "f1_high": 0.6}


def test_without_pyarrow_the_tables_are_csv_alone(made, tmp_path, monkeypatch):
    monkeypatch.setattr(storage, "has_parquet", lambda: False)
    run(tmp_path, "small")
    assert (tmp_path / "small.csv").exists()
    assert not (tmp_path / "small.parquet").exists()


def test_an_interrupt_keeps_the_finished_figures_and_names_them(made, tmp_path):
    made.append("interrupt")
    figures = FigureRun(tmp_path, ("small", "other"), OPTIONS).make(no_progress)
    assert next(figures).name == "small"
    with pytest.raises(
        KeyboardInterrupt, match=r"interrupted while making other; kept in .*: small; the same"
    ):
        next(figures)
    assert 'id="small"' in (tmp_path / "report.html").read_text()
    made.clear()
    assert [figure.reused for figure in run(tmp_path)] == [True, False]
    assert made == ["other"]


def test_other_options_and_other_versions_are_refused_by_name(made, tmp_path):
    run(tmp_path, "small")
    with pytest.raises(
        DataError, match=r"figure small cannot be reused: it was made with seed = 0, not 5; exp"
    ):
        run(tmp_path, "other", options=FigureOptions(fast=True, seed=5))
    assert not run(tmp_path, "small", options=FigureOptions(fast=True, seed=5), again=True)[0].reused
    content = json.loads((tmp_path / "small.json").read_text())
    (tmp_path / "small.json").write_text(json.dumps(content | {"code": "old", "lcorpp": "0.0.1"}))
    with pytest.raises(DataError, match=r"it was made by 0\.0\.1 instead of lcorpp "):
        run(tmp_path, options=FigureOptions(fast=True, seed=5))


def test_the_number_of_processes_is_no_other_option(made, tmp_path):
    run(tmp_path)
    assert all(figure.reused for figure in run(tmp_path, options=FigureOptions(fast=True, jobs=7)))


def test_a_damaged_description_is_named(made, tmp_path):
    run(tmp_path, "small")
    for text in ("", "{}", "[1]", '{"format": "lcorpp figure", "version": 99}'):
        (tmp_path / "small.json").write_text(text)
        with pytest.raises(DataError, match=r"small\.json: not the description of a figure"):
            run(tmp_path)
    assert not run(tmp_path, "small", again=True)[0].reused


def test_a_missing_picture_is_named(made, tmp_path):
    run(tmp_path, "small")
    (tmp_path / "small.svg").unlink()
    with pytest.raises(FileError, match=r"small\.svg: cannot be read: No such file"):
        run(tmp_path)
    assert not run(tmp_path, "small", again=True)[0].reused


def test_a_folder_that_is_a_file_is_refused(made, tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(FileError, match="cannot create the folder"):
        run(tmp_path / "out", "small")
    assert made == []


class Page(HTMLParser):
    """Checks that elements are closed in order, and collects what a browser would fetch or show."""

    VOID = ("meta", "br", "link", "img")

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.ids, self.links = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.ids += [value for name, value in attributes if name == "id"]
        self.links += [value for name, value in attributes if name in ("src", "href", "xlink:href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_report_is_well_formed_and_needs_nothing_from_elsewhere(made, tmp_path):
    run(tmp_path)
    text = (tmp_path / "report.html").read_text()
    page = Page()
    page.feed(text)
    page.close()
    assert page.open == []
    assert page.tags.count("svg") == 4  # two figures in two layouts
    assert {"img", "script", "link", "iframe"}.isdisjoint(page.tags)
    assert len(page.ids) == len(set(page.ids))
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    assert "@import" not in text
    assert "url(" not in text.replace("url(#", "")
    assert text.count('role="img" aria-label="A &lt;small&gt; figure &amp; its title"') == 4


def test_the_report_has_findings_numbers_deviations_and_options(made, tmp_path):
    run(tmp_path, "small")
    text = (tmp_path / "report.html").read_text()
    assert '<li class="fails">L &lt; R: <b>does not hold</b> (paired: 1.00 [0.50, 1.50]).</li>' in text
    assert "<td>0.500 [0.400, 0.600]</td>" in text
    assert '<tr class="far"><td>paper</td><td>L, F1</td><td>0.500</td><td>0.40</td><td>+0.100</td>' in text
    assert "<td>+10.0</td><td>(1)</td></tr>" in text
    assert "<ol><li>other data</li></ol>" in text
    assert "fast True, seed 0, trials 1000" in text


def test_an_interrupted_solver_ends_the_figure(monkeypatch):
    domain = load_domain("intention")
    stopped = replace(solve_domain(domain, cache=find_cache_folder()), reason="interrupted")
    monkeypatch.setattr(evaluation, "solve_domain", lambda *_, **__: stopped)
    with pytest.raises(KeyboardInterrupt):
        evaluation.make_planner(domain, no_progress)


def test_remaining_time_is_measured():
    now = 0.0
    remaining = RemainingTime({"a": 10, "b": 5, "c": 20}, lambda: now)
    with remaining.measure("a"):
        assert remaining.seconds is None  # nothing is measured yet
        with remaining.measure_step():
            now = 3.0
            assert remaining.step_seconds is None
            remaining.advance(1, 4)
            assert remaining.step_seconds == 9.0
        now = 20.0  # half as fast as the reference
    assert remaining.seconds == 50.0
    with remaining.measure("b"):
        now = 24.0
        assert remaining.seconds == 6 + 40
        with remaining.measure_step():
            now = 28.0
            remaining.advance(1, 5)  # slower than expected: 16 s are left of this step alone
            assert remaining.seconds == 16 + 40
    with remaining.measure("c"):
        pass
    assert remaining.seconds == 0

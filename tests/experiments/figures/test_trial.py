"""The illustrative trial: the beliefs of PAPER.md in both presets, step by step."""

import pytest

from lcorpp.assembly.progress import no_progress
from lcorpp.experiments.figures.result import FigureOptions
from lcorpp.experiments.figures.trial import Durations, TrialStep, make_figure, make_result

EVENTS = [
    ("reasoning", "no evidence"),
    ("reasoning", "time = afternoon"),
    ("reasoning", "location = classroom"),
    ("reasoning", "classifier = zero"),
    ("planning", "move_forward: pos"),
    ("planning", "move_forward: pos"),
    ("planning", "greet: pos"),
    ("planning", "report_interested"),
]


@pytest.fixture(scope="module")
def result():
    return make_figure(FigureOptions(), no_progress)


@pytest.mark.parametrize("preset", ["paper", "authors"])
def test_the_beliefs_are_those_of_bayes_rule(result, preset):
    """The last four by hand from .22025: feedback is right with .9, .9 and .8."""
    rows = [row for row in result.table if row["preset"] == preset]
    assert [(row["part"], row["event"]) for row in rows] == EVENTS
    beliefs = [0.4, (0.15 * 0.3 + 0.1 * 0.1 + 0.7 * 0.8) / 0.95, None, 0.220250]
    odds = 0.220250 / 0.779750
    for factor in (9, 9, 4, 1):
        odds *= factor
        beliefs.append(odds / (1 + odds))
    for row, belief in zip(rows, beliefs, strict=True):
        assert belief is None or row["belief"] == pytest.approx(belief, abs=2e-6)


def test_the_published_beliefs_are_met(result):
    assert [row.published for row in result.deviations] == 2 * ["0.22", "0.717", "0.958", "0.989"]
    assert all(abs(row.difference) < 0.001 for row in result.deviations)
    assert all(row.in_standard_errors is None for row in result.deviations)
    assert [finding.verdict for finding in result.findings[:4]] == ["holds"] * 4


def test_other_actions_and_a_wrong_report_are_found(result):
    steps = [TrialStep(**row) for row in result.table[:8]]
    steps[-1] = steps[-1]._replace(event="report_not_interested")
    same, right, *_ = make_result({"paper": steps}, Durations(1e-5, 0.1)).findings
    assert (same.verdict, right.verdict) == ("does not hold", "does not hold")
    assert same.evidence.endswith("greet, report_not_interested")


@pytest.mark.parametrize("layout", ["wide", "column"])
def test_each_panel_has_a_bar_for_each_step(result, layout):
    for panel in result.draw(layout).axes:
        assert len(panel.patches) == 2 * len(EVENTS)  # each on a pale one


def test_durations_are_compared_with_the_stated_ones(result):
    steps = [TrialStep(**row) for row in result.table[:8]]
    for durations, verdict in ((Durations(2e-5, 0.1), "holds"), (Durations(2e-3, 70), "does not hold")):
        *_, reasoning, planning = make_result({"paper": steps}, durations).findings
        assert (reasoning.verdict, planning.verdict) == (verdict, verdict)
    assert "200 answers on this machine 2.000 ms" in reasoning.evidence
    assert all("on this machine" in finding.evidence for finding in result.findings[-2:])

"""The figure of inaccurate knowledge: known exact scores, programs as stated, findings by the numbers."""

import pytest

from lcorpp.assembly.progress import no_progress
from lcorpp.domains import load_domain
from lcorpp.experiments.figures.knowledge import (
    LEVELS,
    SETTINGS,
    make_domain,
    make_figure,
    make_result,
)
from lcorpp.experiments.figures.result import FigureOptions
from tests.experiments.figures.made_up import make_evaluation
from tests.scoring.test_exact_evaluation import TABLE


@pytest.fixture(scope="module")
def result():
    return make_figure(FigureOptions(trials=200), no_progress)


def test_high_knowledge_has_the_scores_of_the_presets(result):
    rows = {(r["preset"], r["knowledge"], r["strategy"], r["scores"]): r for r in result.table}
    assert len(rows) == 2 * 3 * 5 * 2
    for preset in SETTINGS:
        for strategy in ("R", "P", "L+R", "R+P", "LCORPP"):
            exact = rows[preset, "High", strategy, "exact"]
            f1, accuracy, cost, _, return_ = TABLE[preset][strategy]
            assert (round(exact["f1"], 3), round(exact["accuracy"], 3)) == (f1, accuracy)
            assert (round(exact["cost"], 2), round(exact["return"], 2)) == (cost, return_)


def test_misleading_knowledge_leads_below_the_planner_without_knowledge(result):
    """PAPER.md: F1 LCORPP .773, R+P .721, P .813; R .117, L+R .407."""
    low = {
        row["strategy"]: round(row["f1"], 3)
        for row in result.table
        if (row["preset"], row["knowledge"], row["scores"]) == ("paper", "Low", "exact")
    }
    assert low == {"R": 0.117, "P": 0.813, "L+R": 0.407, "R+P": 0.721, "LCORPP": 0.773}


def test_p_does_not_depend_on_knowledge(result):
    for kind in ("exact", "simulated"):
        rows = [r for r in result.table if (r["preset"], r["strategy"], r["scores"]) == ("paper", "P", kind)]
        scores = [[row["f1"], row["cost"], row["return"]] for row in rows]
        assert scores == [pytest.approx(scores[0], rel=1e-12)] * 3  # sums of other orders


def test_the_programs_differ_from_the_truth_as_stated():
    high, medium, low = (set(str(make_domain("paper", level).program).splitlines()) for level in LEVELS)
    assert medium < high
    assert {line.split("=")[0] for line in high - medium} == {"pr(location"}
    assert sorted(line.split("|")[1] for line in high - low) == [
        " identity=professor) = 1/10.",
        " identity=visitor) = 4/5.",
    ]
    assert sorted(line.split("|")[1] for line in low - high) == [
        " identity=professor) = 4/5.",
        " identity=visitor) = 1/10.",
    ]


@pytest.mark.parametrize(("preset", "level"), [("medium", "Medium"), ("low", "Low")])
def test_the_presets_are_those_of_the_figure(preset, level):
    loaded, made = load_domain("intention", preset=preset), make_domain("paper", level)
    assert str(loaded.program) == str(made.program)
    assert str(loaded.simulation.true_program) == str(load_domain("intention").program)
    assert loaded.pomdp.fingerprint == made.pomdp.fingerprint


SCORES = {
    "P": (0.8, 0.8, 12, 40),
    "R": (0.3, 0.5, 0, 10),
    "L+R": (0.3, 0.6, 0, 20),
    "R+P": (0.82, 0.85, 10, 43),
    "LCORPP": (0.85, 0.9, 8, 46),
}


def judged(low, half=0.01):
    """Return claim -> verdict in a setting whose low knowledge has these scores."""
    evaluations = {}
    for setting in SETTINGS:
        for step, level in enumerate(LEVELS):
            scores = low if level == "Low" else SCORES | {"LCORPP": (0.85, 0.9, 6 + step, 46)}
            evaluations[setting, level] = make_evaluation(f"{setting}, {level}", scores, half)
    found = make_result(evaluations).findings
    assert len(found) == 22
    return {finding.claim.split(",")[0].split(":")[0]: str(finding.verdict) for finding in found[:11]}


INSENSITIVE = "Neither R+P nor LCORPP is sensitive to misleading knowledge"
KEPT = "LCORPP keeps its F1 score with misleading knowledge"
MORE = "R+P and LCORPP make up for misleading knowledge by more actions"


def test_all_findings_hold_with_scores_that_fit_them():
    """Both sentences on sensitivity exclude each other: one holds with each of these scores."""
    low = SCORES | {"R+P": (0.78, 0.83, 11, 43), "LCORPP": (0.84, 0.9, 12, 46)}
    verdicts = judged(low)
    assert verdicts.pop(KEPT) == "does not hold"
    assert set(verdicts.values()) == {"holds"}
    falls = low | {"R+P": (0.7, 0.8, 9, 43)}
    verdicts = judged(falls)
    assert [name for name, verdict in verdicts.items() if verdict != "holds"] == [INSENSITIVE, MORE]


def test_findings_follow_the_exact_numbers():
    harmful = SCORES | {"R": (0.5, 0.5, 0, 10), "L+R": (0.4, 0.5, 0, 20), "LCORPP": (0.7, 0.8, 9, 39)}
    verdicts = judged(harmful)
    assert verdicts.pop("R+P and LCORPP make up for misleading knowledge by more actions") == "does not hold"
    assert [name for name, verdict in verdicts.items() if verdict == "holds"] == [
        "LCORPP acts more",
        "Even incomplete knowledge is better than none",
    ]
    assert set(verdicts.values()) == {"holds", "does not hold"}


def test_large_deviations_have_a_reason(result):
    far = [row for row in result.deviations if abs(row.in_standard_errors) > 3]
    assert len(result.deviations) == 2 * 3 * 6
    assert all(row.reason for row in far)
    assert not any("30 %" in row.reason for row in far if row.setting.startswith("authors"))


@pytest.mark.parametrize("layout", ["wide", "column"])
def test_the_line_of_p_is_in_every_panel(result, layout):
    figure = result.draw(layout)
    assert len(figure.axes) == 6
    assert [any(line.get_linestyle() == "--" for line in axes.lines) for axes in figure.axes] == [True] * 6

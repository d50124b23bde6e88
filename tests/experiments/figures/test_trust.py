"""The figure of trust: knowledge as stated, streams as a run meets them, findings by the numbers."""

import numpy as np
import pytest

from lcorpp.assembly.progress import no_progress
from lcorpp.experiments.figures.evaluation import make_planner
from lcorpp.experiments.figures.trust import (
    BASELINES,
    BLOCK,
    KNOWLEDGE,
    SOURCES,
    Stream,
    invert,
    make_domain,
    make_result,
    run_stream,
)
from lcorpp.reasoning import Reasoner, parse_plog
from lcorpp.trust.sources.weights import FIXED_NOISE
from tests.experiments.figures.made_up import make_evaluation


def test_the_programs_are_the_truth_or_wrong_as_stated():
    domains = [make_domain(name) for name in KNOWLEDGE]
    right, swapped, inverted = (
        [Reasoner(domain.program).posterior("intention", {"identity": who})["interested"]
         for who in ("student", "professor", "visitor")]
        for domain in domains
    )  # fmt: skip
    assert right == pytest.approx([0.3, 0.1, 0.8])
    assert swapped == pytest.approx([0.3, 0.8, 0.1])
    assert inverted == pytest.approx([0.7, 0.9, 0.2])
    assert {str(domain.simulation.true_program) for domain in domains} == {str(domains[0].program)}


def test_numbers_are_inverted_in_one_attribute_alone():
    program = parse_plog(
        "b = {x, y}. u : b. v : b. random(u). random(v). pr(u=x) = 0.3. pr(v=x | u=x) = 1/4."
    )
    assert "pr(u=x) = 3/10." in str(invert(program, "v"))
    assert "pr(v=x|u=x) = 3/4." in str(invert(program, "v")).replace(" | ", "|")


def test_wrong_knowledge_loses_weight_in_a_stream(monkeypatch):
    monkeypatch.setattr("lcorpp.experiments.figures.trust.BLOCK", 20)
    planner = make_planner(make_domain("right"), no_progress)
    right, swapped = (run_stream(make_domain(name), planner, 2, 5) for name in ("right", "swapped"))
    for stream in (right, swapped):
        assert stream.returns.shape == (2,)
        assert stream.weights.sum(axis=1) == pytest.approx(np.ones(2))
        assert {*stream.sources} == {*SOURCES}
        noise = sum(FIXED_NOISE) / len(FIXED_NOISE) / 2  # this share begins without evidence
        assert stream.first_weights[0] == pytest.approx(0.4 * (1 - noise))
    k = right.sources.index("knowledge")
    assert right.weights[1, k] > 2 * swapped.weights[1, k]


def make_streams(returns, weight):
    """Return three streams of two blocks, in which the knowledge ends with a weight."""
    rest, equal = [(1 - weight) / 6] * 6, [1 / 7] * 7
    weights = np.array([equal, [weight, *rest]])
    return [
        Stream(np.array([value - 1.0, value + 1]), tuple(SOURCES), weights, np.array(equal))
        for value in (returns - 0.5, returns, returns + 0.5)
    ]


@pytest.fixture
def make():
    """Return a function from the returns of trust and the weights of the knowledge to the figure."""

    def make_from(**numbers):
        scores = {name: (0.8, 0.8, 10, 40 + k) for k, name in enumerate(BASELINES)}
        evaluations = {name: make_evaluation(name, scores) for name in KNOWLEDGE}
        return make_result(evaluations, {name: make_streams(*own) for name, own in numbers.items()})

    return make_from


def test_findings_follow_the_numbers(make):
    result = make(right=(60, 0.7), swapped=(43.2, 0.1), inverted=(30, 0.7))
    verdicts = [str(finding.verdict) for finding in result.findings]
    assert verdicts == ["holds", "is not decided", "does not hold", "holds", "does not hold"]
    assert result.findings[0].evidence.startswith("60.0 [58.8, 61.2]; minus LCORPP 17.00 [15.76, 18.24]")


def test_the_table_has_the_baselines_trust_and_each_block(make):
    result = make(right=(60, 0.7), swapped=(50, 0.1), inverted=(50, 0.1))
    assert len(result.table) == 3 * (2 * 4 + 1 + 2)
    assert len({tuple(row) for row in result.table}) == 1
    last = result.table[-1]
    assert (last["first"], last["last"]) == (BLOCK + 1, 2 * BLOCK)
    assert last["return"] == pytest.approx(51)
    assert sum(last[f"weight_{name}"] for name in SOURCES) == pytest.approx(1)


@pytest.mark.parametrize("layout", ["wide", "column"])
def test_the_figure_has_bars_curves_and_areas(make, layout):
    figure = make(right=(60, 0.7), swapped=(50, 0.1), inverted=(50, 0.1)).draw(layout)
    bars, curves, *areas = figure.axes
    assert len(bars.patches) == 3 * 5
    assert [text.get_text() for text in bars.get_xticklabels()] == list(KNOWLEDGE)
    assert sum(line.get_linestyle() == "--" for line in curves.lines) == 3
    assert [axes.get_title() for axes in areas] == ["right knowledge", "swapped knowledge"]
    assert [len(axes.collections) for axes in areas] == [len(SOURCES)] * 2

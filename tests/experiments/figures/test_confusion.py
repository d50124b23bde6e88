"""The figure of the confusion matrix: rates are counts, findings follow them."""

import pytest

from lcorpp.assembly.progress import no_progress
from lcorpp.experiments.figures.confusion import make_figure, make_result, subtract_rates
from lcorpp.experiments.figures.result import FigureOptions
from lcorpp.learning import estimate_rates
from lcorpp.values import ConfusionMatrix, Interval


def result_of(counts):
    rates = estimate_rates(ConfusionMatrix(("interested", "not_interested"), counts))
    return make_result(rates, {"learner": "made up"}, 70.0)


def test_the_table_has_counts_rates_and_the_published_rates():
    result = result_of([[76, 24], [58, 142]])
    assert [(row["tracks"], row["of"], row["rate"], row["published"]) for row in result.table] == [
        (76, 100, 0.76, 0.76),
        (24, 100, 0.24, 0.24),
        (58, 200, 0.29, 0.29),
        (142, 200, 0.71, 0.71),
    ]
    assert [row.difference for row in result.deviations] == [0, 0]
    assert [str(finding.verdict) for finding in result.findings] == ["holds"] * 2
    assert result.findings[1].evidence == "on this machine 70.0 s, made up, cross-validation included"
    assert "difference 0.470 [" in result.findings[0].evidence


def test_a_useless_classifier_is_found():
    assert result_of([[29, 71], [30, 70]]).findings[0].verdict == "is not decided"
    assert result_of([[10, 90], [90, 10]]).findings[0].verdict == "does not hold"


def test_large_deviations_have_a_reason():
    true, false = result_of([[760, 240], [10, 990]]).deviations
    assert (true.reason, false.reason) == (
        "",
        "our tracks are simulated, the recorded ones of the paper are not public",
    )
    assert false.in_standard_errors < -3


def test_the_interval_of_a_difference_is_newcombe_s():
    """Example of the source: 56/70 - 48/80 = .2, [.0524, .3339] with Wilson's intervals."""
    difference = subtract_rates(Interval.from_count(56, 70), Interval.from_count(48, 80))
    assert (difference.estimate, difference.low, difference.high) == pytest.approx(
        (0.2, 0.0524, 0.3339), abs=5e-5
    )


@pytest.mark.slow  # 600 tracks; tests/assembly trains classifiers of few
def test_the_classifier_is_trained_and_cross_validated():
    result = make_figure(FigureOptions(fast=True), no_progress)
    assert [row["of"] for row in result.table] == [300] * 4
    assert result.findings[0].verdict == "holds"
    assert result.configuration["learner"] == "lstm-fast"
    for layout, panels in (("wide", 2), ("column", 2)):
        assert len(result.draw(layout).axes) == panels

"""Scores with known answers, and intervals that keep their promise."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.stats import binomtest

from lcorpp.scoring.decision_scores import score_decisions, score_probabilities
from lcorpp.values import Interval

ZERO = Interval.exact(0.0)
VALUES = ("yes", "no")


def of(counts: list[list[float]], positive: str | None = "yes", **options):
    """Score as many decisions of each kind as the counts (V, V + 1)."""
    table = np.array(counts, int)
    truth, reported = np.repeat(np.indices(table.shape).reshape(2, -1), table.ravel(), axis=1)
    costs = np.zeros(len(truth))
    options = {"values": VALUES, "positive": positive} | options
    result = score_decisions("X", truth, reported, costs, costs, **options)
    assert result.counts.tolist() == table.tolist()
    return result


def test_known_confusion():
    result = of([[30, 10, 0], [20, 40, 0]])
    assert result.precision.estimate == 30 / 50
    assert result.recall.estimate == 30 / 40
    assert result.f1.estimate == pytest.approx(2 * 30 / (2 * 30 + 20 + 10))
    assert result.accuracy.estimate == 0.7


def test_f1_is_the_harmonic_mean():
    result = of([[33, 7, 0], [12, 48, 0]])
    p, r = result.precision.estimate, result.recall.estimate
    assert result.f1.estimate == pytest.approx(2 * p * r / (p + r))


def test_no_report_counts_as_wrong_and_spoils_recall_not_precision():
    result = of([[30, 0, 10], [0, 60, 0]])
    assert (result.precision.estimate, result.recall.estimate, result.accuracy.estimate) == (1.0, 0.75, 0.9)


def test_scores_without_positive_predictions():
    result = of([[0, 40, 0], [0, 60, 0]])
    assert (result.precision.estimate, result.recall.estimate, result.f1.estimate) == (0, 0, 0)
    assert (result.precision.low, result.precision.high) == (0, 1)


def test_average_over_all_values():
    result, mirrored = of([[30, 10, 0], [20, 40, 0]], None), of([[40, 20, 0], [10, 30, 0]], None)
    assert result.recall.estimate == pytest.approx((30 / 40 + 40 / 60) / 2)
    assert result.f1.estimate == pytest.approx(mirrored.f1.estimate)


@given(hits=st.integers(0, 60), misses=st.integers(0, 60))
def test_wilson_is_scipys(hits, misses):
    total = hits + misses
    if total == 0:
        assert Interval.from_count(0, 0).high == 1
        return
    expected = binomtest(hits, total).proportion_ci(method="wilson")
    found = Interval.from_count(hits, total)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-12)


@given(
    st.lists(st.lists(st.integers(0, 50), min_size=3, max_size=3), min_size=2, max_size=2).filter(
        lambda rows: np.sum(rows) > 0
    ),
    st.sampled_from(["yes", None]),
)
def test_every_interval_contains_its_estimate(counts, positive):
    result = of(counts, positive)
    for interval in (result.f1, result.precision, result.recall, result.accuracy):
        assert 0 <= interval.low <= interval.estimate <= interval.high <= 1


def test_intervals_cover_the_truth_in_95_of_100_samples():
    """1000 experiments of 200 decisions: the number of hits is binomial(1000, .95), so 920 is 4 SD below."""
    rng = np.random.default_rng(7)
    joint = np.array([[0.3, 0.1, 0], [0.15, 0.45, 0]])
    truth = score_probabilities("X", joint, ZERO, ZERO, 0, values=VALUES, positive="yes")
    held = {"f1": 0, "precision": 0, "accuracy": 0}
    for _ in range(1000):
        counts = rng.multinomial(200, joint.ravel()).reshape(2, 3)
        result = of(counts.tolist())
        for name in held:
            interval = getattr(result, name)
            held[name] += interval.low <= getattr(truth, name).estimate <= interval.high
    assert all(920 <= count <= 980 for count in held.values()), held


def test_mean_has_the_normal_interval():
    figures = np.array([1.0, 2.0, 3.0, 4.0])
    interval = Interval.from_sample(figures)
    half = 1.959964 * figures.std(ddof=1) / 2
    assert (interval.estimate, interval.low, interval.high) == pytest.approx((2.5, 2.5 - half, 2.5 + half))
    assert Interval.from_sample(np.array([3.0])).low == 3.0


def test_exact_scores_have_intervals_of_width_0():
    result = score_probabilities(
        "X",
        np.array([[0.3, 0.1, 0], [0.2, 0.4, 0]]),
        Interval.exact(9.0),
        Interval.exact(50.0),
        7.0,
        values=VALUES,
        positive="yes",
    )
    assert result.f1.low == result.f1.estimate == result.f1.high == pytest.approx(0.6 / 0.9)
    assert (result.cost.estimate, result.return_.estimate, result.cost_sd) == (9.0, 50.0, 7.0)


def test_accuracy_of_each_of_several_variables():
    values = (("tea", "lab"), ("tea", "hall"), ("book", "lab"), ("book", "hall"))
    counts = np.zeros((4, 5))
    counts[0] = [5, 2, 1, 1, 1]  # tea, lab: 5 right, 2 with the other room, 1 other item, 1 both, 1 no report
    counts[3, 3] = 10
    result = of(counts.tolist(), None, values=values, variables=("item", "room"))
    assert {name: row.estimate for name, row in result.variables.items()} == {"item": 0.85, "room": 0.8}
    assert result.variables["item"] == Interval.from_count(17, 20)
    assert result.accuracy.estimate == 0.75
    assert list(result.columns) == ["item", "room", "all", "cost", "return"]
    exact = score_probabilities(
        "X", counts / 20, ZERO, ZERO, 0, values=values, positive=None, variables=("item", "room")
    )
    assert exact.variables["room"] == Interval.exact(0.8)


def test_unknown_reports_bound_the_scores():
    """Of 1, .1 is unknown: half each of the positive and the other class."""
    joint, dropped = np.array([[0.3, 0.1, 0], [0.1, 0.4, 0]]), np.array([0.05, 0.05])
    result = score_probabilities(
        "X", joint, ZERO, ZERO, 0, values=VALUES, positive=VALUES[0], dropped=dropped
    )
    assert (result.accuracy.low, result.accuracy.high) == pytest.approx((0.7, 0.8))
    assert (result.recall.low, result.recall.high) == pytest.approx((0.3 / 0.45, 0.35 / 0.45))
    assert (result.precision.low, result.precision.high) == pytest.approx((0.3 / 0.5, 0.35 / 0.45))
    assert (result.f1.low, result.f1.high) == pytest.approx((2 * 0.5 / 1.5, 2 * 0.35 / 0.9))
    assert result.accuracy.confidence == result.f1.confidence == 1

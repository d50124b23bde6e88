"""The change of a confusion matrix and its interval."""

import numpy as np
import pytest
from scipy.stats import norm

from lcorpp.decision.stopping import compute_change, compute_ssub
from lcorpp.values import ConfusionMatrix

CLASSES = ("no", "yes", "maybe")


def matrix(counts) -> ConfusionMatrix:
    return ConfusionMatrix(CLASSES[: len(counts)], np.array(counts))


def test_ssub_sums_absolute_differences():
    assert compute_ssub(np.array([[0.5, 0.5], [0.2, 0.8]]), np.array([[0.75, 0.25], [0.2, 0.8]])) == 0.5


FIRST, SECOND = matrix([[30, 10], [15, 45]]), matrix([[50, 30], [20, 90]])


def test_with_confidence_0_the_interval_is_the_estimate_of_the_paper():
    change = compute_change(FIRST, SECOND, 0)
    assert change.estimate == compute_ssub(FIRST.probabilities, SECOND.probabilities)
    assert (change.low, change.high) == (change.estimate, change.estimate)
    tiny = compute_change(FIRST, SECOND, 1e-6)
    assert tiny.high - tiny.low < 0.01


def test_the_interval_widens_with_the_confidence_and_narrows_with_the_cases():
    changes = [compute_change(FIRST, SECOND, level) for level in (0.5, 0.8, 0.95, 0.999)]
    highs = [change.high for change in changes]
    assert highs == sorted(highs)
    assert all(change.low <= change.estimate <= change.high <= 4 for change in changes)
    assert {change.estimate for change in changes} == {changes[0].estimate}
    more = [matrix(16 * own.counts) for own in (FIRST, SECOND)]
    few, many = (change.high - change.estimate for change in (changes[2], compute_change(*more, 0.95)))
    assert many == pytest.approx(few / 4, rel=0.05)  # the error of a rate falls with the root of the cases


def test_many_cases_agree_with_the_normal_distribution():
    """2 (|x| + |y|) <= r of normal x and y: x + y and x - y, which are independent, within r / 2."""
    before, after = matrix([[4000, 1000], [1000, 4000]]), matrix([[6400, 1600], [1600, 6400]])
    variance = 0.8 * 0.2 * (1 / 5000 + 1 / 8000)
    radius = 2 * np.sqrt(2 * variance) * norm.ppf((1 + np.sqrt(0.95)) / 2)
    change = compute_change(before, after, 0.95)
    assert change.high - change.estimate == pytest.approx(radius, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    "rates", [[[0.75, 0.25], [0.3, 0.7]], [[0.8, 0.1, 0.1], [0.2, 0.7, 0.1], [0, 0.3, 0.7]]]
)
def test_the_interval_covers_the_true_change_at_least_as_often_as_it_states(rates):
    """Independent cases of known rates; 150 repetitions, of which .8 less three standard errors: 106."""
    rng = np.random.default_rng(0)
    n = len(rates)
    later = 0.8 * np.array(rates) + 0.2 / n
    true = compute_ssub(np.array(rates), later)
    hits = 0
    for _ in range(150):
        before = matrix([rng.multinomial(40, row) for row in rates])
        after = matrix([rng.multinomial(60, row) for row in later])
        change = compute_change(before, after, 0.8)
        hits += change.low <= true <= change.high
    assert hits >= 106


def test_estimated_classes_widen_the_interval_like_fewer_cases():
    """Half the effective cases are half the counts; of different ones the mean variance counts."""
    halves = [
        ConfusionMatrix(own.classes, own.counts, own.counts.sum(axis=1, keepdims=True) / 2 * np.ones((2, 2)))
        for own in (FIRST, SECOND)
    ]
    plain = compute_change(*(matrix(own.counts / 2) for own in (FIRST, SECOND)), 0.95)
    change = compute_change(*halves, 0.95)
    assert change.estimate == compute_change(FIRST, SECOND, 0.95).estimate
    assert change.high - change.estimate == pytest.approx(plain.high - plain.estimate, abs=1e-9)
    counts = np.array([[60.0, 20, 20], [20, 60, 20], [20, 20, 60]])
    cases = np.where(np.eye(3), 40.0, 80.0)
    spread = np.array([0.24, 0.16, 0.16])
    mean = spread.sum() / (spread / [40, 80, 80]).sum()
    uneven = compute_change(matrix(counts), ConfusionMatrix(CLASSES, counts, cases), 0.95)
    even = compute_change(matrix(counts), matrix(counts / 100 * mean), 0.95)
    assert uneven.high == pytest.approx(even.high - even.estimate, rel=0.02)
    unknown = ConfusionMatrix(FIRST.classes, FIRST.counts, np.zeros((2, 2)))
    assert compute_change(unknown, SECOND, 0.95).high > 2


def test_rates_before_the_first_training_are_uniform_and_unknown():
    change = compute_change(matrix(np.zeros((2, 2))), SECOND, 0.95)
    assert change.estimate == compute_ssub(np.full((2, 2), 0.5), SECOND.probabilities)
    assert change.high > 2

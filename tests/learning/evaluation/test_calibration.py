"""Calibration: what is known of Platt's method, and that likelihoods have the training shares divided out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.special import expit, logit, softmax

from lcorpp.errors import DataError
from lcorpp.learning import Calibration, Validation, cross_calibrate, fit_calibration
from lcorpp.learning.evaluation.metrics import expected_calibration_error
from lcorpp.values import ConfusionMatrix

CLASSES = ("no", "yes")


def simulate_scores(slope: float, offset: float, count: int = 6000, seed: int = 0):
    """Probabilities of which ``expit(slope logit(p) + offset)`` is right, and labels drawn so."""
    rng = np.random.default_rng(seed)
    p = expit(rng.normal(0, 1, count))
    labels = np.array(CLASSES)[(rng.random(count) < expit(slope * logit(p) + offset)).astype(int)]
    return np.stack([1 - p, p], axis=1), labels.tolist()


@pytest.mark.parametrize(("slope", "offset"), [(1.0, 0.0), (0.5, -1.0), (2.5, 0.7)])
def test_the_curve_is_found_again(slope, offset):
    probabilities, labels = simulate_scores(slope, offset)
    found = fit_calibration(CLASSES, probabilities, labels)
    right = expit(slope * logit(probabilities[:, 1]) + offset)
    calibrated = found.calibrate(probabilities)
    np.testing.assert_allclose(calibrated.sum(axis=1), 1)
    # the standard error of a share among 6000 cases, spread over four numbers, is about .01
    assert np.sqrt(np.mean((calibrated[:, 1] - right) ** 2)) < 0.015
    assert calibrated[:, 1].mean() == pytest.approx(np.mean(np.array(labels) == "yes"), abs=0.002)


def test_people_who_look_like_the_other_kind():
    """However sure the classifier is, a fifth and a tenth are of the other class."""
    rng = np.random.default_rng(1)
    p = expit(rng.normal(0, 3, 6000))
    right = 0.1 + 0.7 * expit(2 * logit(p))
    labels = np.array(CLASSES)[(rng.random(6000) < right).astype(int)].tolist()
    found = fit_calibration(CLASSES, np.stack([1 - p, p], axis=1), labels)
    np.testing.assert_allclose(found.lapses, [0.2, 0.1], atol=0.03)
    assert np.sqrt(np.mean((found.calibrate(np.stack([1 - p, p], axis=1))[:, 1] - right) ** 2)) < 0.015


def test_the_gradient_leads_to_the_least_loss():
    """No small change of any number of a fit makes the data more probable."""
    probabilities, labels = simulate_scores(1.7, 0.4, 800)
    found = fit_calibration(CLASSES, probabilities, labels)
    rows = (np.arange(800), (np.array(labels) == "yes").astype(int))
    counts = np.bincount(rows[1])
    targets = ((np.eye(2) * counts[:, None] + 1) / (counts[:, None] + 2))[rows[1]]

    def loss(c: Calibration) -> float:
        return float(-(targets * np.log(c.calibrate(probabilities))).sum() + np.log(c.slope) ** 2 / 2)

    first, last = np.eye(2)
    for change in (
        {"slope": found.slope * 1.05},
        {"slope": found.slope / 1.05},
        {"offsets": found.offsets + 0.05 * first},
        {"offsets": found.offsets - 0.05 * first},
        {"lapses": found.lapses + 0.01 * first},
        {"lapses": found.lapses + 0.01 * last},
    ):
        assert loss(replace(found, **change)) > loss(found) - 1e-3


def test_the_order_of_cases_stays_and_nonsense_becomes_the_shares():
    probabilities, labels = simulate_scores(0.7, 0.3, 500)
    right = fit_calibration(CLASSES, probabilities, labels).calibrate(probabilities)
    assert (np.diff(right[np.argsort(probabilities[:, 1]), 1]) >= 0).all()
    wrong = fit_calibration(CLASSES, probabilities[:, ::-1], labels)  # the order is the wrong way round
    np.testing.assert_allclose(wrong.calibrate(probabilities), [wrong.shares] * 500, atol=0.03)
    np.testing.assert_allclose([d.weights for d in wrong.likelihoods(probabilities)], 1, atol=0.1)


def test_likelihoods_do_not_know_how_common_a_class_was():
    """The same motion from data with one positive in two and in ten: the same likelihood ratio."""
    rng = np.random.default_rng(3)
    ratios = []
    for share in (0.5, 0.1):
        truth = rng.random(15_000) < share
        x = rng.normal(np.where(truth, 0.6, -0.6), 1)
        p = expit(1.2 * x)  # the log-likelihood ratio is 1.2 x; this is right where both are equally common
        found = fit_calibration(
            CLASSES, np.stack([1 - p, p], axis=1), np.array(CLASSES)[truth.astype(int)].tolist()
        )
        grid = expit(1.2 * np.linspace(-1.5, 1.5, 7))
        told = found.likelihoods(np.stack([1 - grid, grid], axis=1))
        ratios.append([dict(d)["yes"] / dict(d)["no"] for d in told])
    # three standard errors of a logarithm at the ends, with 1500 positives
    np.testing.assert_allclose(np.log(ratios[0]), np.log(ratios[1]), atol=0.3)
    np.testing.assert_allclose(np.log(ratios[0]), 1.2 * np.linspace(-1.5, 1.5, 7), atol=0.2)


def test_three_classes():
    rng = np.random.default_rng(0)
    logits = rng.normal(0, 1.5, (5000, 3))
    right = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    labels = [("a", "b", "c")[k] for k in (right.cumsum(axis=1) < rng.random((5000, 1))).sum(axis=1)]
    sure = np.exp(2 * logits + [0, 1, 0])
    sure /= sure.sum(axis=1, keepdims=True)
    found = fit_calibration(("a", "b", "c"), sure, labels)
    inside = (sure > 2e-3).all(axis=1)
    np.testing.assert_allclose(found.calibrate(sure)[inside], right[inside], atol=0.06)


def test_sixty_three_of_sixty_three_is_not_certain():
    probabilities = np.tile([[1.0, 0.0], [0.0, 1.0]], (63, 1))
    found = fit_calibration(CLASSES, probabilities, ["no", "yes"] * 63)
    assert found.calibrate(probabilities)[:, 1].max() < 0.99
    assert (
        max(dict(d)["yes"] / dict(d)["no"] for d in found.likelihoods(probabilities) if dict(d)["no"]) < 100
    )


@settings(max_examples=60)
@given(
    st.integers(0, 2**32 - 1), st.integers(2, 4), st.integers(1, 60), st.sampled_from([0.0, 1.0, 30.0, 1e4])
)
def test_any_scores_are_calibrated_to_distributions(seed, k, cases, spread):
    """Also one class only, certain ones, constant ones: no warning, no zero, no NaN."""
    rng = np.random.default_rng(seed)
    logits = spread * rng.normal(size=(cases, k))
    probabilities = softmax(logits, axis=1)
    classes = tuple("abcd"[:k])
    labels = [classes[i] for i in rng.integers(0, rng.integers(1, k + 1), cases)]
    found = fit_calibration(classes, probabilities, labels)
    calibrated = found.calibrate(probabilities)
    np.testing.assert_allclose(calibrated.sum(axis=1), 1)
    assert calibrated.min() > 0
    assert all(np.isfinite(d.weights).all() for d in found.likelihoods(probabilities))


def test_each_fold_is_calibrated_by_the_others():
    probabilities, labels = simulate_scores(3.0, 0.5, 900)
    folds = np.arange(900) % 3
    flipped = [
        ("yes" if name == "no" else "no") if fold == 0 else name
        for name, fold in zip(labels, folds, strict=True)
    ]
    matrix = ConfusionMatrix(CLASSES, np.eye(2))
    groups = tuple(map(str, range(900)))
    first, second = (
        cross_calibrate(
            Validation(matrix, tuple(names), probabilities, None, tuple(folds.tolist()), tuple(names), groups)
        )
        for names in (labels, flipped)
    )
    np.testing.assert_array_equal(first[folds == 0], second[folds == 0])  # their own labels play no part
    assert not np.allclose(first[folds != 0], second[folds != 0])
    one, positive = np.ones((1, 900)), np.array(labels) == "yes"
    assert (
        expected_calibration_error(first[:, 1], positive, one)
        < expected_calibration_error(probabilities[:, 1], positive, one) / 2
    )


def test_calibration_is_restored_from_json_and_invalid_numbers_are_errors():
    found = fit_calibration(CLASSES, *simulate_scores(1.3, 0.2, 300))
    again = Calibration.from_json(found.to_json())
    assert again.to_json() == found.to_json()
    for change, words in [
        ({"shares": [0.5, 0.6]}, "sum to 1.1"),
        ({"shares": [0.0, 1.0]}, "positive shares"),
        ({"slope": 0}, "slope above 0"),
        ({"offsets": [1]}, "as many offsets"),
        ({"lapses": [0.6, 0.5]}, "sum to less than 1"),
        ({"lapses": [-0.1, 0.5]}, "not negative"),
        ({"slope": float("nan")}, "finite"),
    ]:
        with pytest.raises(DataError, match=words):
            Calibration.from_json({**found.to_json(), **change})
    with pytest.raises(DataError, match="a case is of class 'maybe'; expected one of no, yes"):
        fit_calibration(CLASSES, np.full((1, 2), 0.5), ["maybe"])
    with pytest.raises(DataError, match="no cases"):
        fit_calibration(CLASSES, np.empty((0, 2)), [])


@pytest.mark.parametrize(
    ("probabilities", "words"),
    [
        (
            [[0.2, 0.8], [np.nan, 0.3]],
            r"case 1, class 0 \(counted from 0\) is nan; expected a number from 0 to 1",
        ),
        ([[0.2, np.inf], [0.5, 0.5]], "case 0, class 1 .* is inf"),
        ([[-0.1, 1.1], [0.5, 0.5]], "case 0, class 0 .* is -0.1"),
        ([0.2, 0.8], r"shape \(2,\); expected \(cases, 2\), a column for each class"),
        ([["a", "b"]], "expected an array of numbers"),
        ([[0.2, 0.8]], "2 labels need as many rows of probabilities, not 1"),
    ],
)
def test_what_is_no_probability_is_an_error(probabilities, words):
    with pytest.raises(DataError, match=words):
        fit_calibration(("a", "b"), probabilities, ("a", "b"))
    if "labels" not in words:
        with pytest.raises(DataError, match=words):
            Calibration(("a", "b"), 1.0, np.zeros(2), np.zeros(2), np.full(2, 0.5)).calibrate(probabilities)


def test_weights_are_checked():
    for weights in ([1, np.nan], [1, 0], [1]):
        with pytest.raises(DataError, match="as many weights, finite and above 0"):
            fit_calibration(("a", "b"), np.full((2, 2), 0.5), ("a", "b"), weights)

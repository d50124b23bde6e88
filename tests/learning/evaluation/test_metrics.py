"""Scores of one class against the rest: by hand, against scikit-learn, and what right probabilities show."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.metrics import brier_score_loss, roc_auc_score

from lcorpp.learning.evaluation.metrics import (
    bootstrap_interval,
    brier,
    cluster_bootstrap_weights,
    compute_auc,
    expected_calibration_error,
    expected_ece_if_calibrated,
    reliability,
)


def cases(count: int, *, seed: int = 0, sharpen: float = 1.0):
    """Probabilities and labels drawn from them; `sharpen` above 1 makes the probabilities too sure."""
    rng = np.random.default_rng(seed)
    logits = rng.normal(0, 1.5, count)
    positive = rng.random(count) < 1 / (1 + np.exp(-logits))
    return 1 / (1 + np.exp(-sharpen * logits)), positive


def test_a_few_by_hand():
    scores, positive = np.array([0.1, 0.4, 0.4, 0.8]), np.array([False, True, False, True])
    one = np.ones((1, 4))
    assert compute_auc(scores, positive, one)[0] == 3.5 / 4  # of the four pairs one is a tie
    assert brier(scores, positive, one)[0] == pytest.approx((0.01 + 0.36 + 0.16 + 0.04) / 4)
    twice = np.array([[1.0, 2.0, 1.0, 1.0], [1, 0, 1, 0]])
    both = compute_auc(scores, positive, twice)
    assert both[0] == pytest.approx((2 * 1.5 + 2) / 6)
    assert np.isnan(both[1])  # nobody positive was drawn


def test_as_scikit_learn_computes_them():
    scores, positive = cases(500)
    scores = np.round(scores, 2)  # with ties
    weights = np.random.default_rng(1).integers(0, 4, (3, 500)).astype(float)
    for row, area, distance in zip(
        weights, compute_auc(scores, positive, weights), brier(scores, positive, weights), strict=True
    ):
        assert area == pytest.approx(roc_auc_score(positive, scores, sample_weight=row))
        assert distance == pytest.approx(brier_score_loss(positive, scores, sample_weight=row))


def test_areas_of_many_scores_are_those_of_each():
    rng = np.random.default_rng(1)
    scores, positive = rng.random((5, 80)).round(1), rng.random((5, 80)) < 0.5  # with ties
    scores[1], positive[2] = 0.5, True
    weights = rng.integers(0, 4, 80).astype(float)
    each = [
        compute_auc(score, flags, weights[None])[0] for score, flags in zip(scores, positive, strict=True)
    ]
    np.testing.assert_allclose(compute_auc(scores, positive, weights[None]), each)
    assert (each[1], np.isnan(each[2])) == (0.5, True)


def test_right_probabilities_have_the_error_of_chance_and_sure_ones_more():
    one = np.ones((1, 4000))
    scores, positive = cases(4000)
    assert expected_calibration_error(scores, positive, one)[0] < 2 * expected_ece_if_calibrated(scores)
    sure, positive = cases(4000, sharpen=3)
    assert expected_calibration_error(sure, positive, one)[0] > 5 * expected_ece_if_calibrated(sure)


def test_the_reliability_curve_holds_everybody_once():
    scores, positive = cases(1000)
    bins = reliability(scores, positive)
    assert [b.cases for b in bins] == [100] * 10
    assert sum(b.observed.estimate * b.cases for b in bins) == pytest.approx(positive.sum())
    assert all(b.observed.low <= b.observed.estimate <= b.observed.high for b in bins)
    assert (
        sum(b.observed.low <= b.predicted <= b.observed.high for b in bins) >= 7
    )  # 95 % of them are expected
    few = reliability(np.full(20, 0.5), np.arange(20) < 20)
    assert [(b.predicted, b.observed.estimate, b.observed.high) for b in few] == [(0.5, 1.0, 1.0)]


def test_intervals_have_their_nominal_coverage():
    """Of 60 samples some 57 have the true AUC in their interval; 3 or fewer of 60 miss with probability .65,
    and more than 8 with probability .004."""
    truth = roc_auc_score(*reversed(cases(200_000, seed=99)))
    hits = 0
    for seed in range(60):
        scores, positive = cases(150, seed=seed)
        weights = cluster_bootstrap_weights([str(i) for i in range(150)], count=300, seed=seed)
        interval = bootstrap_interval(
            float(roc_auc_score(positive, scores)), compute_auc(scores, positive, weights)
        )
        hits += interval.low <= truth <= interval.high
    assert hits >= 52


def test_people_with_several_cases_are_drawn_whole():
    groups = [str(row // 5) for row in range(200)]
    weights = cluster_bootstrap_weights(groups, count=50)
    assert (weights.sum(axis=1) == 200).all()
    assert (weights.reshape(50, 40, 5) == weights.reshape(50, 40, 5)[:, :, :1]).all()
    scores = np.repeat(np.random.default_rng(0).normal(size=40), 5)
    positive = np.repeat(np.arange(40) % 2 == 0, 5)
    wide = bootstrap_interval(0.5, compute_auc(scores, positive, weights))
    alone = bootstrap_interval(
        0.5, compute_auc(scores, positive, cluster_bootstrap_weights([str(i) for i in range(200)], count=50))
    )
    assert wide.high - wide.low > 1.5 * (alone.high - alone.low)  # five copies tell nothing new

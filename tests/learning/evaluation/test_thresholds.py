"""Thresholds: by hand, against trying all of them, and for another prevalence than that of the data."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.metrics import accuracy_score, f1_score

from lcorpp.errors import DataError
from lcorpp.learning import DecisionThreshold, choose_threshold
from lcorpp.learning.evaluation.thresholds import apply_threshold


def cases(count: int = 400, share: float = 0.5, seed: int = 0):
    rng = np.random.default_rng(seed)
    positive = rng.random(count) < share
    scores = 1 / (1 + np.exp(-rng.normal(np.where(positive, 1, -1), 1.3)))
    return scores, positive, (np.arange(count) % 5).tolist()


@pytest.mark.parametrize(("goal", "figure"), [("accuracy", accuracy_score), ("f1", f1_score)])
def test_no_threshold_is_better_on_the_data_s_own_share(goal, figure):
    scores, positive, folds = cases(120, share=0.3)
    found = choose_threshold(scores, positive, folds, prevalence=positive.mean(), goal=goal)
    reached = figure(positive, scores >= found.probability)
    assert reached == pytest.approx(found.in_sample)
    assert reached == pytest.approx(max(figure(positive, scores >= t) for t in [*scores, 0.0, 1.1]))
    assert found.out_of_fold <= found.in_sample


def test_a_rare_class_has_a_higher_threshold():
    """Of calibrated scores at shares of one half the best threshold for accuracy is 1 - prevalence."""
    rng = np.random.default_rng(1)
    scores = rng.random(60_000)
    positive = rng.random(60_000) < scores
    for prevalence in (0.2, 0.5, 0.8):
        found = choose_threshold(scores, positive, [0, 1] * 30_000, prevalence=prevalence)
        assert found.probability == pytest.approx(1 - prevalence, abs=0.05)
    youden = choose_threshold(scores, positive, [0, 1] * 30_000, prevalence=0.02, goal="youden")
    assert youden.probability == pytest.approx(0.5, abs=0.05)
    assert youden.in_sample == pytest.approx(youden.tpr - youden.fpr)


def test_costs_move_the_threshold():
    scores, positive, folds = cases(2000)
    dear = choose_threshold(scores, positive, folds, prevalence=0.5, goal=(10, 1))
    cheap = choose_threshold(scores, positive, folds, prevalence=0.5, goal=(1, 10))
    assert dear.goal == "cost"
    assert dear.probability < 0.3 < 0.7 < cheap.probability
    assert dear.in_sample == pytest.approx(-(0.5 * (1 - dear.tpr) * 10 + 0.5 * dear.fpr))
    equal = choose_threshold(scores, positive, folds, prevalence=0.3, goal=(1, 1))
    accurate = choose_threshold(scores, positive, folds, prevalence=0.3)
    assert (equal.probability, equal.in_sample) == (
        accurate.probability,
        pytest.approx(accurate.in_sample - 1),
    )


def test_the_honest_figure_was_not_seen_when_choosing():
    rng = np.random.default_rng(0)
    scores, positive = rng.random(60), rng.random(60) < 0.5  # nothing to be known
    found = choose_threshold(scores, positive, (np.arange(60) % 5).tolist(), prevalence=0.5)
    assert found.in_sample > 0.55
    assert found.out_of_fold < found.in_sample


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"goal": "speed"}, "unknown goal 'speed'; expected one of accuracy, f1, youden or two costs"),
        ({"prevalence": 0}, "prevalence is 0"),
        ({"prevalence": 1.0}, "between 0 and 1"),
        ({"goal": (0, 0)}, "costs are 0 and 0"),
        ({"goal": (-1, 2)}, "costs are -1 and 2"),
    ],
)
def test_invalid_goals_and_prevalences_are_errors(change, words):
    scores, positive, folds = cases(50)
    with pytest.raises(DataError, match=words):
        choose_threshold(scores, positive, folds, **{"prevalence": 0.5, **change})
    with pytest.raises(DataError, match="positive and negative cases"):
        choose_threshold(scores, np.ones(50, dtype=bool), folds, prevalence=0.5)


def test_predictions_by_a_threshold():
    probabilities = np.array([[0.2, 0.8], [0.6, 0.4], [0.5, 0.5]])
    assert apply_threshold(("a", "b"), probabilities) == ["b", "a", "a"]
    assert apply_threshold(("a", "b"), probabilities, DecisionThreshold("b", 0.4)) == ["b", "b", "b"]
    assert apply_threshold(("a", "b"), probabilities, DecisionThreshold("a", 0.6)) == ["b", "a", "b"]
    three = np.array([[0.3, 0.1, 0.6], [0.2, 0.5, 0.3], [0.6, 0.1, 0.3]])
    assert apply_threshold(("a", "b", "c"), three, DecisionThreshold("a", 0.3)) == ["a", "b", "a"]
    assert apply_threshold(("a", "b", "c"), three, DecisionThreshold("a", 0.7)) == ["c", "b", "c"]
    with pytest.raises(DataError, match="a threshold of d is for other classes than a, b, c"):
        apply_threshold(("a", "b", "c"), three, DecisionThreshold("d", 0.5))
    with pytest.raises(DataError, match="expected 0"):
        DecisionThreshold("a", 1.5)


@pytest.mark.parametrize("goal", ["accuracy", "f1", "youden", (3, 1)])
def test_a_weight_counts_like_equal_cases(goal):
    rng = np.random.default_rng(3)
    positive = np.arange(120) % 3 == 0
    scores, weights = rng.random(120) * 0.8 + 0.2 * positive, rng.integers(1, 4, 120)
    folds = np.arange(120) % 5
    rows = np.repeat(np.arange(120), weights)
    weighted = choose_threshold(
        scores, positive, folds.tolist(), prevalence=0.3, goal=goal, weights=weights.astype(float)
    )
    repeated = choose_threshold(scores[rows], positive[rows], folds[rows].tolist(), prevalence=0.3, goal=goal)
    for name in ("probability", "in_sample", "out_of_fold", "tpr", "fpr"):
        assert getattr(weighted, name) == pytest.approx(getattr(repeated, name), abs=1e-12)

"""Standard errors of published numbers, by hand."""

from math import sqrt

import pytest

from lcorpp.experiments.figures import published
from lcorpp.experiments.figures.published import compute_standard_error, deviate_score
from tests.experiments.figures.made_up import make_scores


def test_the_standard_error_of_an_accuracy_is_binomial():
    scores = make_scores("L", 0.6, 0.7, 0, 30)
    expected = sqrt(0.9 * 0.1 / 5000 + 0.01**2 / 12)
    assert compute_standard_error(scores, "accuracy", "0.90") == pytest.approx(expected)


def test_the_standard_error_of_a_cost_takes_their_deviation_or_ours():
    scores = make_scores("P", 0.8, 0.8, 12, 40)  # its costs deviate by 7
    theirs = compute_standard_error(scores, "cost", "10.93", 7.21)
    assert theirs == pytest.approx(sqrt(7.21**2 / 5000 + 0.01**2 / 12))
    assert compute_standard_error(scores, "cost", "9.8") == pytest.approx(sqrt(49 / 5000 + 0.1**2 / 12))


def test_the_standard_error_of_an_f1_score_agrees_with_simulation():
    """40 % positive, 80 % of them found, 10 % false alarms: F1 of 5000 decisions, 4000 times."""
    import numpy as np

    rng = np.random.default_rng(3)
    cells = rng.multinomial(
        5000, [0.32, 0.08, 0.06, 0.54], size=4000
    )  # hits, misses, false, right rejections
    f1 = 2 * cells[:, 0] / (2 * cells[:, 0] + cells[:, 1] + cells[:, 2])
    scores = make_scores("L", 2 * 0.32 / (0.64 + 0.14), 0.86, 0, 0)
    assert compute_standard_error(scores, "f1", "0.8205") == pytest.approx(f1.std(), rel=0.05)


def test_a_reason_is_given_only_for_large_deviations():
    scores = make_scores("L", 0.6, 0.9, 0, 30)
    assert deviate_score("paper", scores, "accuracy", "0.90", reason="why").reason == ""
    assert deviate_score("paper", scores, "accuracy", "0.70", reason="why").reason == "why"


def test_our_interval_counts_too():
    exact, simulated = make_scores("L", 0.6, 0.9, 0, 30), make_scores("L", 0.6, 0.9, 0, 30, 0.0196)
    one = deviate_score("paper", exact, "accuracy", "0.88")
    both = deviate_score("paper", simulated, "accuracy", "0.88")
    assert both.standard_error == pytest.approx(sqrt(one.standard_error**2 + 0.01**2), rel=1e-4)


def test_the_tables_name_known_metrics():
    tables = [published.STRATEGIES, *published.KNOWLEDGE.values()]
    assert {metric for table in tables for row in table.values() for metric in row} == {
        "f1",
        "accuracy",
        "cost",
    }

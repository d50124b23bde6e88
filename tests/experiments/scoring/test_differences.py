"""Paired differences between strategies: by hand, and the coverage of their intervals."""

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.experiments.scoring.differences import (
    add_differences,
    add_exact_differences,
    find_reference,
    linearise_f1,
)
from lcorpp.experiments.scoring.metrics import score_decisions, score_probabilities
from lcorpp.values import Z95, Interval


def score(name: str, cost: np.ndarray, return_: np.ndarray):
    counts = np.array([[len(cost), 0, 0], [0, 0, 0]], float)
    return score_decisions(name, counts, cost, return_, values=("yes", "no"), positive=None)


def test_differences_by_hand():
    cost = np.array([[1.0, 2.0], [2.0, 2.0], [3.0, 5.0]])
    return_ = np.array([[10.0, 12.0], [8.0, 8.0], [6.0, 10.0]])
    rows = [score("P", cost[:, 0], return_[:, 0]), score("R+P", cost[:, 1], return_[:, 1])]
    worse, reference = add_differences(rows, cost, return_, np.zeros_like(cost))
    assert reference.difference is None
    assert worse.difference.reference == "R+P"
    half = Z95 * 1 / np.sqrt(3)  # the costs differ by 1, 0 and 2: mean 1, standard deviation 1
    found = worse.difference.cost
    assert (found.estimate, found.low, found.high) == pytest.approx((1, 1 - half, 1 + half))
    assert worse.difference.return_.estimate == 2


def test_a_notebook_shows_each_variable():
    comparison = compare_strategies(load_domain("shopping", preset="small"), ComparisonOptions(trials=None))
    html = comparison._repr_html_()
    assert all(f"<th>{name}</th>" in html for name in ("item", "person", "room", "all", "cost", "return"))


def test_one_strategy_has_no_difference():
    (row,) = add_differences(
        [score("P", np.ones(3), np.ones(3))], np.ones((3, 1)), np.ones((3, 1)), np.ones((3, 1))
    )
    assert row.difference is None


@pytest.mark.parametrize(
    ("names", "reference"),
    [
        (["L", "R", "P", "LCORPP", "LCORPP-gaze"], "LCORPP"),
        (["R+P", "P", "R"], "R+P"),
        (["P", "ask-twice"], "P"),
        (["mine", "ask-twice"], "ask-twice"),
    ],
)
def test_the_reference_uses_most_parts(names, reference):
    assert find_reference(names) == reference


def test_paired_intervals_cover_the_true_difference_in_95_of_100_samples():
    """1000 experiments of 100 people; the number of hits is binomial(1000, .95), so 922 is 4 SD below.

    The costs of one person are strongly correlated, as both strategies meet the same person: the paired
    interval is far narrower than one of independent samples.
    """
    rng = np.random.default_rng(11)
    hits, width, independent = 0, 0.0, 0.0
    for _ in range(1000):
        person = rng.exponential(5, size=(100, 1))
        cost = person + rng.normal([0.0, 0.5], 1, size=(100, 2))
        rows = [score(name, cost[:, k], -cost[:, k]) for k, name in enumerate(("P", "R+P"))]
        found = add_differences(rows, cost, -cost, cost)[0].difference.cost
        hits += found.low <= 0.5 <= found.high
        width += found.high - found.low
        independent += sum(row.cost.high - row.cost.low for row in rows)
    assert 922 <= hits <= 978
    assert width < independent / 4


def draw_decisions(rng, people=400):
    """Return truths (n,) and reports (n, 2) of two classifiers that are wrong about the same people."""
    truth = (rng.random(people) < 0.4).astype(np.intp)
    shared = rng.random(people)
    reported = [np.where(shared < error, 1 - truth, truth) for error in (0.3, 0.2)]
    return truth, np.stack(reported, axis=1)


@pytest.mark.parametrize("positive", ["yes", None])
def test_the_mean_of_linearised_f1_is_f1(positive):
    truth, reported = draw_decisions(np.random.default_rng(0))
    counts = np.zeros((2, 3))
    np.add.at(counts, (truth, reported[:, 0]), 1)
    values = ("no", "yes")
    expected = score_decisions("L", counts, np.zeros(1), np.zeros(1), values=values, positive=positive).f1
    found = linearise_f1(truth, reported[:, 0], values, positive)
    assert found.mean() == pytest.approx(expected.estimate, abs=1e-12)


def test_a_class_that_never_occurs_has_f1_of_zero():
    zeros = np.zeros(5, np.intp)
    assert linearise_f1(zeros, zeros, ("no", "yes"), "yes").tolist() == [0] * 5


def test_paired_intervals_of_f1_cover_the_true_difference():
    """F1 = 2 * .4 * (1 - e) / (.4 + .4 (1 - e) + .6 e) for an error rate e; 1000 samples, as above."""
    rng = np.random.default_rng(4)
    first, second = (0.8 * (1 - e) / (0.4 + 0.4 * (1 - e) + 0.6 * e) for e in (0.3, 0.2))
    hits, width, independent = 0, 0.0, 0.0
    for _ in range(1000):
        truth, reported = draw_decisions(rng)
        f1 = np.stack([linearise_f1(truth, column, ("no", "yes"), "yes") for column in reported.T], axis=1)
        rows = [score(name, np.zeros(1), np.zeros(1)) for name in ("P", "R+P")]
        found = add_differences(rows, np.zeros((1, 2)), np.zeros((1, 2)), f1)[0].difference.f1
        hits += found.low <= second - first <= found.high
        width += found.high - found.low
        independent += sum(2 * Z95 * column.std() / 20 for column in f1.T)
    assert 922 <= hits <= 978
    assert width < 0.6 * independent


def test_differences_of_exact_scores_and_of_bounds():
    joint, options = np.array([[0.5, 0, 0], [0, 0.5, 0]]), {"values": ("yes", "no"), "positive": None}
    cost, return_ = Interval(2, 1, 3, 1), Interval.exact(5)
    worse = score_probabilities("R+P", joint, cost, return_, 0, **options)
    cost, return_ = Interval.exact(1), Interval.exact(9)
    better = score_probabilities("LCORPP", joint, cost, return_, 0, **options)
    first, second = add_exact_differences([worse, better])
    assert second.difference is None
    assert first.difference.cost == Interval(-1, -2, 0)
    assert first.difference.return_ == Interval.exact(4)
    assert first.difference.f1 == Interval.exact(0)

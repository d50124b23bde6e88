"""Paired differences between strategies: by hand, and the coverage of their intervals."""

import numpy as np
import pytest

from lcorpp.decision.strategies import strategies
from lcorpp.domains import load_domain
from lcorpp.errors import DecisionError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.scoring.decision_scores import score_decisions, score_probabilities
from lcorpp.scoring.metrics import find_reference
from lcorpp.values import Z95, Interval


def score(name: str, cost: np.ndarray, return_: np.ndarray):
    zeros = np.zeros(len(cost), np.intp)
    return score_decisions(name, zeros, zeros, cost, return_, values=("yes", "no"), positive=None)


def test_differences_by_hand():
    worse = score("P", np.array([1.0, 2.0, 3.0]), np.array([10.0, 8.0, 6.0]))
    better = score("R+P", np.array([2.0, 2.0, 5.0]), np.array([12.0, 8.0, 10.0]))
    gaps, half = better.subtract(worse), Z95 * 1 / np.sqrt(3)  # costs: by 1, 0 and 2, mean and deviation 1
    found = gaps["cost"]
    assert (found.estimate, found.low, found.high) == pytest.approx((1, 1 - half, 1 + half))
    assert gaps["return"].estimate == 2
    back = worse.subtract(better)["cost"]
    assert (back.estimate, back.low, back.high) == pytest.approx((-1, -1 - half, -1 + half))
    assert better.subtract(better)["return"] == Interval.exact(0)


def test_each_pair_of_a_comparison_has_the_differences_of_a_comparison_of_the_two():
    domain = load_domain("intention")
    names = ["L", "P", "R+P", "LCORPP"]
    rows = compare_strategies(domain, ComparisonOptions(strategies(names), trials=300)).scores
    together = {row.strategy: row for row in rows}
    options = ComparisonOptions(strategies(["P", "R+P"]), trials=300)
    first, second = compare_strategies(domain, options).scores
    assert together["R+P"].subtract(together["P"]) == second.subtract(first)
    assert {name: gap.estimate for name, gap in together["L"].subtract(together["LCORPP"]).items()} == {
        name: pytest.approx(together["L"].metrics[name].estimate - together["LCORPP"].metrics[name].estimate)
        for name in ("f1", "cost", "return")
    }


def test_scores_of_other_people_are_refused():
    few, more = score("P", np.ones(3), np.ones(3)), score("R+P", np.ones(4), np.ones(4))
    joint, exact = np.array([[0.5, 0, 0], [0, 0.5, 0]]), Interval.exact(1)
    known = score_probabilities("R", joint, exact, exact, 0, values=("yes", "no"), positive=None)
    for other in (more, known):
        with pytest.raises(
            DecisionError, match=r"P and .* different people; expected scores of one comparison"
        ):
            few.subtract(other)
    with pytest.raises(DecisionError, match="scores is 'R'; expected Scores"):
        few.subtract("R")


def test_a_notebook_shows_each_variable():
    comparison = compare_strategies(
        load_domain("shopping", preset="small"), ComparisonOptions(trials=None, cache=find_cache_folder())
    )
    html = comparison._repr_html_()
    assert all(f">{name}</th>" in html for name in ("item", "person", "room", "all", "cost", "return"))


@pytest.mark.parametrize(
    ("names", "reference"),
    [
        (["L", "R", "P", "LCORPP", "LCORPP-gaze"], "LCORPP"),
        (["R+P", "P", "R"], "R+P"),
        (["P", "ask-twice"], "P"),
        (["mine", "ask-twice"], "ask-twice"),
        (["P"], "P"),
    ],
)
def test_the_reference_uses_most_parts(names, reference):
    assert find_reference([score(name, np.ones(3), np.ones(3)) for name in names]).strategy == reference


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
        worse, better = (score(name, cost[:, k], -cost[:, k]) for k, name in enumerate(("P", "R+P")))
        found = better.subtract(worse)["cost"]
        hits += found.low <= 0.5 <= found.high
        width += found.high - found.low
        independent += sum(row.cost.high - row.cost.low for row in (worse, better))
    assert 922 <= hits <= 978
    assert width < independent / 4


def draw_decisions(rng, positive="yes", people=400):
    """Return the scores of two classifiers that are wrong about the same people."""
    truth = (rng.random(people) < 0.4).astype(np.intp)
    shared, zeros = rng.random(people), np.zeros(people)
    return [
        score_decisions(
            name,
            truth,
            np.where(shared < error, 1 - truth, truth),
            zeros,
            zeros,
            values=("no", "yes"),
            positive=positive,
        )
        for name, error in (("P", 0.3), ("R+P", 0.2))
    ]


@pytest.mark.parametrize("positive", ["yes", None])
def test_the_mean_of_the_sample_of_f1_is_f1(positive):
    for scores in draw_decisions(np.random.default_rng(0), positive):
        assert scores.samples["f1"].mean() == pytest.approx(scores.f1.estimate, abs=1e-12)


def test_a_class_that_never_occurs_has_f1_of_zero():
    zeros, costs = np.zeros(5, np.intp), np.zeros(5)
    scores = score_decisions("L", zeros, zeros, costs, costs, values=("no", "yes"), positive="yes")
    assert scores.samples["f1"].tolist() == [0] * 5


def test_paired_intervals_of_f1_cover_the_true_difference():
    """F1 = 2 * .4 * (1 - e) / (.4 + .4 (1 - e) + .6 e) for an error rate e; 1000 samples, as above."""
    rng = np.random.default_rng(4)
    first, second = (0.8 * (1 - e) / (0.4 + 0.4 * (1 - e) + 0.6 * e) for e in (0.3, 0.2))
    hits, width, independent = 0, 0.0, 0.0
    for _ in range(1000):
        worse, better = draw_decisions(rng)
        found = better.subtract(worse)["f1"]
        hits += found.low <= second - first <= found.high
        width += found.high - found.low
        independent += sum(2 * Z95 * row.samples["f1"].std() / 20 for row in (worse, better))
    assert 922 <= hits <= 978
    assert width < 0.6 * independent


def test_differences_of_exact_scores_and_of_bounds():
    joint, options = np.array([[0.5, 0, 0], [0, 0.5, 0]]), {"values": ("yes", "no"), "positive": None}
    cost, return_ = Interval(2, 1, 3, 1), Interval.exact(5)
    worse = score_probabilities("R+P", joint, cost, return_, 0, **options)
    cost, return_ = Interval.exact(1), Interval.exact(9)
    better = score_probabilities("LCORPP", joint, cost, return_, 0, **options)
    assert better.subtract(worse) == {
        "cost": Interval(-1, -2, 0),
        "return": Interval.exact(4),
        "f1": Interval.exact(0),
    }

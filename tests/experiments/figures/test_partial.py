"""The figure of partial trajectories: known answers where classes show late, findings that follow numbers."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly.solving import solve_domain
from lcorpp.experiments.figures.partial import NAMES, PARTS, PartResult, make_result, run_seed
from lcorpp.experiments.figures.seeds import compute_seed_interval, run_seeds, subtract
from lcorpp.planning import Planner
from lcorpp.planning.policy_cache import find_cache_folder
from tests.experiments.figures.made_up import make_scores
from tests.scoring.test_exact_evaluation import TABLE

TRIALS = 600


def show_late(people, rng):
    """Tracks that depend on the intention in their second half only: there the others all but stand."""
    steps = rng.normal(0, 0.01, size=(len(people), 2, 80))
    interested = np.array([person["intention"] == "interested" for person in people])
    steps[:, 0] += 0.05
    steps[~interested, 0, 40:] -= 0.04
    return np.cumsum(steps, axis=2)


@pytest.fixture(scope="module")
def found():
    domain = load_domain("intention", preset="paper")
    late = replace(domain, simulation=replace(domain.simulation, signals={"motion": show_late}))
    return run_seed(
        late, Planner(solve_domain(late, cache=find_cache_folder())), 5, tracks=200, trials=TRIALS
    )


def test_a_perfect_classifier_is_right_at_once(found):
    whole = found["whole"]
    assert min(whole.recalls.values()) > 0.99  # smoothed counts of 100 of 100
    for name in NAMES:
        scores = whole.scores[name]
        assert (scores.f1.estimate, scores.return_.estimate + scores.cost.estimate) == (1, 80)
    assert whole.scores["LCORPP"].cost.estimate < 0.5  # it asks only people of a rare kind


def test_without_information_lcorpp_is_r_and_p(found):
    """Four standard errors of 600 people; the estimated rates are not exactly uniform, which costs little."""
    quarter = found["quarter"]
    f1, accuracy, *_ = TABLE["paper"]["R+P"]
    scores = quarter.scores["LCORPP"]
    assert scores.accuracy.estimate == pytest.approx(
        accuracy, abs=4 * (accuracy * (1 - accuracy) / TRIALS) ** 0.5
    )
    assert scores.f1.estimate == pytest.approx(f1, abs=0.08)
    assert abs(quarter.scores["L"].accuracy.estimate - 0.5) < 0.1
    assert found["half"].scores["LCORPP"].cost.estimate > found["whole"].scores["LCORPP"].cost.estimate


def make_results(f1, cost, seeds=5, half=0.004):
    """Made-up results; f1[name] and cost[name] are of a quarter, half and whole track."""
    jitter = np.random.default_rng(0).uniform(-half, half, size=(seeds, len(PARTS), len(NAMES)))
    return [
        {
            part: PartResult(
                {
                    name: make_scores(name, f1[name][i] + jitter[seed, i, j], 0.8, cost[name][i], 40)
                    for j, name in enumerate(NAMES)
                },
                {"interested": 0.8, "not_interested": 0.7},
            )
            for i, part in enumerate(PARTS)
        }
        for seed in range(seeds)
    ]


F1 = {"L": (0.55, 0.6, 0.65), "L+R": (0.67, 0.7, 0.72), "LCORPP": (0.81, 0.82, 0.83)}
COST = {"L": (0, 0, 0), "L+R": (0, 0, 0), "LCORPP": (9, 8.5, 8)}


def test_findings_hold_with_the_numbers_of_the_paper():
    result = make_result(make_results(F1, COST), 1600)
    assert {finding.verdict for finding in result.findings} == {"holds"}
    assert "with a quarter LCORPP loses less F1 than L and L+R: holds (less than L by 0.0" in result.paragraph
    assert {row.reason for row in result.deviations} == {""}
    assert [row["f1"] for row in result.table][-1] == pytest.approx(0.83, abs=0.004)


def test_findings_fail_with_other_numbers_and_the_reason_is_given():
    result = make_result(make_results(F1 | {"LCORPP": (0.5, 0.7, 0.95)}, COST), 1600)
    verdicts = {finding.claim: finding.verdict for finding in result.findings}
    assert verdicts["LCORPP > L+R > L in F1, quarter"] == "does not hold"
    assert verdicts["Hypothesis III, with a quarter LCORPP loses less F1 than L and L+R"] == "does not hold"
    far = {row.what: row for row in result.deviations if row.setting == "quarter"}["LCORPP, F1"]
    assert far.in_standard_errors < -3
    assert "recall of our classifier, quarter: interested 0.80, not_interested 0.70" in far.reason


def test_equal_costs_are_no_further_actions():
    finding = make_result(make_results(F1, COST | {"LCORPP": (8, 8, 8)}), 1600).findings[-1]
    assert (finding.verdict, finding.evidence) == (
        "does not hold",
        "cost of a quarter - whole 0.00 [0.00, 0.00]",
    )


@pytest.mark.parametrize(("layout", "size"), [("wide", (7.2, 3.1)), ("column", (3.5, 5.8))])
def test_the_figure_has_a_line_for_each_strategy(layout, size):
    figure = make_result(make_results(F1, COST), 1600).draw(layout)
    assert tuple(figure.get_size_inches()) == pytest.approx(size)
    left, right = figure.axes
    assert (len(left.containers), len(right.containers)) == (3, 1)


def double(seed):
    return 2 * seed


def test_seeds_run_in_processes_in_their_order():
    calls = []
    assert run_seeds(double, [3, 1, 2], 2, lambda *call: calls.append(call)) == [6, 2, 4]
    assert calls == [(1, 3), (2, 3), (3, 3)]


def test_the_interval_over_seeds_is_students():
    interval = compute_seed_interval([1.0, 2.0, 3.0])
    assert (interval.estimate, interval.low) == pytest.approx((2, 2 - 4.302653 / 3**0.5))
    assert subtract([3.0, 4.0, 5.0], [2.0, 3.0, 4.0]).high == 1
    with pytest.raises(ValueError, match="at least two"):
        compute_seed_interval([1.0])

"""The figure of active data augmentation: known answers with clear tracks, findings that follow numbers."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp import load_domain
from lcorpp.assembly.solving import solve_domain
from lcorpp.experiments.figures.augmentation import BATCHES, make_result
from lcorpp.planning import Planner
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.runs.from_no_data import NONE, BatchOutcome, run_from_no_data
from lcorpp.runs.senses import CORRECTED, HARD, SOFT
from lcorpp.values import ConfusionMatrix
from tests.experiments.figures.made_up import make_scores
from tests.scoring.test_exact_evaluation import TABLE

CLASSES = ("interested", "not_interested")
SIZES = {"learner": "summaries", "batches": 2, "batch_size": 200, "test_size": 200}

simulated: list[int] = []
"""Numbers of people whose tracks were simulated at once."""


def show_always(people, rng):
    """Tracks whose speed is the intention: the interested walk, the others all but stand."""
    simulated.append(len(people))
    walking = np.array([person["intention"] == "interested" for person in people])
    steps = rng.normal(0, 0.01, size=(len(people), 2, 40))
    steps[:, 0] += np.where(walking, 0.05, 0.01)[:, None]
    return np.cumsum(steps, axis=2)


@pytest.fixture(scope="module")
def found():
    """Two batches of 200 people whose tracks show the intention, with each run."""
    domain = load_domain("intention", preset="paper")
    clear = replace(domain, simulation=replace(domain.simulation, signals={"motion": show_always}))
    planner = Planner(solve_domain(clear, cache=find_cache_folder()))
    return run_from_no_data(clear, planner, 3, **SIZES)


@pytest.mark.slow
def test_without_learning_all_batches_are_decided_like_r_and_p(found):
    _, accuracy, cost, cost_sd, _ = TABLE["paper"]["R+P"]
    outcomes = found[NONE]
    counts = sum(outcome.scores.counts for outcome in outcomes)
    assert np.trace(counts) / 400 == pytest.approx(accuracy, abs=4 * (accuracy * (1 - accuracy) / 400) ** 0.5)
    means = [outcome.scores.cost.estimate for outcome in outcomes]
    assert np.mean(means) == pytest.approx(cost, abs=4 * cost_sd / 400**0.5)
    assert not any(outcome.rules.counts.any() for outcome in outcomes)
    recall = sum(outcome.true.counts for outcome in outcomes)
    assert np.trace(recall) / 400 == pytest.approx(0.5, abs=4 * 0.5 / 400**0.5)


def test_the_first_batch_is_the_same_in_all_runs(found):
    assert list(found) == [NONE, HARD, SOFT, CORRECTED]
    first = [own[0] for own in found.values()]
    for other in first[1:]:
        assert (other.scores.counts == first[0].scores.counts).all()
        assert other.scores.cost == first[0].scores.cost
        assert (other.true.counts == first[0].true.counts).all()


def test_each_person_s_track_is_simulated_once_for_all_runs(found):
    in_chunks = simulated.count(50) * 50
    assert (len(found), in_chunks) == (4, SIZES["batches"] * SIZES["batch_size"])


@pytest.mark.parametrize("run", [HARD, SOFT])
def test_a_nearly_perfect_classifier_looks_as_bad_as_the_labels_in_the_rules(found, run):
    """A case that is predicted rightly and reported wrongly counts as an error of the classifier."""
    first, second = found[run]
    assert np.trace(second.true.counts) > 193
    assert min(first.learned, second.learned) > 0.95
    assert found[NONE][0].learned == found[NONE][1].learned == pytest.approx(0.5, abs=4 * 0.5 / 200**0.5)
    labels = first.scores.counts[:, :2]  # true class by reported class
    reported = labels[[0, 1], [0, 1]] / labels.sum(axis=0)
    stated = second.rules.counts[[0, 1], [0, 1]] / second.rules.counts.sum(axis=1)
    if run == HARD:
        np.testing.assert_allclose(stated, reported, atol=0.03)  # some predictions are wrong
    assert (stated < 0.95).all()
    assert 0.85 < first.belief < 1
    assert second.rules.counts.sum() == pytest.approx(200)
    assert second.scores.return_.estimate > found[NONE][1].scores.return_.estimate


def test_corrected_labels_show_in_the_rules_how_good_a_nearly_perfect_classifier_is(found):
    rates = found[CORRECTED][1].rules.probabilities.diagonal()
    true = found[CORRECTED][1].true.probabilities.diagonal()
    np.testing.assert_allclose(rates, true, atol=0.03)
    assert (rates > found[HARD][1].rules.probabilities.diagonal() + 0.05).all()


def make_results(f1, seeds=4, belief=0.88):
    """Made-up results: F1 of each batch by run; a higher F1 goes with a higher return and a lower cost."""
    jitter = np.random.default_rng(0).uniform(-0.002, 0.002, size=(seeds, BATCHES, len(f1)))

    def make(value):
        scores = make_scores("LCORPP", value, 0.85, 50 - 47 * value, 100 * value)
        scores = replace(scores, counts=np.array([[40.0, 5, 0], [10, 45.0, 0]]))
        rules = ConfusionMatrix(CLASSES, np.array([[30.0, 10], [12, 48]]))
        true = ConfusionMatrix(CLASSES, np.array([[34.0, 6], [6, 54]]))
        return BatchOutcome(scores, rules, true, belief, learned=value - 0.1)

    return [
        {run: [make(f1[run][b] + jitter[s, b, r]) for b in range(BATCHES)] for r, run in enumerate(f1)}
        for s in range(seeds)
    ]


RISING = {NONE: (0.81,) * 4, HARD: (0.81, 0.83, 0.85, 0.86), SOFT: (0.81, 0.84, 0.86, 0.88)}


def test_findings_hold_where_the_curve_rises():
    result = make_result(make_results(RISING), "interested")
    assert [finding.verdict for finding in result.findings] == ["holds"] * 7
    assert (
        "Hypothesis IV, F1 rises from the first to the last batch, hard labels: holds (by 0.05"
        in result.paragraph
    )
    assert (
        "reported as interested 20.0% are not in the first batch, 20.0% in the last; of" in result.paragraph
    )
    assert "The mean belief in its reports is 0.880; 0.850 of them are right" in result.paragraph
    assert "interested 0.74 (true 0.84), not_interested 0.80 (true 0.89)" in result.paragraph
    assert "soft labels are nearly hard" not in result.paragraph
    rows = {(row["run"], row["batch"]): row for row in result.table}
    assert len(rows) == 12
    assert rows[HARD, 4]["label_error_interested"] == pytest.approx(0.2)
    assert rows[HARD, 4]["recall_in_rules_interested"] == pytest.approx(30.5 / 41)


def test_corrected_labels_are_compared_with_hard_ones():
    results = make_results(RISING | {CORRECTED: (0.81, 0.85, 0.87, 0.89)})
    result = make_result(results, "interested")
    assert [finding.verdict for finding in result.findings] == ["holds"] * 11
    assert (
        "In the last batch F1 and return are higher with corrected labels than with hard ones"
        in result.paragraph
    )
    assert {row["run"] for row in result.table} == {NONE, HARD, SOFT, CORRECTED}
    assert [len(axes.containers) for axes in result.draw("wide").axes] == [4, 6, 4, 4]


def test_findings_fail_where_it_falls_and_are_open_where_nothing_changes():
    falling = RISING | {HARD: (0.86, 0.85, 0.83, 0.8), SOFT: (0.81,) * 4}
    findings = make_result(make_results(falling), "interested").findings
    hard, hard_gain, hard_learned, soft, soft_gain, soft_learned, better = findings
    assert (hard_learned.verdict, soft_learned.verdict) == ("does not hold", "is not decided")
    assert (hard.verdict, hard_gain.verdict) == ("does not hold", "does not hold")
    assert (soft.verdict, soft_gain.verdict) == ("is not decided", "is not decided")
    assert better.verdict == "holds"


def test_too_firm_beliefs_are_noted():
    assert (
        "soft labels are nearly hard"
        in make_result(make_results(RISING, belief=0.98), "interested").paragraph
    )


def test_far_published_numbers_are_those_of_another_run():
    far = make_result(make_results(RISING), "interested").deviations
    assert [row.what for row in far] == [f"batch {b}, {m}" for m in ("F1", "cost") for b in (1, 2, 3)]
    assert far[2].in_standard_errors < -3
    assert "the published run is another" in far[2].reason
    assert all("of another run, four times" in row.reason for row in far[3:])


@pytest.mark.parametrize(("layout", "size"), [("wide", (7.2, 5.8)), ("column", (3.5, 11.2))])
def test_the_figure_has_a_line_for_each_run(layout, size):
    figure = make_result(make_results(RISING), "interested").draw(layout)
    assert tuple(figure.get_size_inches()) == pytest.approx(size)
    assert [len(axes.containers) for axes in figure.axes] == [3, 4, 3, 3]

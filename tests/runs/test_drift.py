"""Alarms of drift: a known rate of false ones, and changes are found."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from lcorpp import load_domain
from lcorpp.assembly import TrainingOptions
from lcorpp.assembly.solving import solve_domain
from lcorpp.planning import Planner
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.runs import ActiveLearningOptions, run_active_learning, set_up_learning
from lcorpp.runs.drift import (
    CHANGES,
    FALSE_ALARMS,
    DriftMonitor,
    agrees_with,
    calibrate,
    compute_capital,
)
from lcorpp.values import Likelihood


def run(rng, senses=("walk",), batches=8, size=30, change_at=None, shift=0.0, agreement=0.8):
    """Rows of the batches of a stream whose signals and agreement change with a batch."""
    monitor, rows = DriftMonitor(senses, 0), [{"batch": 0}]
    for number in range(1, batches + 1):
        changed = change_at is not None and number >= change_at
        for _ in range(size):
            for sense in senses:
                signal = rng.normal(size=2) + shift * changed
                monitor.add(sense, signal, bool(rng.random() < (agreement if changed else 0.8)))
        rows.append({"batch": number} | monitor.test_batch(number, rows))
    return rows


@pytest.mark.slow
def test_without_a_change_alarms_are_as_rare_as_stated():
    """100 runs of two senses, four tests; 5 false alarms or fewer are expected, 12 are 3 sigma more."""
    rng = np.random.default_rng(0)
    runs = [run(rng, ("walk", "gaze"), batches=5, size=15) for _ in range(100)]
    false = [any(row.get("drift") for row in rows) for rows in runs]
    assert sum(false) < 100 * FALSE_ALARMS + 3 * (100 * FALSE_ALARMS) ** 0.5


@pytest.mark.slow
def test_a_capital_exceeds_n_in_at_most_one_of_n_runs():
    rng = np.random.default_rng(0)
    highest = [max(compute_capital(p[:n]) for n in range(1, 21)) for p in rng.random((800, 20))]
    for n in (5, 20):
        assert np.mean(np.array(highest) >= n) < 1 / n + 3 * (1 / n / 800) ** 0.5


def test_an_e_value_has_mean_1():
    """With p = exp(-u); beyond u = 690, where p cannot be represented, lies 1/690 of the integral."""
    mean, _ = quad(lambda u: calibrate(np.exp(-u)) * np.exp(-u), 0, 690, limit=200)
    assert mean == pytest.approx(1 - 1 / 690, abs=1e-4)
    assert calibrate(1 - 2e-6) == pytest.approx(calibrate(1.0), abs=1e-3)
    values = [calibrate(p) for p in (0.0, 1e-6, 0.001, 0.1, 0.5, 1.0)]
    assert values == sorted(values, reverse=True)


def test_the_first_batch_is_compared_with_nothing():
    rows = run(np.random.default_rng(0))
    assert rows[1] == {"batch": 1}
    assert set(rows[2]) == {"batch", "p_signals", "p_agreement", "drift"}


@pytest.mark.parametrize(("change", "test"), [({"shift": 1.5}, "signals"), ({"agreement": 0.3}, "agreement")])
def test_a_change_is_found_within_two_batches(change, test):
    """And nothing else is."""
    rows = run(np.random.default_rng(0), change_at=5, size=40, **change)
    alarms = [row.get("drift", "") for row in rows]
    assert alarms[:5] == [""] * 5
    assert alarms[6] == CHANGES[test]
    several = run(np.random.default_rng(0), ("walk", "gaze"), change_at=5, size=40, **change)
    assert several[6]["drift"] == f"walk: {CHANGES[test]}; gaze: {CHANGES[test]}"
    assert f"p_{test}_gaze" in several[6]


def test_agreement_that_is_better_than_before_is_no_drift():
    rows = run(np.random.default_rng(0), change_at=5, size=40, agreement=1.0)
    assert not any(CHANGES["agreement"] in row.get("drift", "") for row in rows)


def test_unknown_agreement_is_left_out():
    monitor = DriftMonitor(("walk",), 0)
    for number, agrees in ((1, None), (2, True), (3, None)):
        for signal in np.random.default_rng(number).normal(size=(9, 2)):
            monitor.add("walk", signal, agrees)
        columns = monitor.test_batch(number, [])
        assert "p_agreement" not in columns


def test_a_likelihood_agrees_by_its_most_likely_class():
    assert agrees_with("yes", "yes")
    assert not agrees_with("no", "yes")
    assert agrees_with(Likelihood(("no", "yes"), [1, 3]), "yes")
    assert not agrees_with(Likelihood(("no", "yes"), [3, 1]), "yes")


@dataclass
class ShiftedSignals:
    """Signals of which all after the first 100 are a metre farther to the left."""

    source: Any
    simulated: int = 0

    def simulate(self, people, rng):
        signals = self.source.simulate(people, rng)
        self.simulated += len(people)
        return signals + np.array([[0], [1]]) * (self.simulated > 100)


@pytest.mark.slow
def test_a_run_of_algorithm_1_reports_that_the_signals_have_changed():
    """Two batches of 50, then two of shifted tracks; motion features hide a shift from the classifier."""
    domain = load_domain("intention")
    options = ActiveLearningOptions(
        {"motion": TrainingOptions(learner="summaries", tracks=60)}, batch_size=50, max_batches=4
    )
    senses = set_up_learning(domain, options)
    data = senses.data["motion"]
    senses = replace(senses, data={"motion": replace(data, signals=ShiftedSignals(data.signals))})
    planner = Planner(solve_domain(domain, cache=find_cache_folder()))
    *_, last = run_active_learning(domain, senses, planner, options)
    assert last.summary().endswith(f"; drift: {CHANGES['signals']}")
    assert [row.get("drift") for row in last.rows] == [None, None, "", CHANGES["signals"], CHANGES["signals"]]
    assert all("p_signals" in row for row in last.rows[2:])
    assert repr(last) == f"<BatchResult {last.batch.number}: {last.summary()}>"
    html = last._repr_html_()
    assert html.count("<tr>") == 6
    assert '<th scope="col">drift</th>' in html
    assert "_low<" not in html

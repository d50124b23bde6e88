"""Logs that are simulated under the stated knowledge, and the p-values that follow from them."""

import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.special import logit

from lcorpp.audit.audit import MIN_SIMULATIONS, _Auditor, audit_people
from lcorpp.audit.intervals import find_limits
from lcorpp.audit.logged_people import LoggedPeople, read_people
from lcorpp.audit.report import format_audit
from lcorpp.audit.simulation import SimulatedFits, SimulatedLogs
from lcorpp.decision import strategies
from lcorpp.domains import Domain, load_domain
from lcorpp.errors import DataError
from lcorpp.experiments import ComparisonOptions, compare_strategies
from lcorpp.fitting.uncertainty import Z95
from lcorpp.planning.policy_cache import find_cache_folder
from lcorpp.reasoning import Reasoner
from tests.audit.logs import write_log

PEOPLE, LOGS = 200, 8


def log_people(path: Path, domain: Domain, trials: int) -> LoggedPeople:
    rows = strategies(["LCORPP"], [sense.name for sense in domain.senses])
    compare_strategies(
        domain, ComparisonOptions(rows, trials=trials, seed=3, log=path, cache=find_cache_folder())
    )
    return read_people(path)


def log_museum(path: Path, **present: float) -> LoggedPeople:
    changes = {"simulation": {"present": present}} if present else {}
    return log_people(path, load_domain("museum", changes=changes), PEOPLE)


def simulate(people: LoggedPeople, *, given: bool = False) -> tuple[_Auditor, SimulatedLogs]:
    auditor = _Auditor(people, lambda done, total: None, given)
    return auditor, SimulatedLogs(people, auditor._rates, given)


def test_simulated_people_have_the_facts_of_the_knowledge_and_the_labels_of_the_rates(tmp_path):
    people = log_museum(tmp_path / "log")
    auditor, logs = simulate(people)
    drawn = [logs.draw(seed) for seed in range(LOGS)]
    assert {round(own.cases.weights.sum()) for own in drawn} == {PEOPLE}
    counts, n = Counter[str](), PEOPLE * LOGS
    for own in drawn:
        for context, weight in zip(own.cases.contexts, own.cases.weights, strict=True):
            counts[own.contexts[context]["group"]] += round(weight)
    for group, p in Reasoner(people.program).posterior("group", {}):
        assert counts[group] / n == pytest.approx(p, abs=4 * (p * (1 - p) / n) ** 0.5)
    marginal = Reasoner(people.program).posterior("wish", {}).probabilities
    expected = marginal @ auditor._rates.find_table(0, 3)
    labels = sum(np.bincount(own.cases.labels[:, 0], own.cases.weights, minlength=3) for own in drawn)
    np.testing.assert_allclose(labels / n, expected, atol=2 / n**0.5)
    again = logs.draw(3)
    np.testing.assert_array_equal(again.cases.answer_counts, drawn[3].cases.answer_counts)


def test_rates_under_the_estimated_contexts_are_the_estimated_rates(tmp_path):
    auditor, _ = simulate(log_museum(tmp_path / "log"))
    rates = auditor._rates
    contexts = rates.p[rates.tables[0]].reshape(len(auditor._people.contexts), -1)
    np.testing.assert_allclose(rates.with_contexts(contexts).p, rates.p, atol=2e-4)


def test_a_contrary_distribution_does_not_make_answers_mean_the_contrary(tmp_path):
    """The most probable rates would exchange the rows; those in the confidence region only approach that."""
    auditor, _ = simulate(log_people(tmp_path / "log", load_domain("intention"), PEOPLE))
    rates = auditor._rates
    contexts = rates.p[rates.tables[0]].reshape(len(auditor._people.contexts), -1)
    contrary = rates.with_contexts(contexts[:, ::-1])
    assert np.diff(rates._maximise(contexts[:, ::-1])[rates.tables[2]][[0, 2]]) > 0.2
    for table in (1, 2):  # the label, and the first question
        estimated, credible = (own.find_table(table - 1, 2)[:, 0] for own in (rates, contrary))
        assert estimated[0] - estimated[1] > credible[0] - credible[1] > 0


def test_the_stated_distribution_of_each_context_is_that_of_the_reasoner(tmp_path):
    auditor, _ = simulate(people := log_museum(tmp_path / "log"))
    reasoner = Reasoner(people.program)
    expected = [reasoner.posterior("wish", facts).probabilities for facts in people.contexts]
    np.testing.assert_allclose(auditor._fits.compute_contexts(), expected, atol=1e-9)


def test_labels_that_are_missing_stay_missing(tmp_path):
    people = log_museum(tmp_path / "log", gaze=0.5)
    _, logs = simulate(people)
    missing = [
        round(float(own.cases.weights[own.cases.labels[:, 1] < 0].sum())) for own in (people, logs.draw(0))
    ]
    assert missing[0] == missing[1] > 70


def test_given_facts_are_kept(tmp_path):
    people = log_museum(tmp_path / "log")
    _, logs = simulate(people, given=True)

    def count(own: LoggedPeople) -> dict[frozenset[tuple[str, str]], int]:
        found = Counter[frozenset[tuple[str, str]]]()
        for context, weight in zip(own.cases.contexts, own.cases.weights, strict=True):
            found[frozenset(own.contexts[context].items())] += round(float(weight))
        return found

    assert count(logs.draw(1)) == count(people)


def test_p_values_are_ranks_among_simulated_logs(tmp_path):
    people = log_museum(tmp_path / "log")
    auditor, _ = simulate(people)
    auditor.fit_all()
    gains = auditor.measure_gains()
    smaller, larger = (
        SimulatedFits({name: gain + step for name, gain in gains.items()}, {}) for step in (-1.0, 1.0)
    )
    simulated = [smaller] * 90 + [larger] * 9
    result = auditor.audit(simulated)
    assert result.simulations == 99
    assert {x.p_value for x in result.attributes} == {0.1}
    assert not result.changes
    assert "\np: of 99 logs simulated under the knowledge\n" in format_audit(result)
    assert "simulated" not in format_audit(auditor.audit())


@pytest.mark.slow  # 99 audits
def test_swapped_knowledge_is_refuted_by_simulated_logs(tmp_path):
    """Of 200 people; no simulated log has such a gain."""
    people, done = log_people(tmp_path / "log", load_domain("intention", preset="low"), 200), list[int]()
    result = audit_people(
        people, simulations=MIN_SIMULATIONS, seed=1, simulated=lambda n, total: done.append(n)
    )
    assert done == 2 * list(range(MIN_SIMULATIONS + 1))  # as stated, and with the changed numbers
    (intention,) = [x for x in result.attributes if x.name == "intention"]
    assert intention.p_value == pytest.approx(0.01)
    assert result.changes


def test_intervals_follow_from_the_errors_in_simulated_logs(tmp_path):
    """Errors between -3 and 1 standard errors: the interval reaches 1 below and 3 above the estimate."""
    auditor, _ = simulate(log_museum(tmp_path / "log"))
    keys = auditor._list_keys(())
    errors = np.linspace(-3, 1, 39)  # the first and the last of 39 are the quantiles .025 and .975
    simulated = [SimulatedFits(auditor.measure_gains(), dict.fromkeys(keys, x)) for x in errors]
    by_name = {x.name: x for x in auditor.audit(simulated, simulated).numbers if x.interval is not None}
    for x in auditor.audit().numbers:
        if x.interval is None:
            continue
        low, high = logit(by_name[x.name].interval)
        spread = (logit(x.interval[1]) - logit(x.interval[0])) / 2 / Z95
        assert low == pytest.approx(logit(x.estimate) - spread)
        assert high == pytest.approx(logit(x.estimate) + 3 * spread)


def test_changed_numbers_of_a_case_without_a_rest_sum_exactly(tmp_path):
    auditor, _ = simulate(log_museum(tmp_path / "log"))
    (own,) = [group for name, group in auditor._groups.items() if name == "group"]
    program = auditor._fits.write_program(auditor._fits.fit(own))
    numbers = [program.statements[i].number.value for i in own]
    np.testing.assert_allclose([float(x) for x in numbers], auditor._fits.fit(own).estimates)
    assert Reasoner(program).posterior("group", {}).probabilities.sum() == pytest.approx(1)


def test_what_cannot_be_simulated_is_named(tmp_path):
    log = tmp_path / "log"
    write_log(log, "paper", 60, 6, soft=True)
    people = read_people(log)
    with pytest.raises(DataError, match="20 simulations; expected 0, or at least 99"):
        audit_people(people, simulations=20)
    with pytest.raises(DataError, match="a sense gives likelihoods, so its labels cannot be simulated again"):
        audit_people(people, simulations=MIN_SIMULATIONS)


@pytest.mark.slow  # 100 logs of 300 people, each with one simulated log
def test_gains_of_right_knowledge_are_those_of_simulated_logs(tmp_path):
    """One simulation for each log gives the distribution under all estimated rates together.

    Source: Giacomini, Politis and White, "A warp-speed method for conducting Monte Carlo experiments
    involving bootstrap estimators", Econometric Theory 29(3), 2013.
    """
    domain, gains, simulated = load_domain("intention"), list[dict[str, float]](), list[dict[str, float]]()
    for seed in range(100):
        log = tmp_path / f"{seed}"
        options = ComparisonOptions(
            strategies(["LCORPP"]), trials=300, seed=70_000 + seed, log=log, cache=find_cache_folder()
        )
        compare_strategies(domain, options)
        auditor, _ = simulate(read_people(log))
        auditor.fit_all()
        gains.append(auditor.measure_gains())
        simulated += [own.gains for own in auditor.simulate(1, seed, lambda done, total: None)]
    for name in ("time", "location", "intention"):
        limit = np.quantile([own[name] for own in simulated], 0.95)
        share = np.mean([own[name] > limit for own in gains])
        assert share <= 0.05 + 3 * (0.05 * 0.95 / 100 * 2) ** 0.5, name  # two samples of 100


@pytest.mark.slow  # 100 logs of 500 people, each with one simulated log
def test_the_interval_of_a_wrong_number_covers(tmp_path):
    """As above, of errors: `pr(intention=interested | identity=visitor)`, stated as .5 instead of .8."""
    shipped = load_domain("intention")
    folder = tmp_path / "wrong"
    shutil.copytree(shipped.folder, folder)
    text = (folder / "knowledge.plog").read_text()
    (folder / "truth.plog").write_text(text)
    rule = "pr(intention=interested | identity=visitor)   = "
    (folder / "knowledge.plog").write_text(text.replace(rule + "0.8", rule + "0.5"))
    domain = load_domain(folder, changes={"simulation": {"truth": "truth.plog"}})
    errors, simulated = list[float](), list[float]()
    for seed in range(100):
        log = tmp_path / f"{seed}"
        options = ComparisonOptions(
            strategies(["LCORPP"]), trials=500, seed=30_000 + seed, log=log, cache=find_cache_folder()
        )
        compare_strategies(domain, options)
        auditor, _ = simulate(read_people(log))
        (place,) = [
            i for i in auditor._fits.free if "=interested | identity=visitor" in str(auditor._atom(i))
        ]
        estimate, spread = auditor._find_log_odds((place,), place)
        errors.append((estimate - logit(0.8)) / spread)
        (own,) = auditor.simulate(1, seed, lambda done, total: None, (place,))
        simulated.append(own.errors[(place,), place])
    low, high = find_limits(simulated)
    assert np.mean([low <= error <= high for error in errors]) >= 0.95 - 3 * (0.05 * 0.95 / 100 * 2) ** 0.5
    assert low < -2.2  # the errors are skewed, so that a symmetric interval covers less

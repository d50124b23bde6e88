"""Soft evidence: mixtures of records, against records that state everything and the enumeration."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.fitting import fit
from lcorpp.fitting.expectation import Expectation
from lcorpp.fitting.maximisation import Objective, climb
from lcorpp.fitting.number_model import build_number_model, list_free_numbers
from lcorpp.fitting.soft_records import SoftExpectation
from lcorpp.reasoning import Reasoner, parse_plog
from lcorpp.values import Likelihood

PROGRAM = parse_plog(
    """
    n = {1..3}. a : n. b, c : boolean. random(a). random(b). random(c). pr(a=1) = 0.2. pr(a=2) = 0.5.
    pr(b | a=1) = 0.8. pr(b | a=2) = 0.1. pr(c | b) = 0.6. pr(c | b=false) = 0.25. :- a=3, c."""
)
RECORDS = [{"b": b, "a": a} for b in ("true", "false") for a in "123"]
RECORD_INDEXES = np.array([[0, 1, 2], [3, 4, 5]])
MODEL = build_number_model(PROGRAM, list_free_numbers(PROGRAM, ()), ["a", "b"])
VALUES = MODEL.evaluate(MODEL.start)
STATED_RECORDS = Expectation(MODEL, RECORDS, np.ones(6))


def test_a_certain_likelihood_is_a_record() -> None:
    soft = SoftExpectation(
        STATED_RECORDS, RECORD_INDEXES, np.array([[0, 1, 0], [0, 0, 1.0]]), np.array([3, 4.0])
    )
    hard = Expectation(MODEL, [RECORDS[1], RECORDS[5]], np.array([3, 4.0]))
    found, expected = soft.compute(VALUES), hard.compute(VALUES)
    assert found.log_p == pytest.approx(expected.log_p)
    assert found.counts == pytest.approx(expected.counts)
    assert found.repeats == pytest.approx(expected.repeats)
    assert found.log_likelihood == pytest.approx(expected.log_likelihood)


def test_likelihoods_weigh_the_values_as_a_reasoner_does() -> None:
    weights = np.array([[0.2, 1, 0.5], [1, 0, 0.3]])
    soft = SoftExpectation(STATED_RECORDS, RECORD_INDEXES, weights, np.ones(2))
    reasoner = Reasoner(PROGRAM)
    for b, own, shares in zip(("true", "false"), weights, soft.compute_shares(VALUES), strict=True):
        posterior = reasoner.posterior("a", {"b": b, "a": Likelihood(("1", "2", "3"), own)})
        assert shares == pytest.approx(posterior.probabilities)


def test_given_facts_condition_the_likelihood() -> None:
    weights, repeats = np.array([[0.2, 1, 0.5], [1, 0, 0.3]]), np.array([3, 4.0])
    given = SoftExpectation(STATED_RECORDS, RECORD_INDEXES, weights, repeats, given=True)
    reasoner = Reasoner(PROGRAM)
    posteriors = [reasoner.posterior("a", {"b": b}).probabilities for b in ("true", "false")]
    expected = sum(n * np.log(w @ p) for n, w, p in zip(repeats, weights, posteriors, strict=True))
    assert given.compute(VALUES).log_likelihood == pytest.approx(expected)


@pytest.mark.parametrize("given", [False, True])
def test_sums_of_counts_are_derivatives_and_those_of_the_records(given: bool) -> None:
    weights = np.array([[0.2, 1, 0.5], [1, 0, 0.3]])
    soft = SoftExpectation(STATED_RECORDS, RECORD_INDEXES, weights, np.array([3, 4.0]), given=given)
    expected = soft.compute(VALUES)
    log_likelihood, counts = soft.sum_counts(VALUES)
    assert log_likelihood == pytest.approx(expected.log_likelihood)
    assert counts == pytest.approx(expected.counts @ expected.repeats)
    assert (counts >= 0).all()
    scores = MODEL.coefficients.T @ (counts / VALUES)
    for i in range(len(MODEL.start)):
        step = np.eye(len(MODEL.start))[i] * 1e-6
        ahead, behind = (soft.sum_counts(MODEL.evaluate(MODEL.start + s))[0] for s in (step, -step))
        assert scores[i] == pytest.approx((ahead - behind) / 2e-6, rel=1e-5)


def test_an_ascent_with_given_facts_reaches_a_maximum() -> None:
    weights = np.array([[0.2, 1, 0.5], [1, 0.1, 0.3], [0.9, 0.1, 0.4]])
    soft = SoftExpectation(
        STATED_RECORDS, RECORD_INDEXES[[0, 1, 0]], weights, np.array([30, 40, 20.0]), given=True
    )
    objective = Objective(MODEL, soft, 5.0)
    best = climb(objective, MODEL.start)
    assert best.converged
    rng = np.random.default_rng(0)
    for _ in range(20):
        near = np.clip(best.parameters + rng.normal(0, 0.01, len(MODEL.start)), 0.01, 0.99)
        assert objective.evaluate(near)[0] < best.objective


def test_a_restricted_model_fits_as_with_fixed_numbers() -> None:
    program = parse_plog(
        "n = {1..3}. a : n. b : boolean. random(a). random(b). pr(a=1) = 0.2. pr(a=2) = 0.5.\n"
        "pr(b | a=1) = 0.7. pr(b | a=2) = 0.4."
    )
    records = [{"b": "true", "a": "1"}] * 6 + [{"b": "false"}] * 9 + [{"b": "true"}] * 4
    model = build_number_model(program, list_free_numbers(program, ()), ["a", "b"])
    first, *_ = model.statements
    line = program.statements[first].at.line
    own = [i for i in model.statements if program.statements[i].at.line == line]
    assert len(own) == 2
    restricted = model.restrict(own)
    distinct = [{"b": "true", "a": "1"}, {"b": "false"}, {"b": "true"}]
    soft = Expectation(model, distinct, np.array([6, 9, 4.0]))
    end = climb(Objective(restricted, soft, 1.0), model.start)
    expected = fit(program, records, prior=1, fixed=[program.statements[model.statements[-1]].at.line])
    assert end.parameters[:2] == pytest.approx([float(x.value) for x in expected.numbers], abs=1e-5)
    assert end.parameters[2:] == pytest.approx(model.start[2:])
    single = climb(Objective(model.restrict(own[:1]), soft, 1.0), model.start)
    assert single.parameters[1:] == pytest.approx(model.start[1:])
    assert single.parameters[0] != pytest.approx(model.start[0], abs=0.01)

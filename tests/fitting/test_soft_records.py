"""Soft evidence: mixtures of records, against records that state everything and the enumeration."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.fitting.expectation import Expectation
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


def test_scores_are_derivatives() -> None:
    soft = SoftExpectation(
        STATED_RECORDS, RECORD_INDEXES, np.array([[0.2, 1, 0.5], [1, 0, 0.3]]), np.array([3, 4.0])
    )
    expected = soft.compute(VALUES)
    scores = MODEL.coefficients.T @ (expected.counts @ expected.repeats / VALUES)
    for i in range(len(MODEL.start)):
        step = np.eye(len(MODEL.start))[i] * 1e-6
        ahead, behind = (soft.compute(MODEL.evaluate(MODEL.start + s)).log_likelihood for s in (step, -step))
        assert scores[i] == pytest.approx((ahead - behind) / 2e-6, rel=1e-5)

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import Policy, Solution, evaluate, parse_pomdp, solve
from lcorpp.planning.evaluation import budget
from lcorpp.planning.evaluation.certificate import certificate
from tests.planning.models import LCORPP, TIGER
from tests.planning.policies import back_up

LISTENED = np.array([[0.5, 0.5], [0.85, 0.15], [0.15, 0.85], [0.97, 0.03], [0.03, 0.97]])
"""Beliefs reached by listening."""

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


def claim(pomdp, policy, lower, upper):
    return Solution(pomdp, policy, lower, upper, 1.0, "time limit", (), 0, 0)


@pytest.mark.parametrize("pomdp", [tiger, lcorpp], ids=["tiger", "the authors' model"])
def test_backed_up_vectors_are_confirmed(pomdp):
    policy = back_up(pomdp, 8)
    found = certificate(claim(pomdp, policy, policy.value(pomdp.start), 1000.0))
    assert (found.verdict, found.certain) == ("confirmed", True)
    assert found.evaluation.lower >= policy.value(pomdp.start) - found.tolerance
    assert "verdict: confirmed: the policy's value reaches the claimed lower bound (tolerance" in found.text
    assert "exact evaluation on all reachable beliefs" in found.text


@pytest.mark.parametrize("pomdp", [tiger, lcorpp], ids=["tiger", "the authors' model"])
def test_sarsop_solutions_are_confirmed(pomdp):
    found = certificate(solve(pomdp, precision=1e-3, time_limit=10))
    assert (found.verdict, found.certain) == ("confirmed", True)


def test_a_missing_vector_is_detected():
    # the value of listening depends on the vectors that open
    policy = back_up(tiger, 8, LISTENED)
    best = int((policy.vectors @ tiger.start).argmax())
    torn = Policy.of(tiger, policy.vectors[[best]], policy.actions[[best]])
    found = certificate(claim(tiger, torn, policy.value(tiger.start), 1000.0))
    assert (found.verdict, found.certain) == ("refuted", True)
    assert (
        "the policy's value is below the claimed lower bound; the largest loss is in belief {" in found.reason
    )
    assert "where the vector of 'listen' has value" in found.reason


def test_crossed_bounds_and_a_low_upper_bound():
    policy = back_up(tiger, 8)
    value = policy.value(tiger.start)
    crossed = certificate(claim(tiger, policy, value, value - 1))
    assert (crossed.verdict, crossed.reason) == ("refuted", "the upper bound is below the lower bound")
    low = certificate(claim(tiger, policy, -200.0, -100.0))
    assert (low.verdict, low.reason) == ("refuted", "the policy's value is above the claimed upper bound")
    above = certificate(claim(tiger, policy, value + 1, value + 2))
    assert above.verdict == "refuted"
    assert "largest loss" not in above.reason  # the vectors do not claim this value


def test_trials_decide_if_there_are_too_many_beliefs():
    policy = back_up(lcorpp, 8)
    value = policy.value(lcorpp.start)
    few = {"max_nodes": 2, "trials": 300}
    fine = certificate(claim(lcorpp, policy, value - 5, 1000.0), **few)
    assert (fine.verdict, fine.certain) == ("confirmed", False)
    assert "with confidence 99%" in fine.reason
    assert "300 trials beyond 1 computed beliefs" in fine.text
    wrong = certificate(claim(lcorpp, policy, value + 5, 1000.0), **few)
    assert (wrong.verdict, wrong.certain) == ("refuted", False)
    unsure = certificate(claim(lcorpp, policy, value - 5, 1000.0), max_nodes=2, trials=0)
    assert unsure.verdict == "open"
    assert "more trials or beliefs could decide" in unsure.text


def test_another_start_has_its_own_claims():
    policy = back_up(tiger, 8, LISTENED)
    start = LISTENED[3]
    found = certificate(claim(tiger, policy, 0.0, 1.0), start)
    assert (found.lower, found.upper) == (policy.value(start), np.inf)
    assert found.verdict == "confirmed"

    class Flat:
        def value(self, belief):
            return 30.0

    bounded = claim(tiger, replace(policy, upper_bound=Flat()), 0.0, 1.0)
    assert certificate(bounded, start).upper == 30


def test_the_tolerance_is_positive():
    with pytest.raises(ModelError, match="the tolerance must be positive, not 0"):
        certificate(claim(tiger, back_up(tiger, 1), 0.0, 1.0), tolerance=0)


def test_a_limit_is_part_of_the_check():
    policy = back_up(lcorpp, 8)
    found = certificate(claim(lcorpp, policy, policy.value(lcorpp.start) - 5, 1000.0), memory_limit=1.0)
    assert found.evaluation.stopped == "memory limit"
    assert re.search(r"memory limit after .* s, the beliefs cover 0% of the discounted future", found.text)


def test_a_busy_machine_decides_nothing(monkeypatch):
    """A limit counts CPU time, and only after 100 beliefs: here the clock passes it at each reading."""
    times = itertools.count(step=1e6)
    monkeypatch.setattr(budget, "thread_time", lambda: float(next(times)))
    found = certificate(solve(tiger, precision=1e-3))
    assert (found.verdict, found.certain, found.evaluation.complete) == ("confirmed", True, True)
    skewed = parse_pomdp(TIGER.replace("0.15 0.85", "0.2 0.8"))  # listening reaches very many beliefs
    limited = evaluate(skewed, Policy.of(skewed, np.zeros((1, 2)), [0]), trials=0, time_limit=1.0)
    assert limited.stopped == "time limit"
    assert 100 <= limited.beliefs < 1000

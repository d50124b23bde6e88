from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning import Policy, Pomdp, parse_pomdp
from lcorpp.planning.evaluation.mdp import mdp_value_bounds
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from tests.planning.models import LCORPP, TIGER, pomdps
from tests.planning.policies import backed_up, blind, earned, policies

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)
LISTEN = Policy.of(tiger, [[0.0, 0.0]], [0])


def test_listening_for_ever():
    found = evaluate(tiger, LISTEN, precision=1e-3)
    assert found.exact
    assert found.lower <= -20 <= found.upper
    assert found.upper - found.lower <= 1e-3


def test_opening_at_once():
    # the door pays -45 on average, and puts everything back
    found = evaluate(tiger, Policy.of(tiger, [[0.0, 0.0]], [1]), precision=1e-9)
    assert found.complete
    assert found.exact
    assert found.interval.estimate == pytest.approx(-45 / 0.05)
    assert (found.beliefs, found.trials, found.interval.confidence) == (1, 0, 1.0)
    assert "value -900 to -900 (1 beliefs)" in found.summary()


def test_reporting_at_once():
    # of the five states two pay 80 and two -80; then nothing more is paid
    found = evaluate(lcorpp, Policy.of(lcorpp, [[0.0] * 5], [3]), precision=1e-9)
    assert (found.complete, found.exact) == (True, True)
    assert found.interval.estimate == pytest.approx(0)
    start = [0, 1, 0, 0, 0]
    assert evaluate(lcorpp, Policy.of(lcorpp, [[0.0] * 5], [3]), start).interval.estimate == pytest.approx(
        -80
    )


@given(pomdps(discounts=(0.5,)), st.data())
@settings(max_examples=40, deadline=None)
def test_the_bounds_hold_what_all_histories_earn(pomdp, data):
    policy = data.draw(policies(pomdp))
    steps = 5
    beyond = 0.5**steps * float(np.abs(pomdp.reward).max()) / 0.5
    exact = earned(pomdp, policy, steps)
    found = evaluate(pomdp, policy, precision=1e-6, max_nodes=300, trials=0)
    assert found.lower - beyond - 1e-9 <= exact <= found.upper + beyond + 1e-9
    assert found.exact == (found.upper - found.lower <= 1e-6 + 1e-9)


@given(pomdps(discounts=(0.8, 0.95)), st.data())
@settings(max_examples=15, deadline=None)
def test_what_blind_policies_earn_is_a_linear_system(pomdp, data):
    a = data.draw(st.integers(0, len(pomdp.actions) - 1))
    found = evaluate(pomdp, Policy.of(pomdp, [[0.0] * len(pomdp.states)], [a]), precision=1e-4, trials=0)
    exact = float(blind(pomdp)[a] @ pomdp.start)
    assert found.lower <= exact <= found.upper


@given(pomdps(), st.data())
@settings(max_examples=30, deadline=None)
def test_the_range_holds_every_policy(pomdp, data):
    low, high = mdp_value_bounds(pomdp)
    value = np.zeros(len(pomdp.states))
    for _ in range(400):
        value = (pomdp.reward + pomdp.discount * np.asarray(pomdp.transition) @ value).max(axis=0)
    # 400 sweeps leave .95**400 of the range of rewards ahead, 2e-9 of at most 134
    assert (high >= value - 1e-6).all()
    assert high == pytest.approx(value, abs=2e-4 * max(1.0, float(np.ptp(pomdp.reward)) * 20))
    for vector in blind(pomdp):
        assert (low <= vector + 1e-9).all()
        assert (vector <= high + 1e-9).all()


def test_few_beliefs_leave_bounds_and_an_estimate():
    policy = backed_up(lcorpp, 8)
    exact = evaluate(lcorpp, policy, precision=1e-7)
    assert exact.exact
    for seed in range(3):
        found = evaluate(lcorpp, policy, precision=1e-7, max_nodes=2, trials=400, confidence=0.999, seed=seed)
        assert not found.exact
        assert (found.trials, found.interval.confidence) == (400, 0.999)
        assert found.lower < exact.interval.estimate < found.upper
        assert found.interval.low <= exact.interval.estimate <= found.interval.high
        assert found.interval.high - found.interval.low < 0.2 * (found.upper - found.lower)
    assert "99.9% interval" in found.summary()
    assert "not all" in found.summary()


def test_the_estimate_is_right_whatever_the_vectors_promise():
    doors = Policy.of(tiger, [[7.0, 7.0], [-70.0, 30.0], [30.0, -70.0]], [0, 1, 2])
    exact = evaluate(tiger, doors, precision=1e-7)
    assert exact.exact
    found = evaluate(tiger, doors, precision=1e-7, max_nodes=1, trials=1_500, confidence=0.9999)
    assert found.trials == 1_500
    assert found.interval.low <= exact.interval.estimate <= found.interval.high
    again = evaluate(tiger, doors, precision=1e-7, max_nodes=1, trials=1_500, confidence=0.9999)
    assert again.interval == found.interval


def test_vectors_that_back_each_other_leave_the_estimate_no_noise():
    # listening for ever earns -20 everywhere: a promise that is the truth explains all there is
    listen = Policy.of(tiger, [[-20.0, -20.0]], [0])
    found = evaluate(tiger, listen, precision=1e-9, max_nodes=2, trials=10)
    assert (found.interval.low, found.interval.high) == pytest.approx((-20, -20), abs=1e-7)


def test_where_a_promise_is_broken():
    boast = Policy.of(tiger, [[50.0, 50.0], [-100.0, 10.0]], [0, 1])
    loss = evaluate(tiger, boast, precision=1e-3).shortfall
    assert loss.belief == pytest.approx([0.5, 0.5])
    assert (loss.action, loss.vector_value) == (0, pytest.approx(50))
    assert loss.backup_value == pytest.approx(-1 + 0.95 * 50)


def test_a_long_way_is_walked_to_its_end():
    S = 700
    ahead = np.eye(S, k=1)
    ahead[-1, -1] = 1
    walk = Pomdp(
        tuple(f"s{i}" for i in range(S)), ("go", "stay"), ("o",), [ahead, np.eye(S)], np.ones((2, S, 1)),
        [np.arange(S) % 7, np.zeros(S)], 0.999, np.eye(S)[0],
    )  # fmt: skip
    found = evaluate(walk, Policy.of(walk, np.zeros((1, S)), [0]), precision=1e-4)
    exact = (np.arange(S) % 7) @ 0.999 ** np.arange(S) + 0.999**S * ((S - 1) % 7) / 0.001
    assert (found.exact, found.complete, found.beliefs) == (True, True, S)
    assert found.interval.estimate == pytest.approx(exact)


@pytest.mark.parametrize(
    "changes",
    [{"precision": 0.0}, {"confidence": 1.0}, {"max_nodes": 0}, {"trials": -1}, {"trials": 3}],
)
def test_numbers_out_of_range(changes):
    with pytest.raises(ModelError, match="must be positive"):
        evaluate(tiger, LISTEN, **changes)


def test_a_policy_for_another_model():
    with pytest.raises(PolicyError, match="another model"):
        evaluate(lcorpp, LISTEN)

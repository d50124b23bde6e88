from __future__ import annotations

import itertools
import signal

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning import Policy, Pomdp, parse_pomdp
from lcorpp.planning.evaluation import budget
from lcorpp.planning.evaluation.mdp import mdp_value_bounds
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from tests.planning.models import LCORPP, TIGER, pomdps
from tests.planning.policies import back_up, blind_values, enumerate_reward, policies

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)
LISTEN = Policy.of(tiger, [[0.0, 0.0]], [0])


def test_value_of_listening_for_ever_is_minus_20():
    found = evaluate(tiger, LISTEN, precision=1e-3)
    assert found.exact
    assert found.lower <= -20 <= found.upper
    assert found.upper - found.lower <= 1e-3


def test_a_policy_with_one_belief_is_evaluated_exactly():
    # a door has reward -45 on average and resets the problem
    found = evaluate(tiger, Policy.of(tiger, [[0.0, 0.0]], [1]), precision=1e-9)
    assert found.complete
    assert found.exact
    assert found.interval.estimate == pytest.approx(-45 / 0.05)
    assert (found.beliefs, found.trials, found.interval.confidence) == (1, 0, 1.0)
    assert "value -900 to -900 (1 beliefs)" in found.summary()


def test_an_absorbing_belief_ends_the_evaluation():
    # two of the five states have reward 80, two -80; then all rewards are 0
    report = Policy.of(lcorpp, [[0.0] * 5], [3])
    found = evaluate(lcorpp, report, precision=1e-9)
    assert (found.complete, found.exact) == (True, True)
    assert found.interval.estimate == pytest.approx(0)
    assert evaluate(lcorpp, report, [0, 1, 0, 0, 0]).interval.estimate == pytest.approx(-80)


@given(pomdps(discounts=(0.5,)), st.data())
@settings(max_examples=6)
def test_the_bounds_bracket_the_value_by_all_histories(pomdp, data):
    policy = data.draw(policies(pomdp))
    steps = 5
    beyond = 0.5**steps * float(np.abs(pomdp.reward).max()) / 0.5
    exact = enumerate_reward(pomdp, policy, steps)
    found = evaluate(pomdp, policy, precision=1e-6, max_nodes=300, trials=0)
    assert found.lower - beyond - 1e-9 <= exact <= found.upper + beyond + 1e-9
    assert found.exact == (found.upper - found.lower <= 1e-6 + 1e-9)


@given(pomdps(discounts=(0.8, 0.95)), st.data())
@settings(max_examples=6)
def test_blind_policies_agree_with_a_linear_system(pomdp, data):
    a = data.draw(st.integers(0, len(pomdp.actions) - 1))
    found = evaluate(pomdp, Policy.of(pomdp, [[0.0] * len(pomdp.states)], [a]), precision=1e-4, trials=0)
    exact = float(blind_values(pomdp)[a] @ pomdp.start)
    assert found.lower <= exact <= found.upper


@given(pomdps(), st.data())
@settings(max_examples=15)
def test_mdp_bounds_bracket_every_policy(pomdp, data):
    low, high = mdp_value_bounds(pomdp)
    value = np.zeros(len(pomdp.states))
    for _ in range(400):
        value = (pomdp.reward + pomdp.discount * np.asarray(pomdp.transition) @ value).max(axis=0)
    # the error after 400 sweeps is .95**400 of the range of returns: 2e-9 of at most 134
    assert (high >= value - 1e-6).all()
    assert high == pytest.approx(value, abs=2e-4 * max(1.0, float(np.ptp(pomdp.reward)) * 20))
    for vector in blind_values(pomdp):
        assert (low <= vector + 1e-9).all()
        assert (vector <= high + 1e-9).all()


def test_few_beliefs_leave_bounds_and_an_estimate():
    policy = back_up(lcorpp, 8)
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


def test_the_estimate_does_not_rely_on_the_vectors():
    doors = Policy.of(tiger, [[7.0, 7.0], [-70.0, 30.0], [30.0, -70.0]], [0, 1, 2])
    exact = evaluate(tiger, doors, precision=1e-7)
    assert exact.exact
    found, again = (
        evaluate(tiger, doors, precision=1e-7, max_nodes=1, trials=1_500, confidence=0.9999) for _ in range(2)
    )
    assert found.trials == 1_500
    assert found.interval.low <= exact.interval.estimate <= found.interval.high
    assert again.interval == found.interval


def test_exact_vectors_remove_all_variance():
    # always listening has value -20 everywhere: exact vectors explain all variance
    listen = Policy.of(tiger, [[-20.0, -20.0]], [0])
    found = evaluate(tiger, listen, precision=1e-9, max_nodes=2, trials=10)
    assert (found.interval.low, found.interval.high) == pytest.approx((-20, -20), abs=1e-7)


def test_the_shortfall_of_wrong_vectors():
    boast = Policy.of(tiger, [[50.0, 50.0], [-100.0, 10.0]], [0, 1])
    loss = evaluate(tiger, boast, precision=1e-3).shortfall
    assert loss.belief == pytest.approx([0.5, 0.5])
    assert (loss.action, loss.vector_value) == (0, pytest.approx(50))
    assert loss.backup_value == pytest.approx(-1 + 0.95 * 50)


def test_a_long_path_is_expanded_completely():
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


@pytest.fixture
def clock(monkeypatch):
    """Clock that advances by one second at each reading."""
    times = itertools.count()
    monkeypatch.setattr(budget, "thread_time", lambda: float(next(times)))


def test_the_bounds_hold_at_any_time_limit(clock):
    """Truncated trials contribute bounds on their remaining reward."""
    doors = Policy.of(tiger, [[7.0, 7.0], [-70.0, 30.0], [30.0, -70.0]], [0, 1, 2])
    exact = evaluate(tiger, doors, precision=1e-7).interval.estimate
    numbers = {"precision": 1e-9, "max_nodes": 1, "trials": 100, "confidence": 0.9999}
    cut_off = 0
    for seconds in range(1, 40):
        found = evaluate(tiger, doors, **numbers, time_limit=seconds)
        assert found.lower <= exact <= found.upper
        assert found.interval.low <= exact <= found.interval.high
        assert 0 <= found.coverage < 1
        cut_off += found.stopped == "time limit" and found.trials > 0
    assert cut_off > 5


def test_enough_time_changes_nothing(clock):
    policy = back_up(lcorpp, 8)
    free, limited = (
        evaluate(lcorpp, policy, precision=1e-9, max_nodes=3, trials=100, time_limit=seconds)
        for seconds in (np.inf, 1e9)
    )
    assert limited.interval == free.interval
    assert (limited.trials, limited.stopped) == (100, "")


def test_the_memory_limit_ends_the_expansion():
    policy = back_up(lcorpp, 8)
    found = evaluate(lcorpp, policy, precision=1e-9, memory_limit=1.0, trials=0)
    assert (found.beliefs, found.complete, found.stopped) == (0, False, "memory limit")
    with pytest.raises(ModelError, match="memory_limit 0 must be positive"):
        evaluate(lcorpp, policy, memory_limit=0)


def test_ctrl_c_returns_what_is_established():
    calls = []

    def interrupt(share, text):
        calls.append(text)
        signal.raise_signal(signal.SIGINT)

    policy = back_up(lcorpp, 8)
    exact = evaluate(lcorpp, policy, precision=1e-7)
    found = evaluate(lcorpp, policy, precision=1e-9, trials=100, interruptible=True, callback=interrupt)
    assert (found.stopped, len(calls)) == ("interrupted", 1)
    assert found.lower <= exact.interval.estimate <= found.upper
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_second_ctrl_c_raises():
    def interrupt(share, text):
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        evaluate(lcorpp, back_up(lcorpp, 8), precision=1e-9, interruptible=True, callback=interrupt)


def test_by_default_ctrl_c_raises_so_that_callers_see_it():
    def interrupt(share, text):
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        evaluate(lcorpp, back_up(lcorpp, 8), precision=1e-9, callback=interrupt)


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

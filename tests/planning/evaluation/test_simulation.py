from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning import Policy, Pomdp, parse_pomdp, update
from lcorpp.planning.evaluation import rollout
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.evaluation.simulation import mean_interval, simulate
from tests.planning.models import LCORPP, TIGER, pomdps, shared_model
from tests.planning.policies import back_up, enumerate_reward, policies

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


def agrees(found, exact):
    """Whether a mean is within five standard errors of the exact value; it fails once in two million."""
    return abs(found.mean - exact) <= 5 * found.standard_deviation / len(found.returns) ** 0.5 + 1e-9


@pytest.mark.parametrize(("pomdp", "rounds"), [(tiger, 6), (lcorpp, 8)], ids=["tiger", "the authors' model"])
def test_the_mean_is_the_exact_value(pomdp, rounds):
    policy = back_up(pomdp, rounds)
    exact = evaluate(pomdp, policy, precision=1e-6)
    assert exact.exact
    found = simulate(pomdp, policy, trials=20_000, steps=300, seed=1)
    assert agrees(found, exact.interval.estimate)
    low, high = found.interval.low, found.interval.high
    assert low < found.mean < high
    assert high - low == pytest.approx(2 * 1.96 * found.standard_deviation / 20_000**0.5, rel=1e-3)


def test_the_mean_is_the_exact_value_of_a_published_model():
    from lcorpp.planning import read_pomdp

    pomdp = read_pomdp(shared_model("4x3.95.pomdp"))
    policy = back_up(pomdp, 5)
    exact = evaluate(pomdp, policy, precision=1e-3)
    assert exact.exact
    found = simulate(pomdp, policy, trials=20_000, steps=200, seed=2)
    assert agrees(found, exact.interval.estimate)


@given(pomdps(discounts=(0.5, 0.95)), st.data())
@settings(max_examples=12, derandomize=True)
def test_the_mean_agrees_with_all_histories(pomdp, data):
    policy = data.draw(policies(pomdp))
    found = simulate(pomdp, policy, trials=4_000, steps=4, seed=3)
    assert agrees(found, enumerate_reward(pomdp, policy, 4))


@given(pomdps(), st.data())
@settings(max_examples=12)
def test_a_trace_follows_model_and_policy(pomdp, data):
    policy = data.draw(policies(pomdp))
    found = simulate(pomdp, policy, trials=12, steps=6, seed=data.draw(st.integers(0, 99)), traces=12)
    T, Z = pomdp.transition, pomdp.observation
    assert len(found.traces) == 12
    for trace, value, length in zip(found.traces, found.returns, found.lengths, strict=True):
        steps = len(trace.actions)
        assert (len(trace.states), len(trace.observations), steps) == (steps + 1, steps, length)
        belief, total = pomdp.start, 0.0
        assert pomdp.start[trace.states[0]] > 0
        for t in range(steps):
            s, a, after, o = (
                int(x)
                for x in (trace.states[t], trace.actions[t], trace.states[t + 1], trace.observations[t])
            )
            # rounding decides between tied vectors
            promises = policy.vectors @ belief
            assert promises[policy.actions == a].max() > promises.max() - 1e-9
            assert T[a, s, after] > 0
            assert Z[a, after, o] > 0
            assert trace.rewards[t] == pomdp.reward[a, s]
            total += pomdp.discount**t * trace.rewards[t]
            belief = update(pomdp, belief, a, o)
        assert value == pytest.approx(total)


def test_the_result_does_not_depend_on_blocks(monkeypatch):
    policy = Policy.of(tiger, [[0.0, 0.0], [-9999.0, 10.0], [10.0, -9999.0]], [0, 1, 2])  # listens often
    whole = simulate(tiger, policy, trials=300, steps=20, seed=5, traces=3)
    monkeypatch.setattr(rollout, "MAX_BLOCK_TRIALS", 64)
    monkeypatch.setattr(rollout, "MAX_GRAPH_SIZE", 10)  # the graph is cleared at each step
    parts = simulate(tiger, policy, trials=300, steps=20, seed=5, traces=3)
    assert parts.beliefs > whole.beliefs
    assert np.array_equal(whole.returns, parts.returns)
    assert np.array_equal(whole.lengths, parts.lengths)
    assert whole.rewards == pytest.approx(parts.rewards)
    for one, other in zip(whole.traces, parts.traces, strict=True):
        assert np.array_equal(one.states, other.states)
        assert np.array_equal(one.observations, other.observations)
    few = simulate(tiger, policy, trials=100, steps=20, seed=5)
    assert np.array_equal(few.returns, whole.returns[:100])
    assert not np.array_equal(simulate(tiger, policy, trials=100, steps=20, seed=6).returns, few.returns)


def test_a_trial_stops_if_no_rewards_remain():
    # report at once: -80 or 80, then `term`, where this policy's action has no cost
    report = Policy.of(lcorpp, [[0.0] * 5], [3])
    found = simulate(lcorpp, report, trials=2_000, steps=50, seed=0)
    assert set(found.lengths.tolist()) == {1}
    assert set(found.returns.tolist()) <= {-80.0, 0.0, 80.0}
    assert (found.unfinished, found.truncation) == (0, (0.0, 0.0))
    assert found.rewards[0] == pytest.approx(found.mean)
    assert not found.rewards[1:].any()


def test_truncation_is_reported():
    listen = Policy.of(tiger, [[0.0, 0.0]], [0])
    found = simulate(tiger, listen, trials=10, steps=3, seed=0)
    assert found.returns == pytest.approx(-(1 + 0.95 + 0.95**2))
    assert (found.unfinished, found.steps) == (10, 30)
    assert found.active_share.tolist() == [1, 1, 1]
    assert found.rewards.tolist() == [-1, -1, -1]
    # the exact value, -20, is within the truncation bounds
    assert found.mean + found.truncation[0] <= -20 <= found.mean + found.truncation[1]
    assert "10 trials, 30 steps" in found.summary()
    assert "discounted reward -2.8525 (95% confidence: -2.8525 to -2.8525)" in found.summary()


def test_simulation_starts_at_the_given_belief():
    certain = Policy.of(tiger, [[0.0, 0.0]], [2])
    found = simulate(tiger, certain, trials=50, steps=1, seed=0, start=[1.0, 0.0])
    assert (found.returns == 10).all()


def test_a_single_trial_has_no_interval():
    listen = Policy.of(tiger, [[0.0, 0.0]], [0])
    found = simulate(tiger, listen, trials=1, steps=1, seed=0)
    assert (found.interval.low, found.interval.high) == (-np.inf, np.inf)
    assert np.isnan(found.standard_deviation)
    three = mean_interval(np.array([1.0, 2.0, 3.0]))  # Student's t of two degrees: 4.303
    assert (three.low, three.high) == pytest.approx((2 - 4.3027 / 3**0.5, 2 + 4.3027 / 3**0.5), rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"trials": 0}, "trials is a whole number from 1, not 0"),
        ({"steps": 2.5}, "steps is a whole number from 1, not 2.5"),
        ({"traces": -1}, "traces is a whole number from 0, not -1"),
        ({"start": [0.5, 0.6]}, "is not a distribution"),
        ({"seed": -3}, "a seed is a whole number from 0, not -3"),
    ],
)
def test_bad_arguments(changes, words):
    listen = Policy.of(tiger, [[0.0, 0.0]], [0])
    with pytest.raises(ModelError, match=words):
        simulate(tiger, listen, **{"seed": 0, **changes})


def test_a_policy_for_another_model():
    with pytest.raises(PolicyError, match="another model"):
        simulate(lcorpp, Policy.of(tiger, [[0.0, 0.0]], [0]), seed=0)


def test_the_upper_limit_holds_if_the_rewards_are_too_rare_to_occur():
    """A reward of 1000 with probability .001: in few trials its interval is [0, 0], below the value 1."""
    rare = Pomdp(
        ("prize", "nothing"), ("take",), ("o",), [[[0, 1], [0, 1]]], np.ones((1, 2, 1)), [[1000, 0]], 0.5,
        [1e-3, 1 - 1e-3],
    )  # fmt: skip
    policy = Policy.of(rare, [[0, 0]], [0])
    few = simulate(rare, policy, trials=50, steps=1, seed=2)
    assert few.interval.high == 0
    assert few.upper_limit(0.95) > 1
    limits = [simulate(rare, policy, trials=n, steps=1, seed=1).upper_limit(0.999) for n in (10_000, 100_000)]
    assert 1 < limits[1] < limits[0] < 10
    assert simulate(rare, policy, trials=1, steps=1, seed=1).upper_limit(0.95) == np.inf


def test_the_upper_limit_includes_the_truncation():
    tiger = parse_pomdp(TIGER)
    listen = Policy.of(tiger, [[-20, -20]], [0])  # each trial has the same rewards
    short, long = (simulate(tiger, listen, trials=100, steps=steps, seed=1) for steps in (1, 400))
    spread = 110 * (1 - 0.95**400) / 0.05
    assert long.spread == pytest.approx(spread)
    assert long.upper_limit(0.95) == pytest.approx(-20 + 7 * spread * np.log(40) / 297, rel=1e-4)
    assert short.truncation[1] == pytest.approx(190)
    assert short.upper_limit(0.95) == pytest.approx(-1 + 7 * 110 * np.log(40) / 297 + 190)

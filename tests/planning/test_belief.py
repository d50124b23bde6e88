from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError, ObservationError
from lcorpp.planning import check_belief, observation_probabilities, parse_pomdp, update
from lcorpp.planning.belief import update_many
from tests.planning.models import LCORPP, TIGER, pomdps

tiger, lcorpp = parse_pomdp(TIGER), parse_pomdp(LCORPP)


def test_update_after_one_reading_of_the_tiger():
    assert update(tiger, tiger.start, 0, 0) == pytest.approx([0.85, 0.15])


def test_an_impossible_observation_names_everything():
    with pytest.raises(ObservationError) as caught:
        update(lcorpp, np.array([0.22, 0.78, 0, 0, 0]), 0, 2)
    for part in ("'none'", "'move_forward'", "not_interested_away 0.78, interested_away 0.22"):
        assert part in str(caught.value)


@given(pomdps())
@settings(max_examples=15)
def test_update_is_bayes_rule(pomdp):
    T, Z, b = pomdp.transition, pomdp.observation, pomdp.start
    S = range(len(pomdp.states))
    for a in range(len(pomdp.actions)):
        chances = observation_probabilities(pomdp, b, a)
        assert chances.sum() == pytest.approx(1)
        for o, chance in enumerate(chances):
            joint = [Z[a, t, o] * sum(T[a, s, t] * b[s] for s in S) for t in S]
            assert chance == pytest.approx(sum(joint))
            if sum(joint) == 0:
                with pytest.raises(ObservationError):
                    update(pomdp, b, a, o)
            else:
                after = update(pomdp, b, a, o)
                assert after.sum() == pytest.approx(1)
                assert after == pytest.approx(np.array(joint) / sum(joint))


@given(pomdps(), st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_many_updates_are_those_of_single_beliefs(pomdp, seed):
    rng = np.random.default_rng(seed)
    beliefs = rng.dirichlet(np.ones(len(pomdp.states)), size=5)
    each = range(len(pomdp.actions))
    chances = np.array([[observation_probabilities(pomdp, b, a) for a in each] for b in beliefs])
    rows, actions, observations = np.nonzero(chances > 1e-300)
    after = update_many(pomdp, beliefs[rows], actions, observations)
    for belief, row, a, o in zip(after, rows, actions, observations, strict=True):
        assert belief == pytest.approx(update(pomdp, beliefs[row], a, o), rel=1e-14, abs=0)


def test_an_impossible_observation_among_many_is_that_of_its_belief():
    beliefs = np.array([[0, 0, 0.5, 0.5, 0], [0.22, 0.78, 0, 0, 0]])
    with pytest.raises(ObservationError) as single:
        update(lcorpp, beliefs[1], 0, 2)
    with pytest.raises(ObservationError) as many:
        update_many(lcorpp, beliefs, np.array([0, 0]), np.array([0, 2]))
    assert str(many.value) == str(single.value)


@pytest.mark.parametrize("belief", [[1.0], [0.5, 0.4], [1.5, -0.5], [float("nan"), 1.0], ["a", "b"]])
def test_invalid_beliefs(belief):
    with pytest.raises(ModelError):
        check_belief(tiger, belief)

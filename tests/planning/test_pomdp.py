from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import parse_pomdp
from lcorpp.planning.pomdp import check_size
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)


def test_lookups_know_the_names():
    assert (tiger.state_index("tiger-right"), tiger.action_index("open-left")) == (1, 1)
    assert tiger.observation_index("tiger-left") == 0
    with pytest.raises(
        ModelError, match="unknown action 'sing'; expected one of listen, open-left, open-right"
    ):
        tiger.action_index("sing")


def test_a_bad_row_is_named():
    table = tiger.observation.copy()
    table[0, 0] = 0.85, 0.10
    with pytest.raises(ModelError, match=r"observation row for 'listen', 'tiger-left' sums to 0\.95, not 1"):
        replace(tiger, observation=table)


def test_a_negative_probability_is_named():
    table = tiger.transition.copy()
    table[1, 1] = -0.5, 1.5
    with pytest.raises(ModelError, match=r"transition row for 'open-left', 'tiger-right' has a negative"):
        replace(tiger, transition=table)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"discount": 1.0}, "discount 1 is refused"),
        ({"discount": 0.0}, "discount 0 is not between 0 and 1"),
        ({"discount": float("nan")}, "discount nan"),
        ({"start": np.array([0.5, 0.4])}, "the start belief is not a distribution"),
        ({"start": np.array([1.0])}, r"start has shape \(1,\), not \(2,\)"),
        ({"reward": np.full((3, 2), np.inf)}, "reward holds a number that is not finite"),
        ({"states": ("a", "a")}, "states have the name 'a' twice"),
        ({"actions": ()}, "a POMDP needs actions"),
    ],
)
def test_broken_laws(change, message):
    with pytest.raises(ModelError, match=message):
        replace(tiger, **change)


def test_a_huge_model_is_refused_with_its_size():
    with pytest.raises(ModelError, match=r"29\.8 GiB"):
        check_size(20_000, 10, 5)


def test_tables_are_frozen_copies():
    table = tiger.reward.copy()
    model = replace(tiger, reward=table)
    table[:] = 0
    assert model.reward.min() == -100
    with pytest.raises(ValueError, match="read-only"):
        model.reward[0, 0] = 1


def test_the_fingerprint_sees_numbers_but_not_the_start():
    assert replace(tiger, start=np.array([1.0, 0.0])).fingerprint == tiger.fingerprint
    assert replace(tiger, reward=tiger.reward + 1).fingerprint != tiger.fingerprint
    assert replace(tiger, states=("a", "b")).fingerprint != tiger.fingerprint

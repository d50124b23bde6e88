from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.errors import ModelError
from lcorpp.planning import Pomdp, SparseTables, parse_pomdp, solve, update
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)


def test_lookup_errors_list_the_names():
    assert (tiger.state_index("tiger-right"), tiger.action_index("open-left")) == (1, 1)
    assert tiger.observation_index("tiger-left") == 0
    with pytest.raises(
        ModelError, match="unknown action 'sing'; expected one of listen, open-left, open-right"
    ):
        tiger.action_index("sing")


def test_a_bad_row_is_named():
    table = tiger.observation.dense.copy()
    table[0, 0] = 0.85, 0.10
    with pytest.raises(ModelError, match=r"observation row for 'listen', 'tiger-left' sums to 0\.95, not 1"):
        replace(tiger, observation=table)


def test_a_negative_probability_is_named():
    table = tiger.transition.dense.copy()
    table[1, 1] = -0.5, 1.5
    with pytest.raises(ModelError, match=r"transition row for 'open-left', 'tiger-right' has a negative"):
        replace(tiger, transition=table)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"discount": 1.1}, "discount 1.1 is not between 0 and 1"),
        ({"discount": -0.1}, "discount -0.1 is not between 0"),
        ({"discount": float("nan")}, "discount nan"),
        ({"start": np.array([0.5, 0.4])}, "the start belief is not a distribution"),
        ({"start": np.array([1.0])}, r"start has shape \(1,\), not \(2,\)"),
        ({"reward": np.full((3, 2), np.inf)}, "reward contains a number that is not finite"),
        ({"states": ("a", "a")}, "states have the name 'a' twice"),
        ({"actions": ()}, "a POMDP needs actions"),
    ],
)
def test_invalid_models(change, message):
    with pytest.raises(ModelError, match=message):
        replace(tiger, **change)


@pytest.mark.parametrize("field", ["transition", "observation"])
def test_a_number_that_is_not_finite(field):
    table = getattr(tiger, field).dense.copy()
    table[0, 0, 0] = np.nan
    with pytest.raises(ModelError, match=f"{field} contains a number that is not finite"):
        replace(tiger, **{field: table})
    with pytest.raises(ModelError, match=rf"{field} has shape \(3, 1, 2\), not \(3, 2, 2\)"):
        replace(tiger, **{field: table[:, :1]})


def test_tables_are_frozen_copies():
    table = tiger.reward.copy()
    model = replace(tiger, reward=table)
    table[:] = 0
    assert model.reward.min() == -100
    with pytest.raises(ValueError, match="read-only"):
        model.reward[0, 0] = 1


def test_the_fingerprint_ignores_the_start():
    assert replace(tiger, start=np.array([1.0, 0.0])).fingerprint == tiger.fingerprint
    assert replace(tiger, reward=tiger.reward + 1).fingerprint != tiger.fingerprint
    assert replace(tiger, states=("a", "b")).fingerprint != tiger.fingerprint


def test_thirty_thousand_states():
    """A ring, without any dense table."""
    size = 30_000
    ring = (np.arange(size + 1), np.roll(np.arange(size), -1), np.ones(size))
    pomdp = Pomdp(
        tuple(map(str, range(size))),
        ("on",),
        ("seen",),
        SparseTables((1, size, size), *ring),
        SparseTables((1, size, 1), np.arange(size + 1), np.zeros(size), np.ones(size)),
        np.ones((1, size)),
        0.9,
        np.eye(1, size)[0],
    )
    after = update(pomdp, pomdp.start, 0, 0)
    assert np.flatnonzero(after).tolist() == [1]
    solution = solve(pomdp, precision=1e-3, time_limit=30)
    assert solution.lower == pytest.approx(10, abs=1e-3)
    with pytest.raises(ModelError, match=r"takes 6\.7 GiB; the limit is 2 GiB"):
        _ = pomdp.transition.dense

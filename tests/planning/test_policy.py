from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import PolicyError
from lcorpp.planning import AlphaVectors, Policy, parse_pomdp
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)
policy = Policy.of(tiger, [[0.0, 0.0], [-100.0, 10.0], [10.0, -100.0]], [0, 1, 2])


def test_action_and_value_are_those_of_the_best_vector():
    assert (policy.action(np.array([0.5, 0.5])), policy.value(np.array([0.5, 0.5]))) == (0, 0.0)
    assert (policy.action(np.array([0.0, 1.0])), policy.value(np.array([0.0, 1.0]))) == (1, 10.0)


@pytest.mark.parametrize("chunk", [1, 7, 1_000_000])
def test_actions_at_many_beliefs_are_those_at_each(chunk, monkeypatch):
    monkeypatch.setattr("lcorpp.planning.policy.MAX_CHUNK_NUMBERS", chunk)
    beliefs = np.random.default_rng(1).dirichlet([0.2, 0.2], size=50)
    sets = [AlphaVectors([i], [[0.0], [1.0 - i]], [0, 1 + i]) for i in (0, 1)]
    for each in (policy, Policy.of_sets(tiger, sets)):
        actions = [each.action(belief) for belief in beliefs]
        assert len(set(actions)) > 1
        assert each.actions_at(beliefs).tolist() == actions


def test_actions_at_beliefs_of_several_supports_are_those_at_each():
    """Ten states, more than a byte has bits; a belief is covered by several sets, by one or by none."""
    rng = np.random.default_rng(2)
    names = tuple(f"s{i}" for i in range(10))
    parts = [[0, 1, 8], [1, 8, 9], list(range(10)), [5]]
    sets = [AlphaVectors(part, rng.normal(size=(4, len(part))), rng.permutation(4)) for part in parts]
    beliefs = np.zeros((200, 10))
    for belief in beliefs:
        support = rng.choice(10, rng.integers(1, 4), replace=False)
        belief[support] = rng.dirichlet(np.ones(len(support)))
    for chosen in (sets, sets[:2]):
        several = Policy(tuple(chosen), names, ("a", "b", "c", "d"), floor=-0.5)
        actions = [several.action(belief) for belief in beliefs]
        assert set(actions) == {0, 1, 2, 3}
        assert several.actions_at(beliefs).tolist() == actions
    assert several.actions_at(beliefs[:0]).tolist() == []


@pytest.mark.parametrize(
    ("vectors", "actions"),
    [
        ([[1.0]], [0]),
        ([[1.0, 2.0]], [3]),
        ([[1.0, 2.0]], [-1]),
        ([[1.0, 2.0]], [0, 1]),
        (np.zeros((0, 2)), []),
    ],
)
def test_invalid_vectors_or_actions_raise_errors(vectors, actions):
    with pytest.raises(PolicyError):
        Policy.of(tiger, vectors, actions)

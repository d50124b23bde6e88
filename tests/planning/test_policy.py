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

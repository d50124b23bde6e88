from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import PolicyError
from lcorpp.planning import Policy, parse_pomdp
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)
policy = Policy.of(tiger, [[0.0, 0.0], [-100.0, 10.0], [10.0, -100.0]], [0, 1, 2])


def test_action_and_value_are_those_of_the_best_vector():
    assert (policy.action(np.array([0.5, 0.5])), policy.value(np.array([0.5, 0.5]))) == (0, 0.0)
    assert (policy.action(np.array([0.0, 1.0])), policy.value(np.array([0.0, 1.0]))) == (1, 10.0)


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

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning import Planner, Policy, parse_pomdp
from tests.planning.models import LCORPP, TIGER

tiger = parse_pomdp(TIGER)
policy = Policy.of(tiger, [[0.0, 0.0], [-100.0, 10.0], [10.0, -100.0]], [0, 1, 2])


def test_the_best_vector_decides():
    assert (policy.action(np.array([0.5, 0.5])), policy.value(np.array([0.5, 0.5]))) == (0, 0.0)
    assert (policy.action(np.array([0.0, 1.0])), policy.value(np.array([0.0, 1.0]))) == (1, 10.0)


def test_the_planner_uses_names():
    planner = Planner(policy, tiger)
    assert planner.action(planner.start) == "listen"
    belief = planner.update(planner.start, "listen", "tiger-right")
    assert belief == pytest.approx([0.15, 0.85])
    with pytest.raises(ModelError, match="unknown observation 'roar'; expected one of tiger-left"):
        planner.update(belief, "listen", "roar")


def test_a_planner_refuses_a_policy_for_another_model():
    with pytest.raises(PolicyError, match="another model"):
        Planner(policy, parse_pomdp(LCORPP))
    with pytest.raises(PolicyError, match="have changed since"):
        Planner(policy, parse_pomdp(TIGER.replace("-1\n", "-2\n")))


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
def test_invalid_policies(vectors, actions):
    with pytest.raises(PolicyError):
        Policy.of(tiger, vectors, actions)

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning import Planner, Policy, parse_pomdp, read_policy, solve, write_policy
from tests.planning.models import LCORPP, TIGER

tiger = parse_pomdp(TIGER)
policy = Policy.of(tiger, [[0.0, 0.0], [-100.0, 10.0], [10.0, -100.0]], [0, 1, 2])


def test_a_solution_is_enough_to_act():
    solution = solve(tiger)
    planner = Planner(solution)
    assert planner.pomdp is tiger
    assert planner.action(planner.start) == "listen"
    assert planner.action(np.array([0.99, 0.01])) == "open-right"


def test_a_policy_from_a_file_needs_its_model(tmp_path):
    write_policy(policy, tmp_path / "tiger.policy")
    read = read_policy(tmp_path / "tiger.policy", tiger)
    assert Planner(read, tiger).action(np.array([0.0, 1.0])) == "open-left"
    with pytest.raises(PolicyError, match=r"needs its model: Planner\(policy, pomdp\)"):
        Planner(read)


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

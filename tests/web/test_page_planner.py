"""The planner of a page's decision: its actions where they are as good as the policy's, and no others."""

import numpy as np
import pytest

from lcorpp.planning import Planner, Policy, parse_pomdp
from lcorpp.web.page_planner import PagePlanner
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)
LEFT, RIGHT = tiger.action_index("open-left"), tiger.action_index("open-right")
# The first action is best by rounding where both are equally good.
policy = Policy.of(tiger, [[10.0, -100.0], [-100.0, 10.0]], [LEFT, RIGHT])


@pytest.mark.parametrize(
    ("belief", "named", "expected"),
    [
        ([0.5, 0.5], "open-right", "open-right"),
        ([0.5, 0.5], "open-left", "open-left"),
        ([0.5 + 1e-10, 0.5 - 1e-10], "open-right", "open-right"),
        ([0.5 + 1e-6, 0.5 - 1e-6], "open-right", "open-left"),
        ([0.5, 0.5], "listen", "open-left"),
        ([0.5, 0.5], "constructor", "open-left"),
    ],
)
def test_only_equally_good_actions_are_those_of_the_page(belief, named, expected):
    planner = PagePlanner(Planner(policy, tiger), [named])
    assert planner.action(np.array(belief)) == expected
    assert planner.action(np.array(belief)) == "open-left"  # after the page's actions the policy's


def test_the_value_of_an_action_is_that_of_its_best_vector():
    belief = np.array([0.3, 0.7])
    assert policy.value_of_action(belief, LEFT) == pytest.approx(0.3 * 10 - 0.7 * 100)
    assert policy.value_of_action(belief, RIGHT) == pytest.approx(policy.value(belief))
    assert policy.value_of_action(belief, tiger.action_index("listen")) == -np.inf

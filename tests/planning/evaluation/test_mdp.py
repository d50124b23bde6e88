from __future__ import annotations

import numpy as np
from hypothesis import given, settings

from lcorpp.planning import parse_pomdp
from lcorpp.planning.evaluation.mdp import find_self_loop_classes, zero_reward_states
from tests.planning.models import LCORPP, TIGER, pomdps


def test_a_state_with_costs_has_further_rewards():
    charging = parse_pomdp(LCORPP)
    assert not zero_reward_states(charging).any()
    free = "".join(f"R: {a} : term : * : * 0\n" for a in ("move_forward", "greet", "turn"))
    assert np.flatnonzero(zero_reward_states(parse_pomdp(LCORPP + free))).tolist() == [4]
    assert not zero_reward_states(parse_pomdp(TIGER)).any()


def test_reports_in_the_terminal_state_are_self_loops():
    shown = find_self_loop_classes(parse_pomdp(LCORPP))
    assert (shown[3:, 4] >= 0).all()
    assert (shown[:, :4] == -1).all()
    assert (shown[:3, 4] == -1).all()  # these actions have a cost


@given(pomdps())
@settings(max_examples=15)
def test_zero_reward_states_reach_no_reward(pomdp):
    step = (np.asarray(pomdp.transition) > 0).any(axis=0)
    reach = np.linalg.matrix_power(step | np.eye(len(step), dtype=bool), len(step)) > 0
    pays = (pomdp.reward != 0).any(axis=0)
    assert zero_reward_states(pomdp).tolist() == [not (row & pays).any() for row in reach]

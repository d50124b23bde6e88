"""The gap of a solution as a share of what planning gains."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lcorpp.planning import parse_pomdp, solve
from lcorpp.planning.evaluation.gap_share import compute_gap_share
from tests.planning.models import TIGER


def test_the_gap_of_the_tiger_is_compared_with_listening_for_ever():
    solution = solve(parse_pomdp(TIGER))  # the value is 19.37, that of always listening -1 / (1 - .95) = -20
    open_gap = replace(solution, upper=solution.lower + 3.937)
    assert compute_gap_share(open_gap) == pytest.approx(0.1, abs=1e-3)


def test_there_is_no_share_where_planning_gains_nothing():
    pomdp = parse_pomdp(
        TIGER.replace("R:open-right : tiger-right : * : * -100", "R:open-right : * : * : * 10")
    )
    solution = solve(pomdp)  # opening the right door is always the best action
    assert compute_gap_share(replace(solution, upper=solution.lower + 1)) is None

"""Models that several planning tests share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import strategies as st

from lcorpp.planning import Pomdp

SHARED = Path(__file__).parents[3] / "shared" / "pomdp"

TIGER = """\
# the tiger problem
discount: 0.95
values: reward
states: tiger-left tiger-right
actions: listen open-left open-right
observations: tiger-left tiger-right
start: 0.5 0.5
T:listen
identity
T:open-left
uniform
T:open-right
uniform
O:listen
0.85 0.15
0.15 0.85
O:open-left
uniform
O:open-right
uniform
R:listen : * : * : * -1
R:open-left : tiger-left : * : * -100
R:open-left : tiger-right : * : * 10
R:open-right : tiger-left : * : * 10
R:open-right : tiger-right : * : * -100
"""

# The model the LCORPP authors solved, with the slip of their file: a person who has turned but is not
# interested answers `pos` to move_forward with .9.
LCORPP = """\
discount: 0.99
values: reward
states: interested_away not_interested_away interested_turned not_interested_turned term
actions: move_forward greet turn report_interested report_not_interested
observations: pos neg none
start: uniform
T: * : * : term 1
T: move_forward
identity
T: greet
identity
T: turn
.1 0 .9 0 0
0 .1 0 .9 0
0 0 1 0 0
0 0 0 1 0
0 0 0 0 1
O: * : * : none 1
O: move_forward
.9 .1 0
.1 .9 0
.9 .1 0
.9 .1 0
0 0 1
O: greet
.8 .2 0
.2 .8 0
.8 .2 0
.2 .8 0
0 0 1
O: turn : interested_turned
.9 .1 0
O: turn : not_interested_turned
.1 .9 0
R: move_forward : * : * : * -4
R: greet : * : * : * -2
R: turn : * : * : * -4.5
R: report_interested : interested_away : * : * 80
R: report_interested : interested_turned : * : * 80
R: report_interested : not_interested_away : * : * -80
R: report_interested : not_interested_turned : * : * -80
R: report_not_interested : interested_away : * : * -80
R: report_not_interested : interested_turned : * : * -80
R: report_not_interested : not_interested_away : * : * 80
R: report_not_interested : not_interested_turned : * : * 80
"""


def shared_model(name: str) -> Path:
    """Return a published model; skip the test if the folder beside the checkout is missing."""
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"the published model {name} is not beside this checkout")
    return path


def _row(size: int) -> st.SearchStrategy[list[float]]:
    weights = st.lists(st.integers(0, 5), min_size=size, max_size=size).filter(any)
    return weights.map(lambda w: (np.array(w) / sum(w)).tolist())


@st.composite
def pomdps(draw: st.DrawFn, discounts: tuple[float, ...] = (0.5, 0.8, 0.95)) -> Pomdp:
    """Small random models, with many zeros."""
    S, A, obs = draw(st.integers(1, 3)), draw(st.integers(1, 3)), draw(st.integers(1, 3))
    table = st.lists(st.lists(st.integers(-10, 10), min_size=S, max_size=S), min_size=A, max_size=A)
    return Pomdp(
        tuple(f"s{i}" for i in range(S)),
        tuple(f"a{i}" for i in range(A)),
        tuple(f"o{i}" for i in range(obs)),
        np.array([[draw(_row(S)) for _ in range(S)] for _ in range(A)]),
        np.array([[draw(_row(obs)) for _ in range(S)] for _ in range(A)]),
        np.array(draw(table), dtype=float) / 3,
        draw(st.sampled_from(discounts)),
        np.array(draw(_row(S))),
    )


DOOR = """discount: 0.95
values: reward
states: left right over
actions: listen open_left open_right
observations: l r
start: 0.5 0.5 0
T: listen
identity
T: open_left : * : over 1
T: open_right : * : over 1
O: listen
0.8 0.2
0.2 0.8
1 0
O: open_left : * : l 1
O: open_right : * : l 1
R: listen : * : * : * -1
R: open_left : left : * : * 10
R: open_left : right : * : * -20
R: open_right : right : * : * 10
R: open_right : left : * : * -20
R: * : over : * : * 0
"""
"""A person behind one of two doors; a report ends the decision."""

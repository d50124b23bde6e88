"""Recursive components with linear rules: reachability on maps whose doors may be closed."""

from __future__ import annotations

from fractions import Fraction

import pytest

from lcorpp.reasoning import Program, Reasoner, parse_plog
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions import transition_system
from lcorpp.reasoning.transitions.closure import Closure
from lcorpp.reasoning.transitions.transition_system import build_transition_system

OPEN = Fraction(9, 10)


def make_map(doors: list[tuple[int, int]]) -> Program:
    """Room 1 is reached, each door is open with 9/10, both ways."""
    facts = " ".join(f"door({i},{j})." for i, j in doors)
    return parse_plog(f"""
        room = {{1..{max(map(max, doors))}}}. #domain room(R; Q). door, open : room, room -> boolean.
        reach : room -> boolean. {facts} [r(R,Q)] random(open(R,Q)) :- door(R,Q).
        [r(R,Q)] pr(open(R,Q)) = 9/10. reach(1).
        reach(Q) :- reach(R), open(R,Q). reach(R) :- reach(Q), open(R,Q).
        reach(R) = false :- not reach(R).""")


def make_grid(rows: int, columns: int) -> list[tuple[int, int]]:
    rooms = [[i * columns + j + 1 for j in range(columns)] for i in range(rows)]
    right = [(row[j], row[j + 1]) for row in rooms for j in range(columns - 1)]
    return right + [(rooms[i][j], rooms[i + 1][j]) for i in range(rows - 1) for j in range(columns)]


CYCLE = [(1, 2), (2, 3), (3, 4), (1, 4)]


@pytest.mark.parametrize(
    ("doors", "room", "answer"),
    [
        ([(i, i + 1) for i in range(1, 30)], 30, OPEN**29),
        (CYCLE, 3, 1 - (1 - OPEN**2) ** 2),  # two ways of two doors
        (CYCLE, 2, 1 - (1 - OPEN) * (1 - OPEN**3)),
        (make_grid(3, 3), 9, Fraction("0.972502171407")),  # the sum over 2^12 worlds
    ],
)
def test_known_answers(doors, room, answer):
    reasoner = Reasoner(make_map(doors))
    assert reasoner.exact(f"reach({room})", {})["true"] == answer
    circuit = reasoner.compile([f"open({i},{j})" for i, j in doors[:3]], f"reach({room})")
    assert circuit({})["true"] == pytest.approx(float(answer), rel=1e-12)


def test_conditions_on_several_rooms():
    reasoner = Reasoner(make_map([(i, i + 1) for i in range(1, 9)]))
    assert reasoner.exact("reach(8)", {"reach(6)": "true"})["true"] == OPEN**2
    assert reasoner.exact("reach(3)", {"reach(8)": "false", "reach(5)": "true"})["true"] == 1
    assert reasoner.exact("open(2,3)", {"reach(4)": "false"})["true"] == (OPEN - OPEN**3) / (1 - OPEN**3)


def test_the_states_depend_on_the_frontier_only():
    system = build_transition_system(
        ground_program(make_map([(i, i + 1) for i in range(1, 300)]), {}), ["reach(300)"]
    )
    assert any(transition.closures for transition in system.transitions)
    assert max(build_decision_diagram(system).sizes) <= 4
    doors = make_grid(4, 4)
    shuffled = [(17 - i if i > 1 else 16, 17 - j if j > 1 else 16) for i, j in reversed(doors)]
    sizes = [
        max(
            build_decision_diagram(
                build_transition_system(ground_program(make_map(own), {}), [f"reach({to})"])
            ).sizes
        )
        for own, to in ((doors, 16), (shuffled, 1))
    ]
    assert max(sizes) <= 100  # of 2^24


def test_worlds_have_the_values_of_all_terms():
    (world,) = Reasoner(make_map(CYCLE)).compile([], "reach(3)").most_probable({})
    assert world.measure == OPEN**4
    assert [world.values[f"reach({i})"] for i in (1, 2, 3, 4)] == ["true"] * 4
    (world,) = (
        Reasoner(make_map(CYCLE)).compile(["reach(3)"], "reach(3)").most_probable({"reach(3)": "false"})
    )
    reached = {i for i in range(1, 5) if world.values[f"reach({i})"] == "true"}
    opened = {door for door in CYCLE if world.values["open({},{})".format(*door)] == "true"}
    assert 3 not in reached
    assert {(i in reached) == (j in reached) for i, j in opened} == {True}


def test_a_large_frontier_is_decided_as_a_whole(monkeypatch):
    program = make_map(make_grid(2, 3))
    answer = Reasoner(program).exact("reach(6)", {})
    monkeypatch.setattr(transition_system, "MAX_FRONTIER", 1)
    system = build_transition_system(ground_program(program, {}), ["reach(6)"])
    assert not any(transition.closures for transition in system.transitions)
    assert Reasoner(program).exact("reach(6)", {}) == answer


def test_the_closure_forgets_what_has_left_the_frontier():
    """Atom 2 follows from 1 (bit 1), 3 from 2 (bit 2), 1 is true (bit 4); then atom 2 leaves."""
    closure = Closure(
        4,
        closed=[(4, 0, 1)],
        added=[(1, 1, 2), (2, 2, 3)],
        targets=[(4, 0, 1), (8, 0, 3), (1, 1, 3), (2, 3, 1)],
    )
    assert [closure.apply(state) for state in (0b000, 0b001, 0b011, 0b100, 0b101, 0b111)] == [
        0, 0, 0b0001, 0b0100, 0b0100, 0b1100
    ]  # fmt: skip
    assert closure.apply(0b10000 | 0b011) == 0b10000 | 0b0001  # other bits stay

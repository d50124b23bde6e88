"""Recursive components with linear rules: reachability on maps whose doors may be closed."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import inf, prod

import pytest

from lcorpp.reasoning import Program, Reasoner, parse_plog
from lcorpp.reasoning._diagram import CompiledTransition
from lcorpp.reasoning.diagram.decision_diagram import build_decision_diagram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.transitions import recursion_order
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
    system = build_transition_system(ground_program(program, {}), ["reach(6)"], max_frontier=1)
    assert not any(transition.closures for transition in system.transitions)
    monkeypatch.setattr(recursion_order, "order_terms", lambda terms, *_: (inf, list(terms)))
    assert Reasoner(program).exact("reach(6)", {}) == answer


def test_a_term_that_is_read_leaves_the_frontier():
    """Evidence on each room of a corridor, and a lamp in each: the states do not grow with the rooms."""
    lamps = """
        lamp, on : room -> boolean. [p(R)] random(on(R)). [p(R)] pr(on(R)) = 4/10.
        lamp(R) :- reach(R), on(R)."""
    sizes = []
    for n in (10, 40):
        program = parse_plog(str(make_map([(i, i + 1) for i in range(1, n)])) + lamps)
        terms = [f"lamp({i})" for i in range(1, n + 1)]
        system = build_transition_system(ground_program(program, {}), terms)
        sizes.append(max(build_decision_diagram(system).sizes))
        reasoner = Reasoner(program)
        assert reasoner.exact(f"reach({n})", {terms[n // 2]: "true"})["true"] == (OPEN ** (n - 1 - n // 2))
    assert sizes[0] == sizes[1] <= 8


def test_people_who_influence_each_other():
    """The sum over the 2^9 worlds in which person 1 is prone to asthma."""
    program = parse_plog("""
        person = {1..3}. #domain person(X; Y). influences : person, person -> boolean.
        stress, smokes, prone, asthma : person -> boolean.
        [s(X)] random(stress(X)). [s(X)] pr(stress(X)) = 3/10. [p(X)] random(prone(X)).
        [p(X)] pr(prone(X)) = 4/10.
        [i(X,Y)] random(influences(X,Y)) :- X != Y. [i(X,Y)] pr(influences(X,Y)) = 2/10.
        smokes(X) :- stress(X). smokes(X) :- influences(Y,X), smokes(Y), X != Y.
        asthma(X) :- smokes(X), prone(X). smokes(X) = false :- not smokes(X).""")
    totals = {True: Fraction(0), False: Fraction(0)}
    pairs = [(x, y) for x in (1, 2, 3) for y in (1, 2, 3) if x != y]
    for coins in product((True, False), repeat=9):
        smoke = {x for x in (1, 2, 3) if coins[x - 1]}
        for _ in range(2):
            smoke |= {
                y for (x, y), influences in zip(pairs, coins[3:], strict=True) if influences and x in smoke
            }
        numbers = [Fraction(3, 10)] * 3 + [Fraction(2, 10)] * 6
        if {1, 2} <= smoke:
            totals[3 in smoke] += prod(p if coin else 1 - p for p, coin in zip(numbers, coins, strict=True))
    evidence = {"asthma(1)": "true", "smokes(2)": "true"}
    found = Reasoner(program).exact("smokes(3)", evidence)
    assert found["true"] == totals[True] / (totals[True] + totals[False])


def apply(closure, state):
    """Apply a closure to a state by a transition whose outcome changes nothing else."""
    transition = CompiledTransition(1, bytes(8), [], [])
    closure.compile_into(transition)
    effect = transition.add_effect(bytes(8), bytes(8), bytes(8), b"")
    after = transition.advance(state.to_bytes(8, "little"), effect)
    return None if after is None else int.from_bytes(after, "little")


def test_the_closure_forgets_what_has_left_the_frontier():
    """Atom 2 follows from 1 (bit 1), 3 from 2 (bit 2), 1 is true (bit 4); then atom 2 leaves."""
    closure = Closure(
        closed=[(4, 0, 1)],
        added=[(1, 1, 2), (2, 2, 3)],
        targets=[(4, 0, 1), (8, 0, 3), (1, 1, 3), (2, 3, 1)],
        false=4,
        n_atoms=5,
        goals=[],
    )
    assert [apply(closure, state) for state in (0b000, 0b001, 0b011, 0b100, 0b101, 0b111)] == [
        0, 0, 0b0001, 0b0100, 0b0100, 0b1100
    ]  # fmt: skip
    assert apply(closure, 0b10000 | 0b011) == 0b10000 | 0b0001  # other bits stay


def test_the_closure_keeps_the_goals_that_imply_the_others():
    """Atoms 1 to 3 may become true; 4 follows from 1 or 2 (bits 1, 2) and is a goal (bit 4), as is 3 (8)."""
    closure = Closure(
        closed=[(1, 1, 4), (2, 2, 4)],
        added=[(4, 4, 6), (8, 3, 7), (16, 2, 5), (32, 3, 4)],
        targets=[],
        false=5,
        n_atoms=8,
        goals=[{1: 1, 2: 2, 3: 4}, {1: 8, 2: 16, 3: 32}],
    )
    assert apply(closure, 0b000011) == 0  # no goal
    assert apply(closure, 0b000111) == 0b011
    assert apply(closure, 0b001111) == 0b100011  # 3 is the larger mask
    assert apply(closure, 0b101111) == 0b100  # 4 follows from 3
    assert apply(closure, 0b010111) == 0b001  # 2 implies a contradiction
    assert apply(closure, 0b000100) is None
    assert apply(closure, 0b010110) is None

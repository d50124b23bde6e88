"""Recursive components: cycles with and without random terms, odd and even loops, stratified negation."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, product

import pytest

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Reasoner, parse_plog

GRID = """
x = {{1..{n}}}.
blocked, reached : x, x -> boolean.
random(blocked(X,Y)). pr(blocked(X,Y)) = 1/4.
reached(1,1) :- not blocked(1,1).
reached(X+1,Y) :- reached(X,Y), not blocked(X+1,Y).
reached(X-1,Y) :- reached(X,Y), not blocked(X-1,Y).
reached(X,Y+1) :- reached(X,Y), not blocked(X,Y+1).
reached(X,Y-1) :- reached(X,Y), not blocked(X,Y-1).
arrived : boolean. arrived :- reached({n},{n}). arrived=false :- not arrived.
"""


def connected(n: int, blocked: set[tuple[int, int]]) -> bool:
    """Whether the last cell of a grid is reached from the first, by breadth-first search."""
    seen = {(1, 1)} - blocked
    edge = list(seen)
    while edge:
        x, y = edge.pop()
        for cell in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if cell not in seen and cell not in blocked and 0 < min(cell) <= max(cell) <= n:
                seen.add(cell)
                edge.append(cell)
    return (n, n) in seen


def test_reachability_against_search():
    """A deterministic recursive component: the cells reach each other."""
    cells = list(product((1, 2, 3), repeat=2))
    chance = Fraction(0)
    for k in range(10):
        found = sum(connected(3, set(blocked)) for blocked in combinations(cells, k))
        chance += found * Fraction(1, 4) ** k * Fraction(3, 4) ** (9 - k)
    circuit = Reasoner(parse_plog(GRID.format(n=3))).compile(["blocked"], "arrived")
    assert circuit.exact({})["true"] == chance
    middle = {f"blocked({x},{y})": "true" for x, y in [(2, 2), (1, 2), (2, 3)]}
    assert circuit.exact(middle)["true"] == Fraction(3, 4) ** 5  # one way is left, of five cells
    assert circuit(middle | {"blocked(3,2)": "true"})["true"] == 0.0


@pytest.mark.parametrize(
    ("rules", "query", "evidence"),
    [
        ("p=false :- not p=false, q.", "q", {}),  # contradicts itself, so that no world has q
        ("p :- q. p=false :- not p.", "p", {"q": "false"}),  # a default is not a contradiction
    ],
)
def test_a_term_that_depends_on_itself(rules, query, evidence):
    circuit = Reasoner(parse_plog(f"p, q : boolean. random(q). {rules}")).compile(["q"], query)
    assert circuit.exact(evidence) == {"true": 0, "false": 1}


def test_even_loop_counts_each_stable_model():
    program = parse_plog("a, b, q : boolean. random(q). a :- not b, q. b :- not a, q.")
    circuit = Reasoner(program).compile([], "q")
    assert circuit.exact({}) == {"true": Fraction(2, 3), "false": Fraction(1, 3)}  # two worlds have q
    with pytest.raises(ProgramError, match=r"b has no value with probability 2/3; ask for b=value instead"):
        Reasoner(program).compile([], "b").exact({})


def test_random_terms_in_a_static_cycle_that_is_acyclic_in_each_world():
    program = parse_plog(
        "first, a, b : boolean. random(first). random(a) :- first. random(b) :- first, a. b=false :- first,"
        " a=false. random(b) :- first=false. random(a) :- first=false, b. a=false :- first=false, b=false."
        " pr(b | first, a) = 3/4. pr(a | first=false, b) = 1/4."
    )
    found = Reasoner(program).compile(["first"], ["a", "b"])
    assert [found.exact({"first": "true"})[q]["true"] for q in "ab"] == [Fraction(1, 2), Fraction(3, 8)]
    assert [found.exact({"first": "false"})[q]["true"] for q in "ab"] == [Fraction(1, 8), Fraction(1, 2)]
    assert found({})["a"]["true"] == 5 / 16


def test_a_cycle_without_any_world():
    program = parse_plog(
        "s = {u}. p : boolean. x : s. no : s -> boolean. random(x : {X : no(X)}). p :- p, x=u."
    )
    with pytest.raises(UndefinedError):
        Reasoner(program).compile([], "p")({})


def test_terms_with_a_shared_default():
    """Both derived values share their template, and the second has another term than the first."""
    reasoner = Reasoner(
        parse_plog("""
        n = {1..3}. #domain n(N). p : n -> boolean. s : boolean. random(s). pr(s) = 3/10.
        p(1) :- s. p(2) :- p(1). p(3) :- p(2). p(N) = false :- not p(N).""")
    )
    assert reasoner.exact("p(3)", {}) == {"true": Fraction(3, 10), "false": Fraction(7, 10)}

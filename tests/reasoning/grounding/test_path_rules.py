"""Path rules: which rules have the form, which instances are left, and that the worlds are the same."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given, settings, strategies as st
from tests.reasoning.circuit.test_agreement import outcome

from lcorpp.reasoning import Enumeration, Reasoner, parse_plog
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.grounding.path_rules import match_path_rule
from lcorpp.reasoning.language.syntax import Rule

DECLARED = (
    "n = {1..4}. m = {1..3}. k = {a, b}. #domain m(M). way, door : n, n -> boolean. at : n, k, n -> k."
    " near : m, n -> boolean. "
)


@pytest.mark.parametrize(
    ("rule", "step"),
    [
        ("way(X,Z) :- way(X,Y), way(Y,Z).", "X,Y"),
        ("way(X,Z) :- way(Y,Z), X != Z, way(X,Y), Y != X.", "X,Y"),
        ("way(X,Y) :- way(Y,X), Y != X.", "Y,X"),
        ("at(X,S,Z)=a :- at(X,S,Y)=a, at(Y,S,Z)=a.", "X,S,Y"),
        ("at(X,S,Z)=V :- at(Z,S,X)=V.", "Z,S,X"),
        ("way(X,Z) :- way(X,Y), way(Y,Z), X < Z.", None),
        ("way(X,Z) :- way(X,Y), way(Y,Z), Y != 2.", None),
        ("way(X,Z) :- way(X,Y), way(Y,Z), door(X,Z).", None),
        ("way(X,Z) :- way(X,Y), door(Y,Z).", None),
        ("way(X,Z) :- way(X,Y), not way(Y,Z).", None),
        ("way(X,X) :- way(X,Y), way(Y,X).", None),
        ("way(X,Z) :- way(Y,X), way(Y,Z).", None),
        ("way(X,Z) :- way(X,Y), way(Y,Z)=false.", None),
        ("way(X,Z) :- way(X,M), way(M,Z).", None),  # a path may visit 4, too
        ("near(X,Z) :- near(X,Y), near(Y,Z).", None),
        ("at(X,b,Z)=a :- at(X,S,Y)=a, at(Y,S,Z)=a.", None),
        ("at(X,S,Z)=S :- at(X,S,Y)=a, at(Y,S,Z)=a.", None),
        ("way(X,Y) :- way(X,Y).", None),
        ("way(X,Y).", None),
        (":- way(X,Y).", None),
    ],
)
def test_forms(rule, step):
    program = parse_plog(f"{DECLARED}{rule}")
    (statement,) = [statement for statement in program.statements if isinstance(statement, Rule)]
    path = match_path_rule(statement, program.signature)
    assert (path and ",".join(map(str, path.step))) == step


def test_only_steps_are_joined():
    """A line of 10 places: 18 steps, 8 further places for each that are not one of its ends."""
    doors = "".join(f" door({i},{i + 1}). random(open({i},{i + 1}))." for i in range(1, 10))
    program = parse_plog(
        "n = {1..10}. door, open, way : n, n -> boolean. way(X,Y) :- door(X,Y), open(X,Y)."
        " way(X,Z) :- way(X,Y), way(Y,Z), X != Z. way(X,Y) :- way(Y,X), X != Y."
        f" way(X,Y)=false :- not way(X,Y). {doors} ?{{way(10,1)}}. ?{{way(3,5)}}."
    )
    clauses = ground_program(program, {}).clauses
    count = [sum(clause.statement == i for clause in clauses) for i, _ in enumerate(program.statements)]
    assert [
        count[i] for i, x in enumerate(program.statements) if "way" in str(x) and isinstance(x, Rule)
    ] == [
        9,
        18 * 9,
        9,
        100,
    ]
    reasoner = Reasoner(program)
    answers = [reasoner.ask(query, exact=True) for query in program.queries]
    assert answers == [Fraction(1, 2**9), Fraction(1, 4)]


@st.composite
def path_programs(draw: st.DrawFn) -> str:
    """Draw a program whose paths have random steps, guards, further rules, observations or interventions."""
    place = st.integers(1, 3)
    value, other = draw(st.sampled_from([("true", "false"), ("c", "d")]))
    lines = [
        f"n = {{1..3}}. k = {{c, d, e}}. way : n, n -> {'boolean' if value == 'true' else 'k'}.",
        "open : n, n -> boolean. seen : n -> boolean. b : boolean. random(b).",
    ]
    conditions = [
        "",
        "b",
        "open({0},{1})",
        "not open({0},{1})",
        "seen({0})",
        "way({1},2)={v}",
        "not way(1,2)={v}",
    ]
    for i, j in draw(st.lists(st.tuples(place, place), min_size=1, max_size=4, unique=True)):
        condition = draw(st.sampled_from(conditions)).format(i, j, v=value)
        if "open" in condition:
            lines.append(f"random(open({i},{j})).")
        lines.append(f"way({i},{j})={value}{' :- ' * bool(condition)}{condition}.")
    guards = draw(st.sampled_from(["", ", X != Z", ", Y != X, Z != Y", ", X != Y, Y != Z, X != Z"]))
    body = draw(st.permutations([f"way(X,Y)={value}", f"way(Y,Z)={value}"]))
    lines.append(f"way(X,Z)={value} :- {', '.join(body)}{guards}.")
    if draw(st.booleans()):
        lines.append(f"way(X,Y)={value} :- way(Y,X)={value}{draw(st.sampled_from(['', ', X != Y']))}.")
    extras = [
        f"way(X,Y)={other} :- not way(X,Y)={value}.",
        f"way(2,Y)={other} :- b, not way(2,Y)={value}.",
        f"way(X,Z)={other} :- way(X,Y)={other}, way(Y,Z)={other}.",
        f"seen(X) :- way(1,X)={value}.",
        f"way(X,X)={value} :- seen(X).",
        "random(way(2,1)) :- b.",
        f":- way(1,3)={value}, b.",
        f"obs(way(3,2)={value}).",
        f"random(way(1,3)) :- b. do(way(1,3)={value}).",
        "do(b=false).",
    ]
    return "\n".join(lines + draw(st.lists(st.sampled_from(extras), max_size=3, unique=True)))


@given(text=path_programs(), semantics=st.sampled_from(["2009", "2018"]))
@settings(max_examples=25, deadline=None)
def test_the_worlds_are_those_of_the_enumeration(text, semantics):
    program = parse_plog(text, semantics=semantics)
    found = outcome(lambda: Reasoner(program).most_probable({}, 1000))
    expected = outcome(lambda: Enumeration(program).worlds)
    if not isinstance(expected, type):
        found, expected = (
            sorted((w.measure, sorted(w.values.items())) for w in x) for x in (found, expected)
        )
    assert found == expected

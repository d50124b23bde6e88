"""Ground programs: masks of literals, facts that are evaluated, clauses that are simplified."""

from __future__ import annotations

import itertools
from fractions import Fraction

import pytest

from lcorpp.errors import TooLargeError, UndefinedError
from lcorpp.reasoning import Enumeration, Reasoner, parse_plog
from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.language.parser import parse_query
from lcorpp.reasoning.questions import QUERY_TERM


def ground(text: str, question: str = "") -> GroundProgram:
    program = parse_plog(text, file="a.plog")
    query = parse_query(question, program) if question else None
    return ground_program(program, {}, (), query.formula if query else ())


def test_masks_of_literals():
    """Bit i is value i, the last bit is for no value."""
    program = ground(
        "colour = {red, green, blue}. a : colour. random(a). p, q, r : boolean."
        " p :- a = green. q :- a != green. r :- not a = green."
    )
    masks = [clause.body[0][1] for clause in program.clauses if clause.kind is ClauseKind.DERIVE]
    assert masks == [0b0010, 0b0101, 0b1101]


def test_literals_of_facts_are_evaluated():
    program = ground(
        "d = {1..3}. next, far : d, d -> boolean. x : d -> boolean. next(1,2). next(2,3)."
        " random(x(D)). far(X,Z) :- next(X,Y), next(Y,Z), x(X)."
    )
    (rule,) = [clause for clause in program.clauses if clause.kind is ClauseKind.DERIVE and clause.body]
    assert program.names[rule.term] == "far(1,3)"
    assert [program.names[term] for term, _, _ in rule.body] == ["x(1)"]
    assert repr(program) == "GroundProgram(a.plog: 6 terms, 6 clauses)"


def test_a_query_becomes_a_term():
    program = ground("p, q : boolean. random(p). random(q).", "?{p, not q}")
    assert program.names[-1] == QUERY_TERM
    assert len(program.clauses[-1].body) == 2


def test_simplification_drops_what_is_decided():
    program = ground("p, q, r, s : boolean. random(p). q. q :- p. r :- q, p. s :- r=false, not p. obs(p).")
    clauses, outcomes = simplify(program)
    by_name = dict(zip(program.names, outcomes, strict=True))
    assert by_name["r"] == 0b101  # true, or no value
    assert by_name["s"] == 0b100  # no rule derives r=false, so the rule for s is dropped
    assert not any(isinstance(c, Clause) and program.names[c.term] == "s" for c in clauses if c.term >= 0)


def test_a_rule_with_many_variables():
    """Python allows at most twenty nested loops; a table of bindings has no such limit."""
    names = [f"X{i}" for i in range(30)]
    steps = ", ".join(f"next({x}, {y})" for x, y in itertools.pairwise(names))
    records = ", ".join(f"wrap(f({name}))" for name in names)
    program = parse_plog(
        "n = {1}. r = {f(1)}. next : n, n -> boolean. wrap : r -> boolean. b, q, p : boolean. random(b)."
        f" next(1, 1). wrap(f(1)). p :- b, {steps}. q :- b, {records}."
    )
    for query in ("p=true", "q=true"):
        question = parse_query(query, program)
        assert (
            Reasoner(program).ask(question, exact=True)
            == Enumeration(program).ask(question)
            == Fraction(1, 2)
        )


def test_too_many_bindings_of_records_are_refused(monkeypatch):
    monkeypatch.setattr("lcorpp.reasoning.grounding.binding_table.MAX_BINDINGS", 40_000)
    arguments = ", ".join(f"f(X{i})" for i in range(30))
    sorts = ", ".join(["r"] * 30)
    program = parse_plog(
        f"r = {{f(1), f(2)}}. b : boolean. random(b). p : {sorts} -> boolean. p({arguments}) :- b."
    )
    with pytest.raises(TooLargeError, match=r"<text>:1:.*bindings of 16 variables; expected at most 40000"):
        ground_program(program, {})


CORRIDOR = (
    "room = {1..40}. #domain room(R;Q). door, open, way : room, room -> boolean. reach : room -> boolean."
    + "".join(f" door({i}, {i + 1})." for i in range(1, 40))
    + " [o(R,Q)] random(open(R,Q)) :- door(R,Q). [o(R,Q)] pr(open(R,Q)) = 9/10. reach(1)."
)


@pytest.mark.parametrize(
    "rules",
    [
        "reach(Q) :- reach(R), open(R,Q). reach(R) :- reach(Q), open(R,Q).",
        "way(R,Q) :- open(R,Q). way(R,Q) :- open(Q,R). reach(Q) :- reach(R), way(R,Q).",
        "way(R,Q) :- door(R,Q). way(R,Q) :- door(Q,R). reach(Q) :- way(R,Q), reach(R), open(R,Q)."
        " reach(Q) :- way(R,Q), reach(R), open(Q,R).",
        "reach(Q) :- reach(R), Q = R+1, open(R,Q). reach(R) :- reach(Q), open(R,Q), R = Q-1.",
    ],
)
def test_rules_are_joined_over_the_atoms_that_may_be_true(rules):
    """The 1600 pairs of rooms have 39 doors."""
    program = ground(CORRIDOR + rules, "reach(40)=true")
    assert len(program.clauses) < 39 * 8
    answer = Reasoner(program.source).ask(parse_query("reach(40)=true", program.source), exact=True)
    assert answer == Fraction(9, 10) ** 39


def test_attributes_that_follow_from_facts_are_evaluated():
    program = ground(
        "n = {1..4}. next, below : n, n -> boolean. last, top : n -> boolean. x : boolean."
        " next(1,2). next(2,3). random(x) :- last(3). below(X,Z) :- next(X,Y), next(Y,Z)."
        " last(X) :- next(Y,X), not next(X,1), not below(X,3), not below(1,4)."
        " top(X) :- last(X), x, not last(1). last(1) :- next(X,X)."
    )
    uncertain = [clause for clause in program.clauses if clause.body]
    assert [program.names[clause.term] for clause in uncertain] == ["top(2)", "top(3)"]
    assert all(len(clause.body) == 1 for clause in uncertain)


@pytest.mark.parametrize(
    ("rules", "answer"),
    [
        ("q :- b, e(X, X).", Fraction(1, 2)),  # a variable twice
        ("q :- b, e(X+1, X).", Fraction(1, 2)),  # arithmetic whose variable another position binds
        ("q :- b, e(X, Y), e(Y-1, Y+1).", Fraction(0)),
        ("[r(X)] random(c(X)) :- e(X, X+1). q :- c(1), b.", Fraction(1, 4)),  # one instance of the selection
        ("q :- g(f(X, X)), b.", Fraction(1, 2)),
        ("[r(X)] random(c(X)) :- g(f(X, Y)). q :- c(1), b.", Fraction(1, 4)),
        ("q :- g(f(X, X+1)), e(X, X+1), b.", Fraction(1, 2)),
        ("q :- h=f(X, Y), X < Y, b.", Fraction(1, 8)),
    ],
)
def test_patterns(rules, answer):
    program = parse_plog(
        "n = {1..3}. s = {f(1,1), f(1,2), f(2,2), f(3,1)}. e : n, n -> boolean. g : s -> boolean. h : s."
        " b, q : boolean. c : n -> boolean. random(h). random(b)."
        f" e(1,1). e(1,2). e(2,1). e(3,3). g(f(1,1)). g(f(1,2)). {rules}"
    )
    query = parse_query("q=true", program)
    assert Reasoner(program).ask(query, exact=True) == Enumeration(program).ask(query) == answer


def test_facts_are_read_directly_or_evaluated_with_the_same_result():
    """Facts of integers and names need no table of bindings; sums and records do."""
    text = (
        "n = {1..3}. r = {f(1), f(2)}. c = {x, y}. e : n, c -> c. g : n -> n. h : n -> r. a : n. random(a)."
        " m : boolean. b : c. b = C :- e(N, x) = C, a = N, g(N) = M, h(M) = f(1). random(m) :- b = x."
    )
    plain = "e(1, x) = y. e(2, x) = x. g(1) = 2. g(2) = 1. g(3) = 3. h(1) = f(1). h(2) = f(1)."
    sums = "e(0+1, x) = y. e(3-1, x) = x. g(1) = 1+1. g(2) = 2-1. g(1+2) = 3. h(1) = f(2-1). h(2) = f(1)."
    first, second = ground(text + plain), ground(text + sums)
    assert first.names == second.names
    assert [str(clause) for clause in first.clauses] == [str(clause) for clause in second.clauses]
    program = parse_plog(text + plain)
    question = parse_query("b=x", program)
    assert Reasoner(program).ask(question, exact=True) == Enumeration(program).ask(question) == Fraction(1, 3)


def test_a_table_of_many_facts():
    facts = "".join(f"next({i}, {i + 1}). " for i in range(5000))
    program = parse_plog(
        f"n = {{0..5000}}. c = {{x, y}}. next : n, n -> boolean. a : c. random(a). b : n."
        f" b = M :- a = x, next(N, M), N = 4000. b = 0 :- a = y. {facts}"
    )
    answer = Reasoner(program).ask(parse_query("b", program), exact=True)
    assert {value: p for value, p in answer.items() if p} == {"0": Fraction(1, 2), "4001": Fraction(1, 2)}


@pytest.mark.parametrize("rule", ["a=y.", "a=y :- a=x.", "a=y :- not b.", "a=y :- c."])
def test_contradictory_facts_leave_no_world(rule):
    program = parse_plog(f"s = {{x, y}}. a : s. b, c : boolean. random(c). a=x. {rule}")
    query = parse_query("c=true", program)
    for answer in (Reasoner(program).ask, Enumeration(program).ask):
        if rule == "a=y :- c.":
            assert answer(query) == 0
        else:
            with pytest.raises(UndefinedError):
                answer(query)

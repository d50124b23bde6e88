"""Ground programs: masks of literals, facts that are evaluated, clauses that are simplified."""

from __future__ import annotations

from lcorpp.reasoning import parse_plog
from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.grounder import QUERY_TERM, ground_program
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.language.parser import parse_query


def ground(text: str, question: str = "") -> GroundProgram:
    program = parse_plog(text, file="a.plog")
    query = parse_query(question, program) if question else None
    return ground_program(program, {}, (), query.literals if query else ())


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

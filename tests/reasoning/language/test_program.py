"""Programs as values: text, pickling, and short representations."""

from __future__ import annotations

import pickle

from lcorpp.reasoning import Reasoner, explain, parse_plog, parse_query, program_text

LONG = "n = {1..500}. f : n -> boolean. " + " ".join(f"random(f({i}))." for i in range(1, 301))


def test_text_and_pickle_give_equal_programs() -> None:
    program = parse_plog("p, q : boolean. random(p). q :- p. ?{q}.", file="a.plog")
    assert parse_plog(program_text(program)) == program
    assert pickle.loads(pickle.dumps(program)) == program


def test_equality_of_statements_ignores_their_places() -> None:
    one, two = parse_plog("p : boolean. random(p)."), parse_plog("p : boolean.\n\n  random( p ).")
    assert one.statements == two.statements
    assert set(one.statements) == set(two.statements)
    assert one.statements[1].at != two.statements[1].at
    assert one.statements[0] != one.statements[1]


def test_representations_are_short() -> None:
    program = parse_plog(LONG, file="long.plog")
    assert repr(program) == "<Program long.plog: 1 attributes, 302 statements, semantics of 2009>"
    assert repr(Reasoner(program)) == f"Reasoner({program!r})"
    assert repr(program.attributes["f"]) == "<Attribute f : n -> boolean, 2 values>"
    query = parse_query("f(1) | " + ", ".join(f"obs(f({i}))" for i in range(2, 100)), program)
    assert repr(query).startswith("<Query ?f(1) | obs(f(2)=true)")
    assert len(repr(query)) < 150
    html = program._repr_html_()
    assert html.startswith("<pre>n = {1..500}.\n")
    assert html.endswith("% ... 202 more statements</pre>")


def test_an_explanation_has_a_short_representation() -> None:
    program = parse_plog("p, q : boolean. random(p). q :- p. q=false :- not p.")
    explanation = explain(Reasoner(program), parse_query("?{q} | obs(p)", program))
    assert repr(explanation) == (
        "<Explanation of ?{q=true} | obs(p=true).: answer 1, 1 conditions, 1 worlds>"
    )

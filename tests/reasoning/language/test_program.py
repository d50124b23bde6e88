"""Programs as values: text, pickling, and short representations."""

from __future__ import annotations

import pickle
import re

import pytest

from lcorpp.errors import LcorppError, ParseError, ProgramError
from lcorpp.reasoning import Reasoner, explain, parse_plog, parse_query, program_text
from lcorpp.reasoning.language.syntax import Rule

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


FACTS = "n = {1..3}. c = {x, y}. e : n, c -> c. g : c -> boolean. h : n. a : c. random(a)."


@pytest.mark.parametrize(
    "fact",
    [
        "e(1, x) = y",
        "e(1,x)=y",
        "g(x)",
        "g(x) = false",
        "-g(y)",
        "h = 2",
        "e(\n 1,\n x) = y",
        "e(1+1, x) = y",
    ],
)
def test_facts_are_rules(fact):
    """Facts of integers and names have a compact form; it equals the rule."""
    program = parse_plog(f"{FACTS} {fact}.")
    rule = program.statements[-1]
    assert isinstance(rule, Rule)
    assert rule == Rule(rule.head) == pickle.loads(pickle.dumps(rule))
    assert hash(rule) == hash(Rule(rule.head))
    assert parse_plog(str(program)) == program
    assert rule != Rule(rule.head, (rule.head,))


@pytest.mark.parametrize(
    ("fact", "place"),
    [
        ("e(1, z) = y.", "2:6: 'z' is not a member"),
        ("e(1, x) = 2.", "2:11: '2' is not a member"),
        ("e(99999999999, x) = y.", "2:3: the number 99999999999 is beyond 32 bits"),
        ("g(1,\n2).", "2:1: g has 1 arguments, not 2"),
        ("k(x).", "2:1: 'k' is not declared"),
    ],
)
def test_errors_in_facts_have_exact_places(fact, place):
    with pytest.raises(ProgramError, match=re.escape(f"a.plog:{place}")):
        parse_plog(f"{FACTS}\n{fact}", file="a.plog")


def test_constants_and_overloads_in_facts():
    program = parse_plog(
        "#const k = 2. n = {1..3}. #domain n(X). p(k). p(1, k). q(k) = k. q(1) = 3. p(X) :- q(X) = X."
    )
    assert [str(rule) for rule in program.statements if isinstance(rule, Rule)][:4] == [
        "p(2)=true.", "p(1,2)=true.", "q(2)=2.", "q(1)=3.",
    ]  # fmt: skip


def nest(depth: int) -> str:
    return "f(" * depth + "a" + ")" * depth


@pytest.mark.parametrize("frames", [0, 500])
def test_nested_terms_are_read_or_refused(frames):
    """Also where the caller leaves half of Python's stack."""

    def call(n: int, depth: int) -> object:
        if n:
            return call(n - 1, depth)
        program = parse_plog(f"s = {{{nest(depth)}}}. p : s -> boolean. random(p(X)). ?{{p({nest(depth)})}}.")
        return Reasoner(program).ask(program.queries[0])

    assert call(frames, 20) == 0.5
    assert call(0, 55) == 0.5
    for depth in (101, 5000):
        with pytest.raises(ParseError, match="nested deeper than 60 levels"):
            call(frames, depth)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("s = {}.", "unexpected '}'"),
        ("#s = {a} - {a}.", "the sort s is empty"),
        ("s = {3..1}.", "the interval 3..1 is empty"),
        ("s = {99999999999}.", "beyond 32 bits"),
        ("s = {" + "9" * 5000 + "}.", "a number of 5000 digits"),
        ("n = {1..3}. p : n -> boolean. p(2147483648).", "beyond 32 bits"),
    ],
)
def test_empty_sorts_and_huge_integers_are_refused(text, message):
    with pytest.raises(LcorppError, match=re.escape(message)):
        parse_plog(text)


def test_programs_without_statements():
    for text in ("", "% nothing", "\n\n", "p : boolean."):
        assert Reasoner(parse_plog(text)).count() == 1
    program = parse_plog("p : boolean.")
    assert Reasoner(program).ask(parse_query("p=true", program)) == 0

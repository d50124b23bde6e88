"""Differences between the two semantics, and cr-rules against brute force over sets of rules."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, Program, Reasoner, parse_plog, parse_query, program_text


def probability(program: Program, query: str) -> Fraction:
    return Enumeration(program).ask(parse_query(query, program))


@pytest.mark.parametrize(
    ("mark", "semantics"),
    [
        ("p : boolean.", "2009"),
        ("#domain boolean(X).", "2009"),
        ("#const n = 1.", "2009"),
        ("sorts", "2018"),
        ("#s = {a}.", "2018"),
        ("p : #boolean.", "2018"),
        ("s = {a}. x : s. ok : s -> boolean. random(x, ok).", "2018"),
        ("p : boolean. p :+.", "2018"),
        ("#semantics 2018. p : boolean.", "2018"),
        ("sorts #semantics 2009.", "2009"),
    ],
)
def test_the_dialect_determines_the_semantics(mark: str, semantics: str) -> None:
    program = parse_plog(mark)
    assert program.semantics == semantics
    assert parse_plog(program_text(program)) == program
    other = parse_plog(mark, semantics="2009")
    assert (other == program) == (semantics == "2009")
    assert parse_plog(program_text(other)) == other


RANGED = """s={a,b,c}. p : boolean. x : s. ok : s -> boolean. ok(a). ok(b).
    random(p). random(x : {X : ok(X)}) :- p."""


def test_do_and_a_dynamic_range() -> None:
    old, new = (parse_plog(RANGED, semantics=semantics) for semantics in ("2009", "2018"))
    # 2009: the value is a fact, in its dynamic range or not, whether or not x would have been selected
    assert probability(old, "?{x=c} | do(x=c)") == 1
    assert probability(old, "?{x=a} | do(x=a)") == 1
    assert probability(old, "?{p} | do(x=c)") == Fraction(1, 2)
    # 2018: an intervention into a selection that takes place, bound to its dynamic range
    assert probability(new, "?{x=a} | do(x=a)") == Fraction(1, 2)
    assert probability(new, "?{x=a} | do(x=a), obs(p)") == 1
    assert probability(new, "?{p} | do(x=c)") == 0
    with pytest.raises(UndefinedError):
        probability(new, "?{p} | do(x=c), obs(p)")
    # the same as a statement
    assert probability(parse_plog(RANGED + "do(x=c).", semantics="2018"), "?{p}") == 0


def test_worlds_of_the_example_of_the_paper() -> None:
    # P1: do(a, false) on a random a leaves two worlds, {-a, b, c} and {-a, -c}
    text = "a, b, c : #boolean. random(a). b :- c, a = false. do(a, false). random(c)."
    worlds = Enumeration(parse_plog(text)).worlds
    assert sorted(tuple(sorted(world.values.items())) for world in worlds) == [
        (("a", "false"), ("b", "true"), ("c", "true")),
        (("a", "false"), ("c", "false")),
    ]
    assert {world.measure for world in worlds} == {Fraction(1, 2)}


@pytest.mark.parametrize(
    ("rules", "old", "new"),
    [
        (
            "random(q). q :- p.",
            None,
            "3:1: Condition 1: q is selected at random while a rule derives it",
        ),
        ("random(q). -q :- p.", None, "3:1: Condition 1: q is selected at random while"),
        (
            "random(q). random(q) :- p.",
            "3:12: Condition 1: q is also selected at random by the rule at",
            None,
        ),
        ("random(q : {X : ok(X)}). random(q : {X : ok(X)}) :- p.", "3:26: Condition 1", None),
        ("random(q). random(q : {X : ok(X)}) :- p.", "3:12: Condition 1", "3:12: Condition 1"),
        ("[r] random(q). [s] random(q) :- p.", "3:17: Condition 1", "3:17: Condition 1"),
        ("random(q) :- p. random(q) :- -p.", None, None),
        ("random(q) :- p. q :- -p.", None, None),
    ],
)
def test_condition_1(rules: str, old: str | None, new: str | None) -> None:
    text = f"p, q : boolean. ok : boolean -> boolean.\nok(true). ok(false). random(p).\n{rules}"
    for semantics, words in (("2009", old), ("2018", new)):
        program = parse_plog(text, semantics=semantics)  # type: ignore[arg-type]
        if words is None:
            assert sum(world.measure for world in Enumeration(program).worlds) == 1
            continue
        with pytest.raises(ProgramError) as caught:
            assert Enumeration(program).worlds
        assert f"<text>:{words}" in str(caught.value)
        assert "in the world {" in str(caught.value)


def test_condition_1_ignores_terms_set_by_an_intervention() -> None:
    text = "p, q : boolean. random(p). random(q). q :- p. do(q)."
    assert probability(parse_plog(text, semantics="2018"), "?{q}") == 1


# cr-rules


def test_equal_worlds_of_two_supports_count_once() -> None:
    program = parse_plog("a, b, c : boolean. a +- . b +- . c +- . a :- b. b :- a. c :- b. c :- a. obs(c).")
    assert probability(program, "?{a}") == Fraction(1, 2)


def test_an_observation_creates_worlds() -> None:
    program = parse_plog("b, a : boolean. b +- . random(a) :- b. pr(a | b) = 1/4.")
    reasoner = Enumeration(program)
    assert [dict(world.values) for world in reasoner.worlds] == [{}]
    assert probability(program, "?{b}") == 0
    assert probability(program, "?{a} | obs(b)") == Fraction(1, 4)
    assert reasoner.exact("a", {"b": "true"}) == {"true": Fraction(1, 4), "false": Fraction(3, 4)}
    assert reasoner.sample(np.random.default_rng(0), {"a": "true"}) == {"a": "true", "b": "true"}
    with pytest.raises(UndefinedError):
        probability(program, "?{a} | obs(-b)")


def test_a_random_selection_as_cr_rule() -> None:
    program = parse_plog("p, q : boolean. random(p) :+ . :- not p, not p = false. random(q).")
    assert probability(program, "?{p}") == Fraction(1, 2)
    assert len(Enumeration(program).worlds) == 4


def test_supports_are_smallest_by_number_of_instances() -> None:
    text = """n = {1..3}. ab : n -> boolean. g, h : boolean.
        ab(X) +- n(X). h +- . g :- ab(1), ab(2). g :- h."""
    assert probability(parse_plog(text), "?{h} | obs(g)") == 1
    without = text.replace("h +- .", "")
    assert probability(parse_plog(without), "?{ab(1), ab(2), not ab(3)} | obs(g)") == 1


NAMES = ("a", "b", "c")
LITERALS = st.builds("{}{}".format, st.sampled_from(["", "not "]), st.sampled_from(NAMES))
BODIES = st.lists(LITERALS, max_size=2).map(lambda body: f" :- {', '.join(body)}." if body else ".")
RULES = st.lists(st.builds("{}{}".format, st.sampled_from(NAMES), BODIES), max_size=4)


@given(rules=RULES, cr_rules=RULES, observed=LITERALS, asked=st.sampled_from(NAMES))
@settings(max_examples=25)
def test_cr_rules_agree_with_trying_sets_of_rules(
    rules: list[str], cr_rules: list[str], observed: str, asked: str
) -> None:
    base = f"a, b, c, r : boolean. random(r). a :- r, not c. obs({observed}). " + " ".join(rules)
    worlds: dict[tuple[tuple[str, str], ...], Fraction] = {}
    for size in range(len(cr_rules) + 1):
        for chosen in combinations(cr_rules, size):
            try:
                found = Enumeration(parse_plog(base + " ".join(chosen))).worlds
            except UndefinedError:
                continue
            for world in found:
                worlds[tuple(world.values.items())] = Fraction(1, 2)
        if worlds:
            break
    turned = [rule.replace(" :- ", " +- ") if ":-" in rule else f"{rule[:-1]} +- ." for rule in cr_rules]
    program = parse_plog(base + " ".join(turned))
    if not worlds:
        with pytest.raises(UndefinedError):
            probability(program, asked + "=true")
        return
    total = sum(worlds.values())
    share = sum(w for values, w in worlds.items() if (asked, "true") in values)
    assert probability(program, asked + "=true") == share / total


@pytest.mark.parametrize(
    ("text", "query", "expected"),
    [
        ("a, d, e, f : boolean. e. d :- e. random(f). a :- f, not d. -a :- not a.", "a", "0"),
        ("a, d, e, f : boolean. e. d :- e. random(f). a :- f, not -d. -a :- not a.", "a", "1/2"),
        (
            "n = {1, 2}. opens, blocked, wall : n -> boolean. wall(1). blocked(X) :- wall(X)."
            " opens(X) :- not blocked(X), lucky. lucky : boolean. random(lucky). -opens(X) :- not opens(X).",
            "opens(1)",
            "0",
        ),
        ("0.5::f. a :- f, \\+d. d :- e. e. query(a).", "a", "0"),
    ],
)
def test_a_negated_literal_about_a_derived_fact_is_tested(text: str, query: str, expected: str):
    """Also where its attribute is declared after that of the rule."""
    program = parse_plog(text)
    question = parse_query(f"?{{{query}}}.", program)
    assert Reasoner(program).ask(question, exact=True) == Fraction(expected)
    assert Enumeration(program).ask(question) == Fraction(expected)

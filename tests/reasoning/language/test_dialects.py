"""The dialects of plog 1.0 and plog 2.0 against equivalent plain statements."""

from __future__ import annotations

import re
from contextlib import suppress
from fractions import Fraction

import pytest

from lcorpp.errors import LcorppError, ParseError, ProgramError
from lcorpp.reasoning import Enumeration, Program, Reasoner, ask, parse_plog, parse_query, program_text


def members(sort: str, before: str = "") -> tuple[str, ...]:
    program = parse_plog(f"{before} #it = {sort}.")
    assert parse_plog(program_text(program)) == program
    return tuple(program.signature.sorts["it"])


def probability(program: Program, query: str) -> Fraction:
    return Enumeration(program).ask(parse_query(query, program))


BEFORE = "#const k = 3. #a = {x, y}. #n = 1..k. #m = 2..k+1."


@pytest.mark.parametrize(
    ("sort", "expected"),
    [
        ("1..3", "1 2 3"),
        ("-1..1", "-1 0 1"),
        ("1..k", "1 2 3"),
        ("1..k-1 + 5..5", "1 2 5"),
        ("{1..2, x, f(x)}", "1 2 x f(x)"),
        ("#n + #m", "1 2 3 4"),
        ("#n * #m", "2 3"),
        ("#n - #m", "1"),
        ("#n - #m + {4}", "1 4"),
        ("#n - (#m + {1}) + #a", "x y"),
        ("#a + #n * #m", "x y 2 3"),
        ("f(#a)", "f(x) f(y)"),
        ("f(#a, {1}) + g(h(#a))", "f(x,1) f(y,1) g(h(x)) g(h(y))"),
        ("f(#n(X), #n(Y)) : X < Y", "f(1,2) f(1,3) f(2,3)"),
        ("f(#n(X), #n(Y)) : X = Y & X != 2 | X > Y & Y >= 2", "f(1,1) f(3,2) f(3,3)"),
        ("f(#n(X), #n(Y)) : X = Y & (X = 1 | Y = k)", "f(1,1) f(3,3)"),
        ("f(#a(X), #a(Y)) : X != Y", "f(x,y) f(y,x)"),
    ],
)
def test_sort_algebra(sort: str, expected: str) -> None:
    assert members(sort, BEFORE) == tuple(expected.split())


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("#s = #t.", "1:6", "unknown sort '#t'; expected one of #boolean"),
        ("#s = {a} - {a}.", "1:1", "the sort s is empty"),
        ("#s = {a, a}.", "1:10", "a appears twice in the sort s"),
        ("#s = 3..1.", "1:6", "the interval 3..1 is empty"),
        ("#s = 1..10000000000.", "1:9", "beyond 32 bits"),
        ("#s = 1..1000000000.", "1:6", "has 1000000000 members; a sort has at most 100000"),
        (
            "#s = 1..1000. #t = f(#s, #s, #s).",
            "1:20",
            "the records f(...) have 1000000000 members; a sort has",
        ),
        ("#s = f({a}(X)) : X < Y.", "1:22", "variable Y is not an argument of the record"),
        ("#s = f({a}(X), {b}(X)).", "1:6", "a variable names two arguments"),
        ("#s = {a} + .", "1:12", "unexpected '.'; expected '(' or '{'"),
        ("#s = " + "{a} + " * 200 + "{a}.", "1:", "nested deeper than 60 levels"),
        ("#boolean = {yes, no}.", "1:1", "built in as {true, false} and cannot be declared otherwise"),
        ("#s = {f(a)}. f : #s -> #s.", "1:14", "f is an attribute and, with as many arguments, a record"),
        ("attributes random : #boolean.", "1:19", "unexpected ':'; expected '('"),
        ("#const n = 1. #const n = 2.", "1:22", "the constant n is declared twice"),
        ("#semantics 2012.", "1:12", "unknown semantics 2012; expected 2009 or 2018"),
        ("p : boolean. random(p). do(p) :- p.", "1:31", "an intervention has no body"),
        ("p : boolean. random(p). do(r, p, true).", "1:28", "do() of a named rule is not supported"),
        ("p : boolean. random(p). [r] p :- p.", "1:26", "only random selections, pr-atoms and cr-rules have"),
        ("p : boolean. q : boolean. random(q) :- not obs(p, _).", "1:40", "'_' under 'not'"),
        ("p : boolean. p :- do(p, true).", "1:19", "do(...) is not supported in the body of a rule"),
        ("p : boolean. random(p). p :- `x`.", "1:30", "unexpected character '`'"),
    ],
)
def test_errors_of_the_dialects_are_located(text: str, place: str, words: str) -> None:
    with pytest.raises((ParseError, ProgramError)) as caught:
        parse_plog(text, file="bad.plog")
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"bad.plog:{place}")


TWO = """%* A block comment
   %* in another *% of two lines *%
#const days = 2.
sorts #day = 1..days. #b = {true, false}.
attributes seen : #day -> #b.  late, rain : #b.  day : #day - {2}.
statements
random(rain).  random(seen(D)) :- rain.  random(late, rain_or_not).
pr(seen(1) | rain) = 1/4.
day = 1.
late = false :- not rain.
"""

ONE = """#domain day(D).
day = {1..2}.  % plog 1.0
seen : day -> boolean.
rain : boolean.
[r] random(rain).
[s(D)] random(seen(D)) :- rain.
[s(1)] pr(seen(1) | rain) = 1/4.
"""


def test_both_dialects_mean_the_same() -> None:
    two = parse_plog(TWO.replace("random(late, rain_or_not).", "").replace("late = false :- not rain.", ""))
    one = parse_plog(ONE)
    assert (one.semantics, two.semantics) == ("2009", "2018")
    for query in ("?{seen(1)}", "?{seen(2)} | obs(rain)", "?{rain} | obs(seen(1)), obs(-seen(2))"):
        assert probability(one, query) == probability(two, query)
    assert two.attributes["day"].values == ("1",)


def test_observations_and_interventions_of_plog_2() -> None:
    base = "sorts #s = {a, b, c}. attributes x : #s. p : #boolean. statements random(x). random(p). "
    for written, plain in [
        ("obs(x, a).", "obs(x=a)."),
        ("obs(x, a, true).", "obs(x=a)."),
        ("obs(x, a, false).", "obs(x!=a)."),
        ("obs(x=a, false).", "obs(x!=a)."),
        ("obs(p).", "obs(p=true)."),
        ("obs(p, false).", "obs(-p)."),
        ("do(x, b).", "do(x=b)."),
    ]:
        assert parse_plog(base + written) == parse_plog(base + plain), written


def test_a_bare_query_asks_for_a_probability_in_plog_2() -> None:
    program = parse_plog("sorts attributes p : #boolean. statements p :- not p = false. ?p.")
    assert ask(program, program.queries[0]) == 1
    # the dot of a query that ends the text may be missing
    assert parse_plog("sorts attributes p : #boolean. statements p :- not p = false. ?p") == program
    plain = parse_plog("p : boolean. random(p). ? p.")
    assert ask(plain, plain.queries[0]) == {"true": Fraction(1, 2), "false": Fraction(1, 2)}


def test_undeclared_attributes_of_plog_1() -> None:
    text = """#domain n(X;Y), who(W). n = {1..3}. who = {ann, bob}.
        f : n.  [r(W)] random(f(W)).
        more(X,Y) :- X > Y.   first(W) = X :- f(W) = X, more(X,1).
        big :- first(ann) = 3.   big(X) :- more(X,2).
        likes(cat)."""
    program = parse_plog(text)
    declared = program.attributes
    assert (declared["f"].arguments, declared["f"].range) == (("who",), "n")
    assert (declared["more"].arguments, declared["more"].range) == (("n", "n"), "boolean")
    assert (declared["first"].arguments, declared["first"].range) == (("who",), "n")
    assert declared["big"].arguments == ()
    assert declared["big/1"].arguments == ("n",)
    assert program.signature.sorts[declared["likes"].arguments[0]].keys() == {"cat"}
    assert probability(program, "?{big}") == Fraction(1, 3)
    assert probability(program, "?{big(3)}") == 1
    assert Enumeration(program).exact("big(3)", {})["true"] == 1
    assert parse_plog(program_text(program)) == program
    with pytest.raises(ProgramError, match="'gib' is not declared"):  # no head has it: a slip
        parse_plog(text + " q(W) :- f(W) = 1, gib.")
    with pytest.raises(ProgramError, match="'p' is not declared"):  # only programs with #domain leave it out
        parse_plog("p.")


def test_attributes_with_different_numbers_of_arguments_share_a_name() -> None:
    program = parse_plog("""s = {a, b}. pair : s. pair : s -> s. pair : s, s -> boolean.
        random(pair). random(pair(X)) :- pair = X. pair(X,Y) :- pair(X) = Y.""")
    assert parse_plog(program_text(program)) == program
    assert repr(program.attributes["pair/2"]) == "<Attribute pair : s, s -> boolean, 2 values>"
    reasoner = Reasoner(program)
    for text, answer in [("?{pair(a,b)} | obs(pair=a)", "1/2"), ("?{pair(a,b)} | do(pair=b)", "0")]:
        query = parse_query(text, program)
        assert reasoner.ask(query, exact=True) == probability(program, text) == Fraction(answer)
    assert reasoner.exact("pair", {"pair(a,b)": "true"}) == {"a": 1, "b": 0}
    assert repr(reasoner.compile(["pair"], "pair(a,b)")).startswith("Circuit(<text>: pair(a,b) given pair;")
    (world,) = reasoner.most_probable({"pair(a,b)": "true"})
    assert repr(world) == "PossibleWorld(1: {pair=a, pair(a)=b, pair(a,b)=true})"
    for text, words in [
        ("pair(a,c).", "'c' is not a member of the sort s"),
        ("pair(a,a,a).", "pair has 0 arguments, not 3; expected pair"),
        ("pair(a,b) = a.", "'a' is not a member of the sort boolean"),
        (
            "pr(pair(a,b)) = 1/2.",
            "pair has no random selection; expected 'random(pair(a,b)).' in the program",
        ),
        ("pair(X,b) :- pair(X,Y), Y < b.", "the order in Y<b needs integers, but Y may be a of the sort s"),
        ("pair : s -> s.", "pair is declared twice"),
        ("q.", "'q' is not declared; expected one of pair"),
    ]:
        with pytest.raises(ProgramError, match=re.escape(words) + "($|;)"):
            parse_plog(program_text(program) + text)


def test_formulas_of_plog_1_queries() -> None:
    program = parse_plog("a, b : boolean. random(a). random(b).")
    assert probability(program, "?{(a and !b)}") == Fraction(1, 4)
    assert probability(program, "?{(a or b), !(a and b)}") == Fraction(1, 2)


def test_obs_literals_in_bodies_are_true_if_the_program_has_the_observation() -> None:
    text = """sorts attributes s, c : #boolean. x : {1, 2}. statements
        random(x). s :- c. random(c) :- obs(s, true, true). c = false :- not obs(s). """
    assert probability(parse_plog(text), "?{c=false}") == 1
    recorded = parse_plog(text + "obs(s, true).")
    assert probability(recorded, "?{c}") == 1
    assert parse_plog(program_text(recorded)) == recorded
    values = """sorts attributes x : {1, 2}. c : #boolean. statements
        random(x). obs(x, 2). obs(x, 1, false).
        c :- obs(x, X), X > 1, obs(x, 1, false), not obs(x, 2, false)."""
    assert probability(parse_plog(values), "?{c}") == 1


def test_attributes_may_share_names_with_sorts_and_compound_values() -> None:
    program = parse_plog("time = {am, pm}. time : time. random(time).")
    assert probability(program, "time=am") == Fraction(1, 2)
    text = """sorts #t = 0..1. #act = go(#t). attributes go : #t -> #boolean. ok : #act -> #boolean.
        statements ok(go(T)) :- go(T). go(1)."""
    assert probability(parse_plog(text, strict=False), "?{ok(go(1))}") == 1


def test_lenient_parsing_drops_ill_sorted_rules() -> None:
    text = """s={a,b}. f : s -> boolean. x : s. random(x).
        f(c). x=d :- f(a). f(a) :- f(a,b). f(X) :- x=X. ?{f(a)}."""
    hint = r"'c' is not a member of the sort s; .*; strict=False \(lcorpp ask --lenient\) reads the program$"
    with pytest.raises(ProgramError, match=hint):
        parse_plog(text)
    with pytest.raises(ProgramError, match=r"a record in a sort; .*--lenient"):
        parse_plog("sorts #t = {a}. #s = f(#t). attributes f : #t -> #boolean. statements f(a).")
    with pytest.raises(ProgramError, match=r"f is an attribute and, .* a record in a sort"):
        parse_plog(
            "sorts #s = {a, f(a,b)}. attributes f : #s -> #boolean. f : #s, #s -> #s. statements f(a)."
        )
    with pytest.raises(ProgramError, match=r"'z' is not declared; expected one of x$"):
        parse_plog("s={a,b}. x : s. random(x). z.")  # not in the lenient mode, either
    lenient = parse_plog(text, strict=False)
    assert lenient == parse_plog("s={a,b}. f : s -> boolean. x : s. random(x). f(X) :- x=X. ?{f(a)}.")
    # to leave these out would change the answer
    for kept in ("?{f(c)}.", "obs(f(c)).", "f(a) :- not f(c)."):
        with pytest.raises(ProgramError, match="'c' is not a member"):
            parse_plog(text + kept, strict=False)
    with pytest.raises(ProgramError, match="f has 1 arguments, not 2"):
        parse_plog(text + "f(a, b).", strict=False)


def test_anonymous_variables() -> None:
    program = parse_plog(
        "n={1..3}. f : n, n -> boolean. p : boolean. f(1,2). p :- f(_, _). random(p) :- f(2,_)."
    )
    assert probability(program, "p=true") == 1
    assert parse_plog(program_text(program)) == program


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_all_line_ends_are_counted(end: str) -> None:
    text = end.join(["% one", "p : boolean.", "random(p).", "q."])
    with pytest.raises(ProgramError, match=r"<text>:4:1: 'q' is not declared"):
        parse_plog(text)
    with pytest.raises(ParseError) as caught:
        parse_plog(end.join(["p : boolean.", "random(p)", "", "q."]))
    assert (caught.value.line, caught.value.column, caught.value.text) == (4, 1, "q.")


def test_cr_rules_read_and_print() -> None:
    one = parse_plog("p, q : boolean. [r] p +- not q. [s] random(q) +- .")
    assert one.has_cr_rules
    assert parse_plog(program_text(one)) == one
    two = parse_plog("p, q : boolean. p :+ not q. random(q) :+.")
    assert two.semantics == "2018"
    assert parse_plog(program_text(two)) == two
    assert not parse_plog("p : boolean. random(p).").has_cr_rules


def test_plus_minus_in_a_sum_is_no_cr_rule() -> None:
    program = parse_plog("n = {0..2}. x : n. y : n. random(x). y = Z :- x = X, Z = X +-1.")
    assert probability(program, "y=1") == Fraction(1, 3)


def test_errors_are_typed_for_every_prefix_of_a_program() -> None:
    for end in range(len(TWO)):
        with suppress(LcorppError):
            parse_plog(TWO[:end])

"""Messages and places of errors in programs."""

from __future__ import annotations

import pytest

from lcorpp.errors import FileError, ParseError, ProgramError
from lcorpp.reasoning import parse_plog, parse_query, read_plog

BASE = """c = {red, green}.
n = {1..3}.
a : c.
f : n -> n.
p : boolean.
random(a).
random(f(X)).
random(p).
"""


@pytest.mark.parametrize(
    ("statement", "column", "words"),
    [
        ("b : sort.", 1, "unknown sort 'sort'; expected one of boolean, c, n"),
        ("z = red.", 1, "'z' is not declared; expected one of a, f, p"),
        ("c = red.", 1, "'c' is a sort, not an attribute"),
        ("a = blue.", 5, "'blue' is not a member of the sort c; expected one of red, green"),
        ("a.", 1, "'true' is not a member of the sort c"),
        ("f = 1.", 1, "f has 1 arguments, not 0; expected f(n)"),
        ("f(4) = 1.", 3, "'4' is not a member of the sort n"),
        ("f(X+1) = 1.", 3, "variable X is unsafe"),
        ("p :- X > 2.", 6, "variable X is unsafe"),
        ("p :- f(X) = Y, a = Y.", 13, "variable Y cannot be of the sorts n and c at once"),
        ("p :- a = X, X < 2.", 13, "the order in X<2 needs integers, but X may be red of the sort c"),
        ("p :- a < red.", 6, "orders values of a, which are not integers"),
        ("p :- f(X) = Y, Y + red = 2.", 20, "arithmetic in Y+red needs integers, but red is none"),
        ("p :- f(X) = Y, Y * 2000000000 = 2.", 16, "may exceed 2147483647"),
        ("p :- f(1) = 1/0.", 13, "division by zero in 1/0"),
        ("f(1) = 0.5.", 8, "expected an integer, not 0.5"),
        ("pr(a = red) = 5/4.", 15, "the probability 5/4 is not between 0 and 1"),
        ("pr(a = red) = -0.1.", 15, "the probability -1/10 is not between 0 and 1"),
        ("pr(a = red) = 1/0.", None, "division by zero in 1/0"),
        ("[r] pr(a = red) = 1/2.", 2, "no random selection of a has the label [r]"),
        ("[r] random(a). [r] random(p).", 17, "label [r] is already used at bad.plog:9:2"),
        ("q : boolean. pr(q) = 1/2.", 14, "q has no random selection; expected 'random(q).'"),
        ("q : boolean. do(q).", 14, "q has no random selection; expected 'random(q).'"),
        ("c = {blue}.", 1, "c is declared twice; first at bad.plog:1:1"),
        ("boolean = {blue}.", 1, "boolean is built in"),
        ("d = {x, x}.", 9, "x appears twice in the sort d"),
        ("d = {3..1}.", 6, "the interval 3..1 is empty"),
        (
            "d = {1..1000000000}.",
            6,
            "1..1000000000 has 1000000000 members; a sort has at most 100000",
        ),
        ("#domain n(X). #domain c(X).", 15, "variable X already has the sort n"),
        ("obs(f(X) = 1).", 7, "variable X is not allowed here"),
        ("random(a : {X : a = X}) :- a = X.", 13, "variable X of the dynamic range is also used outside"),
        ("?{a = blue}.", 7, "'blue' is not a member of the sort c"),
        ("p :- c(X, Y).", 6, "c is a sort; expected c(...) without value"),
    ],
)
def test_program_error_is_located(statement: str, column: int | None, words: str) -> None:
    with pytest.raises((ProgramError, ParseError)) as caught:
        parse_plog(BASE + statement + "\n", file="bad.plog")
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"bad.plog:9:{column or ''}")


@pytest.mark.parametrize(
    ("statement", "place", "words"),
    [
        ("a = red", "9:8:", "unexpected end of the text; expected"),
        ("a = $.", "9:5:", "unexpected character '$'"),
        ("a = red, p.", "9:8:", "unexpected ','"),
        ("a != red.", "9:1:", "expected attribute=value in the head of a rule, not a!=red"),
        ("1 = 2.", "9:1:", "expected attribute=value in the head of a rule"),
        ("p :- X.", "9:6:", "expected a literal, not X"),
        ("-p = true.", "9:1:", "write p!=..."),
        ("p :- f(-p) = 1.", "9:8:", "'-p' is a literal; expected a value"),
        ("g : n, n.", "9:1:", "attribute g has arguments but no range"),
        ("pr(a = red) = " + "9" * 400 + ".", "9:15:", "a number of 400 digits"),
        ("p :- f(1) = " + "(" * 500 + "1" + "+1)" * 500 + ".", "9:", "nested deeper than 60"),
        ("p :- f(1) = " + "g(" * 5000 + "1" + ")" * 5000 + ".", "9:", "nested deeper than 60"),
        ("p :- f(1) = 1" + "+1" * 5000 + ".", "9:", "nested deeper than 60"),
        ("do(a = red, red).", "9:4:", "expected do(attribute=value) or do(attribute, value)"),
        ("not p.", "9:1:", "unexpected 'not'"),
    ],
)
def test_parse_error_is_located(statement: str, place: str, words: str) -> None:
    with pytest.raises(ParseError) as caught:
        parse_plog(BASE + statement, file="bad.plog")
    assert str(caught.value).startswith(f"bad.plog:{place}")
    assert words in str(caught.value)


def test_too_many_instances_are_refused_before_grounding() -> None:
    text = "n = {1..1000}. f : n, n, n -> boolean. f(X,Y,Z)."
    outcomes = "n = {1..127}. f : n, n -> n. random(f(X,Y))."  # its instances are few, its outcomes are not
    with pytest.raises(ProgramError, match="has 2048383 ground instances"):
        parse_plog(outcomes)
    with pytest.raises(ProgramError, match="has 1000000000 ground instances; expected at most 2000000"):
        parse_plog(text)


def test_missing_file() -> None:
    with pytest.raises(FileError, match="nowhere"):
        read_plog("nowhere.plog")


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("b", "'b' is not declared; expected one of a, f, p"),
        ("a = blue", "'blue' is not a member"),
        ("a = red |", "expected 'do' or 'obs'"),
        ("", "unexpected end of the text"),
        ("f(X) = 1", "variable X is not allowed"),
        ("a = red | do(f(9) = 1)", "'9' is not a member"),
        ("a = red, X < 3", "expected a literal of an attribute, not X<3"),
        (
            "f(1) or p",
            "'true' is not a member of the sort n; expected one of 1, 2, 3; a alone stands for a=true",
        ),
        ("-f(1)", "'false' is not a member of the sort n; expected one of 1, 2, 3; -a stands for a=false"),
        ("f(1) = 1 or 2", "expected a literal, not 2; a value needs its attribute, as in a=2"),
    ],
)
def test_query_error_is_a_parse_error(query: str, words: str) -> None:
    with pytest.raises(ParseError) as caught:
        parse_query(query, parse_plog(BASE))
    assert caught.value.file == "<query>"
    assert words in str(caught.value)

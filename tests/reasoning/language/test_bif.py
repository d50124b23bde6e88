"""Bayesian networks in the Interchange Format: known answers, names, and error messages."""

from __future__ import annotations

import pickle
import warnings
from fractions import Fraction

import pytest

from lcorpp import ConfusionMatrix
from lcorpp.errors import ParseError, ProgramError
from lcorpp.reasoning import (
    Enumeration,
    Reasoner,
    ReasoningWarning,
    parse_plog,
    parse_query,
    program_text,
    read_plog,
    with_classifier,
)
from lcorpp.reasoning.language.networks.bif import parse_bif
from lcorpp.reasoning.quoting import is_quoted, make_name_text, make_value_text, unquote, write_name

SPRINKLER = """
// a comment with { braces }
network "the lawn" { property author = "N. N."; }
variable Rain { type discrete [ 2 ] { yes, no }; property position = (1, 2); }
variable Sprinkler { type discrete [ 2 ] { yes, no }; }
variable "Wet grass" { type discrete [ 3 ] { "soaking wet", 12+, <1 }; } /* three
values */
probability ( Rain ) { table 0.2, 0.8; }
probability ( Sprinkler | Rain ) { (yes) 0.01, 0.99; (no) 0.4, 0.6; }
probability ( "Wet grass" | Sprinkler, Rain ) {
  (yes, yes) 0.9, 0.09, 0.01;
  default 0.0, 0.1, 0.9;
  (yes, no) 0.5, 0.4, 0.1;
  (no, yes) 0.4, 0.4, 0.2;
}
"""


def test_a_network_is_a_program():
    network = parse_bif(SPRINKLER, file="lawn.bif")
    assert network.attributes["'Wet grass'"].values == ("'soaking wet'", "12+", "<1")
    expected = Fraction(2, 10) * (Fraction(1, 100) * Fraction(9, 10) + Fraction(99, 100) * Fraction(4, 10))
    soaking = expected + Fraction(8, 10) * Fraction(4, 10) * Fraction(1, 2)
    found = Reasoner(network).exact("Rain", {"'Wet grass'": "'soaking wet'"})
    assert found == {"yes": expected / soaking, "no": 1 - expected / soaking}
    query = parse_query("Rain | obs('Wet grass'='soaking wet')", network)
    assert Reasoner(network).ask(query, exact=True) == found
    assert Enumeration(network).ask(query) == found
    assert str(query) == "?'Rain' | obs('Wet grass'='soaking wet')."


def test_the_text_of_a_network_is_the_same_program():
    network = parse_bif(SPRINKLER)
    program = parse_plog(program_text(network))
    assert program_text(program) == program_text(network)
    assert program.statements == network.statements
    evidence = {"Sprinkler": "no", "'Wet grass'": "12+"}
    assert Reasoner(program).exact("Rain", evidence) == Reasoner(network).exact("Rain", evidence)


def test_a_flat_table_has_the_values_of_the_variable_itself_slowest():
    """The example of the format: P(light-on | family-out)."""
    network = parse_bif(
        "variable light-on { type discrete [2] { true, false }; }"
        "variable family-out { type discrete [2] { true, false }; }"
        "probability ( family-out ) { table 0.15 0.85; }"
        "probability ( light-on | family-out ) { table 0.6 0.05 0.4 0.95; }"
    )
    assert Reasoner(network).exact("light-on", {"family-out": "true"})["true"] == Fraction(3, 5)
    assert Reasoner(network).exact("light-on", {"family-out": False})["true"] == Fraction(1, 20)


def test_a_sum_that_misses_one_by_rounding_is_divided_by_it_and_named_once():
    text = (
        "variable a { type discrete [3] { x, y, z }; } variable b { type discrete [2] { x, y }; }\n"
        "probability ( a ) { table 0.3333, 0.3333, 0.3333; }\n"
        "probability ( b | a ) { (x) 0.49999, 0.5; (y) 0.5, 0.5; (z) 0.5, 0.5; }"
    )
    with warnings.catch_warnings(record=True) as issued:
        warnings.simplefilter("always")
        network = parse_bif(text, file="rounded.bif")
    (warning,) = issued
    assert warning.category is ReasoningWarning
    assert str(warning.message) == (
        "rounded.bif:2:1: the probabilities of a sum to 0.9999, not 1, and are divided by their sum"
        " (and so 1 other rows)"
    )
    assert set(Reasoner(network).exact("a").values()) == {Fraction(1, 3)}
    assert Reasoner(network).posterior("a")["x"] == pytest.approx(1 / 3, abs=1e-15)
    assert Reasoner(network).exact("b", {"a": "x"})["y"] == Fraction(50000, 99999)


A = "variable a { type discrete [2] { x, y }; }\n"
B = "variable b { type discrete [2] { x, y }; }\n"
PA = "probability ( a ) { table 0.5, 0.5; }\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ": no variable; expected 'variable NAME"),
        (A, ":1:1: a has no table; expected 'probability ( a ) { ... }'"),
        (A + "probability ( a ) { table 0.5, 0.4; }", ":2:21: the probabilities of a sum to 0.9; expected 1"),
        (A + "probability ( a ) { table 1.5, -0.5; }", ":2:21: the probability 1.5 of a is not between"),
        (A + "probability ( a ) { table -0.5, 1.5; }", ":2:21: the probability -0.5 of a is not between"),
        (A + "probability ( a ) { table 0.5, nan; }", ":2:21: the probability nan of a is not between"),
        (A + "probability ( a ) { table 0.5; }", ":2:21: 1 numbers for a; expected 2"),
        (A + "probability ( a ) { table 0.5, 1_0; }", ":2:21: '1_0' is not a number; expected probabilities"),
        (A + "probability ( a ) { table 0.5, half; }", ":2:21: 'half' is not a number"),
        (A + "probability ( a ) { wrong }", ":2:21: unexpected text in the table of a"),
        (A + "probability ( a ) { }", ":2:1: the table of a has no row; expected one for each combination"),
        (A + PA + PA, ":3:1: a has two tables; the first is in line 2"),
        (A + A, ":2:1: a is declared twice; first in line 1"),
        (A + "probability ( c ) { table 1; }", ":2:1: c is not declared; expected one of a"),
        (A + B + PA + "probability ( b | c ) { }", ":4:1: c is not declared; expected one of a, b"),
        (A + B + PA + "probability ( b | a ) { (x) 1, 0; }", ":4:1: the table of b has no row for (y)"),
        (A + B + PA + "probability ( b | a ) {\n(x) 1, 0;\n(z) 1, 0; }", ":6:1: z is not a value"),
        (A + B + PA + "probability ( b | a ) { (x) 1, 0; (x) 1, 0; }", ":4:35: a second row for (x) of b"),
        (A + B + PA + "probability ( b | a ) { (x, y) 1, 0; }", ":4:25: a row with 2 values; expected"),
        (A + B + PA + "probability ( b | a, a ) { }", "names a variable twice; expected different"),
        (A + B + PA + "probability b { }", ":4:1: expected 'probability ( NAME | NAME, ... )'"),
        (A + B + PA + "probability ( b | ) { }", ":4:1: expected one variable before '|'"),
        (
            A + B + "probability ( a | b ) { default 1, 0; }\nprobability ( b | a ) { default 1, 0; }",
            "depends on itself: ",
        ),
        ("variable a { type discrete [3] { x, y }; }", ":1:14: a has 2 values; expected 3"),
        ("variable a { type discrete [3] { x, y, x }; }", ":1:14: a has the value x twice"),
        ("variable a { type real; }", ":1:14: unexpected text in a; expected 'type discrete [ 2 ]"),
        (A + "probability ( a ) { table 0.3, 0.7; table 0.5, 0.5; }", ":2:37: numbers of a again"),
        (A + "probability ( a ) { default 1, 0; default 0, 1; }", ":2:35: numbers of a again"),
        ("variable a { type discrete [1] {x}; type discrete [1] {y}; }", ":1:37: a second type of a"),
        ("variable a { type discrete [2] { x,, y }; }", ":1:14: 2 names and 2 commas; expected one between"),
        ("variable a { type discrete [2] { \"x, y }; }", ":1:14: a quote without its end"),
        (f"variable a {{ type discrete [{'9' * 5000}] {{ x, y }}; }}", ":1:14: a has 2 values; expected 999"),
        ("variable a { }", ":1:1: a has no values"),
        ("variable a b { }", ":1:1: expected the name of one variable, not 'a b'"),
        ("variable a { type discrete [2] { x, y };", ":1:1: the block of this variable does not end"),
        ("variable a", ":1:1: variable without a block; expected '{'"),
        ("a, b : boolean.", ":1:1: unexpected 'a'; expected 'network', 'variable' or 'probability'"),
    ],
)  # fmt: skip
def test_errors_name_the_place_and_what_was_expected(text, message):
    with pytest.raises((ParseError, ProgramError)) as found:
        parse_bif(text, file="bad.bif")
    assert message in str(found.value)
    assert str(found.value).startswith("bad.bif:")


def test_names_in_quotes_have_any_characters():
    network = parse_bif(
        'variable "A{|x" { type discrete [2] { "a (1)", "b}\\"" }; property "p = { ; }"; }'
        "variable 0 { type discrete [2] { 007, 12345678901 }; }"
        'probability ( "A{|x" ) { table 0.25, 0.75; }'
        'probability ( 0 | "A{|x" ) { ("a (1)") 1, 0; ("b}\\"") 0.5, 0.5; }'
    )
    assert list(network.attributes) == ["'A{|x'", "'0'"]
    assert network.attributes["'A{|x'"].values == ("'a (1)'", "'b}\"'")
    assert network.attributes["'0'"].values == ("'007'", "'12345678901'")
    found = Reasoner(network).exact("'A{|x'", {"'0'": "'007'"})
    assert found["'a (1)'"] == Fraction(2, 5)
    assert Reasoner(network).ask(parse_query("'A{|x' | obs('0'='007')", network), exact=True) == found
    program = parse_plog(program_text(network))
    assert list(program.attributes) == list(network.attributes)
    assert Reasoner(program).exact("'A{|x'", {"'0'": "'007'"}) == found


def test_joints_of_names_in_quotes_and_rates_of_a_classifier():
    network = parse_bif(
        "variable X-ray { type discrete [2] { LOW, 180+ }; } variable B { type discrete [2] { LOW, a-b }; }"
        "probability ( X-ray ) { table 0.25, 0.75; }"
        "probability ( B | X-ray ) { (LOW) 0.5, 0.5; (180+) 0.1, 0.9; }"
    )
    joint = Reasoner(network).posterior(["X-ray", "B"])
    assert joint["LOW", "a-b"] == pytest.approx(0.125)
    assert Reasoner(network).exact(["X-ray", "B"])["180+", "LOW"] == Fraction(3, 40)
    matrix = ConfusionMatrix(("LOW", "180+"), [[9, 1], [2, 8]])
    measured = with_classifier(network, "B", "X-ray", matrix, {"LOW": "LOW", "180+": "a-b"}, smoothing=0)
    assert Reasoner(measured).exact("B", {"X-ray": "180+"})["a-b"] == Fraction(4, 5)


def test_a_file_is_read_by_its_suffix(tmp_path):
    (tmp_path / "lawn.BIF").write_text(SPRINKLER)
    network = read_plog(tmp_path / "lawn.BIF")
    assert pickle.loads(pickle.dumps(network)) == network
    assert network != parse_bif(SPRINKLER.replace("0.2, 0.8", "0.3, 0.7"))
    assert repr(network).startswith("<Program ")


def test_names_keep_their_text_unless_it_would_mean_something_else():
    for name in ("plain", "HISTORY", "12+", "<7.5", "Asy/Patch", "5-12"):
        assert make_name_text(name) == make_value_text(name) == name
    for name in ("a b", "f(1)", "a,b", "007", "not", "do", "it's", "a\\b", "²", "", "12345678901"):
        text = make_name_text(name)
        assert text.startswith("'"), name
        assert make_value_text(name) == unquote(text) == write_name(text) == text
    assert [make_value_text(name) for name in ("0", "-3")] == ["0", "-3"]
    assert [make_name_text(name) for name in ("0", "-3")] == ["'0'", "'-3'"]
    written = [write_name(text) for text in ("plain", "HISTORY", "12", "-3", "12+")]
    assert written == ["plain", "'HISTORY'", "12", "-3", "'12+'"]
    assert not is_quoted("plain")
    assert is_quoted("HISTORY")


def test_quoted_names_in_a_program():
    program = parse_plog("level = {'LOW', 'very high', 3}. 'HR' : level. random('HR'). pr('HR'='LOW') = 1/2.")
    reasoner = Reasoner(program)
    assert reasoner.exact("HR") == {"LOW": Fraction(1, 2), "'very high'": Fraction(1, 4), "3": Fraction(1, 4)}
    assert reasoner.ask(parse_query("HR=LOW | obs('HR'!='very high')", program), exact=True) == Fraction(2, 3)
    assert parse_plog(program_text(program)) == program

"""Lower and upper probabilities: known answers, the definition by all answer sets, refusals by name."""

import logging
from collections import defaultdict
from itertools import product
from random import Random

import clingo
import pytest

from lcorpp.errors import ParseError, ProgramError, TooLargeError, UndefinedError
from lcorpp.reasoning import bound_probability, parse_credal_program, parse_query

KNOWN = [
    # the four birds of PASTA's paper: at least 60 % of them fly
    (
        "0.5::bird(1..4). 0{fly(X)}1 :- bird(X)."
        ":- #count{X:fly(X),bird(X)} = FB, #count{X:bird(X)} = B, 10*FB<6*B.",
        "fly(1)",
        (0.25, 0.5, 0),
    ),
    ("0.4::sun. 0.6::wind. run :- not walk, sun, not wind. walk :- not run.", "run", (0, 0.16, 0)),
    ("0.6::a1. 0.5::a2. a :- a1. b :- not a1, a2. f :- a. {f} :- b.", "f", (0.6, 0.8, 0)),
    ("0.2::a; 0.3::b. c :- a. {c} :- b.", "c", (0.2, 0.5, 0)),
    ("0.2::a; 0.8::b. c ; d :- a. c :- b.", "d", (0, 0.2, 0)),
    # a total choice without answer set is left out, and named
    ("0.5::a. 0.5::b. c :- a, not c. {d} :- b.", "d", (0, 0.5, 0.5)),
    # what a rule derives, too, leaves the choice as it is
    ("0.3::a. 0.4::b. a :- b.", "a", (0.58, 0.58, 0)),
    ("0.5::a(1). 0.5::a(2). q :- a(X). r :- not q.", "q, not r", (0.75, 0.75, 0)),
    ("{a}.", "a", (0, 1, 0)),
    # heads of disjunctions that other rules derive, or other choices
    ("0.2::a; 0.3::b. a :- c. {c}.", "a", (0.2, 1, 0)),
    ("0.5::a; 0.5::b. 0.3::a. {c} :- a.", "a", (0.65, 0.65, 0)),
    ("0.5::a; 0.5::b. 0.5::a; 0.5::c. {d} :- a.", "a", (0.75, 0.75, 0)),
    ("0.5::a; 0.5::b. b :- a. {d} :- a.", "b", (1, 1, 0)),
    ("0.2::a; 0.3::a. {c} :- a.", "a", (0.5, 0.5, 0)),
    ("0.25::f(1..2).{a}:-f(1).0.5::b.a:-b.", "a", (0.5, 0.625, 0)),
]


@pytest.mark.parametrize(("text", "query", "expected"), KNOWN, ids=range(len(KNOWN)))
def test_known_bounds(text, query, expected, caplog):
    caplog.set_level(logging.CRITICAL)
    program = parse_credal_program(text)
    assert bound_probability(program, parse_query(f"{{{query}}}", program.program)) == pytest.approx(expected)


def test_observations_are_conditions():
    """P(a | e): of the choices with e in some answer set; Cozman and Maua's example of two disjunctions."""
    program = parse_credal_program(
        "a0 ; b :- v0. a1 ; c :- v1. 0.5::v0. 0.5::v1. a :- a0. a :- a1. ev :- a, c."
    )
    query = parse_query("{a} | obs(ev)", program.program)
    assert bound_probability(program, query) == pytest.approx((1, 1, 0))
    bounds = bound_probability(program, parse_query("{c} | obs(a)", program.program))
    assert bounds == pytest.approx((0, 1, 0))  # in no choice do all answer sets have a without c


def list_bounds(facts, rules, query):
    """Compute the bounds of an atom by clingo's answer sets of each total choice."""
    lower = upper = mass = 0.0
    for signs in product((False, True), repeat=len(facts)):
        weight, text = 1.0, rules
        for (atom, p), sign in zip(facts.items(), signs, strict=True):
            weight *= p if sign else 1 - p
            text += f" {atom}." if sign else ""
        control = clingo.Control(["0"], lambda *_: None)
        control.add("base", [], text)
        control.ground([("base", [])])
        found = []
        with control.solve(yield_=True) as models:
            found += [query in map(str, model.symbols(atoms=True)) for model in models]
        mass += weight * bool(found)
        lower += weight * (bool(found) and all(found))
        upper += weight * any(found)
    return lower / mass, upper / mass, 1 - mass


def test_random_programs_are_as_their_answer_sets(caplog):
    caplog.set_level(logging.CRITICAL)
    counts = defaultdict(int)
    for seed in range(150):
        rng = Random(seed)
        facts = {f"f({i})": rng.choice((0.1, 0.5, 0.7)) for i in range(rng.randint(1, 4))}
        atoms = [*facts, "a", "b", "c"]
        rules = ""
        for _ in range(rng.randint(2, 6)):
            head = rng.choice(("a", "b", "c", "{a}", "{b}", "a ; b", "f(0)", ""))
            body = [rng.choice(("", "not ")) + atom for atom in rng.sample(atoms, rng.randint(1, 2))]
            rules += f"{head} :- {', '.join(body)}. "
        text = " ".join(f"{p}::{atom}." for atom, p in facts.items())
        try:
            program = parse_credal_program(f"{text} {rules} a :- a, b.")
        except ParseError:  # a disjunction whose heads depend on each other
            counts["refused"] += 1
            continue
        if "a" not in program.program.attributes:
            continue
        try:
            expected = list_bounds(facts, rules, "a")
        except ZeroDivisionError:
            with pytest.raises(UndefinedError):
                bound_probability(program, parse_query("{a}", program.program))
            continue
        found = bound_probability(program, parse_query("{a}", program.program))
        assert found == pytest.approx(expected, abs=1e-9), (text, rules)
        counts[found.lower < found.upper] += 1
    assert min(counts[True], counts[False]) > 10
    assert counts["refused"] < 10


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("abducible a.", "1:1", "an abducible atom (PASTA) is not translated"),
        ("0.5::a.\nmap 0.4::b.", "2:1", "'map' (PASTA), is not translated"),
        ("(f(X) | b(X))[0.6,1].", "1:1", "a conditional, (a | b)[0.6,1] (PASTA), is not translated"),
        ("[0.1,0.2]::a.", "1:1", "an interval as a probability"),
        ("0.5::a. evidence(a).", "1:9", "expected a query with obs(a)"),
        ("0.5::c(1). query(c(1)),query(c(2)).", "1:12", "is no atom"),
        ("0.2::\u00e4. {c}.", "1:6", "unexpected character"),
        ("decision a.", "1:1", "a decision with answer sets (PASTA)"),
        ("optimizable [0,0.3]::a.", "1:1", "an optimizable fact (PASTA)"),
        ("a:gaussian(0,1).", "1:1", "a density (PASTA)"),
        ("0.3 :- a, b.", "1:1", "a constraint with a probability"),
        ("0.6::a; 0.5::b.", "1:1", "the probabilities sum to 1.1; expected at most 1"),
        ("1.5::a.", "1:1", "the probability 1.5 is not between 0 and 1"),
        ("0.5::a; b.", "1:1", "a disjunction needs a probability for each head, or for none"),
        ("{b}. 0.5::a(X) :- b, c(X). c(1).", "1:6", "which depends on chance, is not translated"),
    ],
)
def test_refusals_name_the_construct(text, place, words):
    with pytest.raises(ParseError) as caught:
        parse_credal_program(text, file="x.lp")
    message = str(caught.value).splitlines()[0]
    assert message.startswith(f"x.lp:{place}: ")
    assert words in message


def test_queries_of_a_program_and_texts():
    program = parse_credal_program('0.5::a. query(a). query(b). {b} :- a. c("0.5::d."). % 0.1::e. query(f).')
    assert [str(query) for query in program.program.queries] == ["?{a=true}.", "?{b=true}."]
    assert len(program.choices) == 1


def test_what_bounds_cannot_answer():
    program = parse_credal_program("0.5::a. {b} :- a.")
    with pytest.raises(ProgramError, match="bounds are of one conjunction"):
        bound_probability(program, parse_query("{a or b}", program.program))
    with pytest.raises(UndefinedError, match="no answer set has the observations"):
        bound_probability(program, parse_query("{a} | obs(b), obs(not a)", program.program))
    many = parse_credal_program("0.5::a(1..21). b :- a(1).")
    with pytest.raises(TooLargeError, match="2097152 combinations"):
        bound_probability(many, parse_query("{b}", many.program))

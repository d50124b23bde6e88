"""Programs of plingo and LPMLN: known answers, the definition of LPMLN by brute force, refusals by name."""

import logging
from fractions import Fraction
from math import exp
from random import Random

import pytest
from tests.reasoning.language.answer_set_models import make_random_rules, weigh_models

from lcorpp import parse_plog, read_plog
from lcorpp.errors import ParseError, UndefinedError
from lcorpp.reasoning import Reasoner, ask, parse_query
from lcorpp.reasoning.language.answer_sets.asp_weights import compute_factor
from lcorpp.reasoning.language.parser import parse_answer_sets

E, E2 = exp(1), exp(2)

BIRDS = """
bird(X) :- residentBird(X).
bird(X) :- migratoryBird(X).
:- residentBird(X), migratoryBird(X).
residentBird(jo) :- &weight(2).
migratoryBird(jo) :- &weight(1).
"""

ALARM = """
burglary :- &problog("0.1").
earthquake :- &problog("0.2").
hears_alarm(X) :- person(X), &problog("0.7").
alarm :- burglary.
alarm :- earthquake.
calls(X) :- alarm, hears_alarm(X).
person(mary). person(john).
&evidence(alarm,true).
"""

MONTY_HALL = """
door(1..3).
-canopen(D) :- selected(D).
-canopen(D) :- prize(D).
canopen(D)  :- not -canopen(D), door(D).
&random { prize(D)    : door(D)    }.
&random { selected(D) : door(D)    }.
&random { open(D)     : canopen(D) }.
&obs { selected(1) }.
&obs { open(2)     }.
&obs { prize(2)    } = false.
"""

DICE = """
dice(d1;d2). score(1..6). person(mike;john). owns(d1,mike). owns(d2,john).
&random(r1(D)) { roll(D,X) : score(X) } :- dice(D).
&pr(r1(D)) { roll(D,X) } = "1/6"  :- owns(D,john), score(X).
&pr(r1(D)) { roll(D,6) } = "1/4"  :- owns(D,mike).
&pr(r1(D)) { roll(D,X) } = "3/20" :- owns(D,mike), score(X), X != 6.
&obs{ roll(d2,1) }.
"""

SQUIRREL = """
patch(p1;p2). boolean(t;f). #const days = 3. day(1..days).
found(P,D,f) :- not found(P,D,t), patch(P), day(D).
&random { hidden_in(P) : patch(P) }.
&random { found(P,D,B) : boolean(B) } :- hidden_in(P), look(D,P).
&pr { hidden_in(p1) } = "0.8".
&pr { found(P,D,t) } = "0.2" :- patch(P), day(D).
look(D,p1) :- day(D).
&obs { found(p1,D,f) } :- day(D), D < days.
found(P,D) :- found(P,D,t).
"""

ROBOT = """
time(0;1). rooms(r0;r1;r2). go_in(r0). break.
in(1,R) :- go_in(R), not ab.
ab :- break.
open(R) :- not -open(R), rooms(R).
&random { in(1,R) : open(R) } :- go_in(_), break.
&pr { in(1,R) } = "1/2" :- go_in(R), break.
"""

KNOWN = [
    (BIRDS, "residentBird(jo)", E2 / (E2 + E + 1)),
    (ALARM, "burglary", 0.1 / 0.28),
    (ALARM, "hears_alarm(mary)", 0.7),
    (MONTY_HALL, "prize = 3", 2 / 3),
    (MONTY_HALL, "prize(1)", 1 / 3),
    (DICE, "roll(d1) = 6", 0.25),
    (DICE, "roll(d2,1)", 1),
    (SQUIRREL, "hidden_in = p1", 0.8 * 0.64 / (0.8 * 0.64 + 0.2)),
    (ROBOT, "in(1,r0)", 0.5),
    (ROBOT, "in(1) = r2", 0.25),
    # choices and weak constraints: each coin has heads with equal weight, not both
    (
        "{ heads(C) } :- C=1..2. :~ not heads(C), C=1..2. [0@0,0,(C,)] :- heads(1), heads(2).",
        "heads(1)",
        1 / 3,
    ),
    ('{a}. :~ not a. ["2"@0,0]', "a", 1 / (1 + E2)),
    ("{a;b} = 1. :~ a. [1,a]", "a", E / (E + 1)),
    # the same tuple counts once, two tuples twice
    ("{a}. {b}. :~ a. [1,t] :~ b. [1,t]", "a", 2 * E / (3 * E + 1)),
    ("{a}. {b}. :~ a. [1,t] :~ b. [1,u]", "a", E / (E + 1)),
    # several answer sets of one choice have equal weights
    ("a :- not b. b :- not a. c :- a, &weight(1).", "a", (E + 1) / (2 * E + 1)),
    # a choice of what a rule derives, too, is one answer set
    ("{b}. {a}. a :- b.", "a", 2 / 3),
    ("{a}. {b}. a :- b. b :- a.", "a", 1 / 2),
    ("{b}. {a} :- b. {a} :- c. {c}.", "a", 3 / 7),
    # disjunctions, aggregates, classical negation
    ("{c}. a ; b :- c.", "a", 1 / 3),
    ("{a(1..3)}. b :- 2 { a(X) }.", "b", 1 / 2),
    ("{a(1..3)}. :- #sum { X : a(X) } > 3.", "a(3)", 1 / 5),
    ("{a}. -a :- not a, b. {b}.", "-a", 1 / 4),
    # an instance for each value of an anonymous variable
    ("b(1,1..2). a(X) :- b(X,_), &weight(1).", "a(1)", E2 / (E2 + 1)),
    # interventions give no evidence
    (
        'b(t;f). &random { s(B) : b(B) }. &random { c(B) : b(B) }. &pr { s(t) } = "0.3". '
        '&pr { c(t) } = "0.9" :- s(t). &pr { c(t) } = "0.2" :- s(f). &do { c(t) }.',
        "s = t",
        0.3,
    ),
    (
        'b(t;f). &random { s(B) : b(B) }. &random { c(B) : b(B) }. &pr { s(t) } = "0.3". '
        '&pr { c(t) } = "0.9" :- s(t). &pr { c(t) } = "0.2" :- s(f). &obs { c(t) }.',
        "s = t",
        0.27 / 0.41,
    ),
    # an intervention makes the other values of its experiment false, also where a rule derives them
    ("d(1..2). &random { f(X) : d(X) }. f(2) :- a. {a}. &do { f(1) }.", "a", 0),
    # a number without quotes is a fraction, not a division of integers
    ("d(1..2). &random { f(X) : d(X) }. &pr { f(1) } = 1/4.", "f = 1", 0.25),
    # one weight and tuple count once, however they are written
    ('{a;b}. :~ a. [1@0,t] :~ b. ["1.0"@0,t]', "a", 2 * E / (3 * E + 1)),
    ("a; b. a; c :- b. {d} :- b.", "a", 1 / 3),
    ("not a :- &weight(2). {a}.", "a", 1 / (1 + E2)),
    ("not not a :- &weight(2). {a}.", "a", E2 / (1 + E2)),
    ("{a'(1)}.", "a'(1)", 1 / 2),
    ("{p(-1..1)}. a :- #sum+ { X : p(X) } >= 1.", "a", 1 / 2),
]


def answer(program, formula):
    return float(ask(program, parse_query(f"{{{formula}}}", program)))


@pytest.mark.parametrize(("text", "query", "expected"), KNOWN, ids=range(len(KNOWN)))
def test_known_answers(text, query, expected, caplog):
    caplog.set_level(logging.CRITICAL)
    program = parse_answer_sets(text)
    assert answer(program, query) == pytest.approx(expected, abs=1e-12)


def test_the_same_in_p_log(caplog):
    """Four doors with given probabilities: as P-log, its terms have the same marginals."""
    own = parse_plog("""
        doors = {1..4}. prize, selected, open : doors. canopen : doors -> boolean.
        random(prize). random(selected). random(open : {X : canopen(X)}).
        -canopen(D) :- selected = D. -canopen(D) :- prize = D. canopen(D) :- not -canopen(D).
        pr(prize = 1) = 0.3. pr(prize = 3) = 0.2. obs(selected = 1). obs(open = 2). obs(prize != 2).
    """)
    theirs = parse_answer_sets(
        MONTY_HALL.replace("1..3", "1..4") + '&pr { prize(1) } = "0.3". &pr { prize(3) } = "0.2".'
    )
    assert Reasoner(theirs).exact("prize") == Reasoner(own).exact("prize")
    assert Reasoner(theirs).exact("prize")["4"] == Fraction(5, 13)


def compare_with_brute_force(seed: int, n_atoms: int) -> bool:
    """Compare all atoms; return whether the program has models."""
    rng = Random(seed)
    rules, atoms = make_random_rules(rng, rng.randint(2, n_atoms))
    text = "\n".join(rule.write() for rule in rules)
    weights = weigh_models(rules, atoms)
    total = sum(weights.values())
    program = parse_answer_sets(text)
    reasoner = Reasoner(program)
    for atom in atoms:
        own = sum(weight for model, weight in weights.items() if atom in model)
        try:
            query = parse_query(f"{{{atom}}}", program)
        except ParseError:  # no rule derives it
            assert own == 0, text
            continue
        if total == 0:
            with pytest.raises(UndefinedError):
                reasoner.ask(query)
        else:
            assert float(reasoner.ask(query)) == pytest.approx(own / total, abs=1e-9), (text, atom)
    return total > 0


def test_random_programs_are_as_the_definition_of_lpmln(caplog):
    caplog.set_level(logging.CRITICAL)
    assert sum(compare_with_brute_force(seed, 7) for seed in range(100)) > 80


@pytest.mark.slow
def test_many_random_programs_are_as_the_definition_of_lpmln(caplog):
    caplog.set_level(logging.CRITICAL)
    assert sum(compare_with_brute_force(seed, 8 if seed % 20 else 12) for seed in range(100, 2100)) > 1600


def test_queries_and_shown_atoms_of_a_program(tmp_path):
    file = tmp_path / "coins.lp"
    file.write_text(
        'heads(1) :- &problog("1/2"). heads(2) :- &log("3/2"). both :- heads(1), heads(2). #show both/0.\n'
        "&query(both). &query(heads(1), both). &query(heads(X)) :- heads(X)."
    )
    program = read_plog(file)
    assert [float(ask(program, query)) for query in program.queries] == [0.3, 1, 0.5, 0.6]


def test_plingo_is_recognised_by_its_weights_alone():
    assert answer(parse_plog(BIRDS, file="birds.txt"), "bird(jo)") == pytest.approx((E2 + E) / (E2 + E + 1))
    own = parse_plog("a : boolean. random(a). pr(a) = 1/4.", file="own.lp")  # the suffix alone is no mark
    assert answer(own, "a") == 0.25


def test_evidence_is_more_rules():
    program = parse_answer_sets(BIRDS, facts=":- not migratoryBird(jo).")
    assert answer(program, "residentBird(jo)") == 0
    with pytest.raises(ParseError, match=r"e\.evid:2:7: syntax error"):
        parse_answer_sets(BIRDS, facts="\n:- not.", facts_file="e.evid")


def test_a_text_and_a_compound_term_are_names():
    program = parse_answer_sets('{at(f(1,"a b"),-3)}. &query(at(f(1,"a b"),-3)).')
    assert float(ask(program, program.queries[0])) == 0.5


REFUSED = [
    ("a :- b(X), not c(Y).", "1:1", "unsafe"),
    ("a :- b c.", "1:8", "syntax error"),
    ("n(0). n(X+1) :- n(X).", "1:1", "more than 200000 ground rules, or no end of them"),
    ("p(a). q(X+1) :- p(X).", "1:7", "operation undefined"),
    ("\n#script (python)\n#end.", "2:1", "#script is not translated"),
    ("#external a.", "1:1", "#external is not translated"),
    ('#include "other.lp".', "1:1", "#include is not translated"),
    ("a :- b(@f(1)).", "1:1", "the function @f of a script is not translated"),
    ("{a}. :~ a. [1@2]", "1:6", "a weak constraint of priority 2 is not translated"),
    ('a :- &weight("nan").', "1:1", "'nan'; expected a number, such as 0.3 or 2/3"),
    ('a :- &weight("1/0").', "1:1", "divides by zero"),
    ("a :- &weight(601).", "1:1", "the weight 601; expected at most 600"),
    ('a :- &problog("1").', "1:1", "the probability 1 is not between 0 and 1"),
    ('a :- &log("0").', "1:1", "the logarithm of 0; expected a positive number"),
    ("a :- &weight(1), &weight(2).", "1:1", "a rule with two weights"),
    ("a ; b :- &weight(1).", "1:1", "a soft rule with a disjunction in its head is not translated"),
    ("a ; b. a :- b. b :- a.", "1:1", "the heads of the disjunction a ; b depend on each other"),
    ("&sum { x } > 1.", "1:1", "&sum is not translated; expected one of &random"),
    ("&obs { a } = maybe.", "1:1", "expected true or false"),
    ("&random { a : b }.", "1:1", "has no argument; expected one with the value last"),
    ('b(1). &random { a(X) : b(X) }. &pr { a(1) } = "3/2".', "1:1", "expected a probability from 0 to 1"),
    ("#program step(t).", "1:1", "#program step is not translated"),
    ("lcorpp'soft(1).", "1:1", "is reserved"),
    ("a(Lcorpp'1) :- b(Lcorpp'1).", "1:1", "is reserved"),
    ("{a}.\n\u00e4.", "2:1", "unexpected character '\u00e4'; other letters need quotes"),
    ('{a}. #include "x.lp".', "1:6", "#include is not translated"),
    ("a; b. a; c :- b. b; d :- a.", "1:1", "depend on each other"),
    ("{b}. d(1..3). &random { f(X) : d(X) }. &do { f(1) } :- b.", "1:1", "&do { f(1) } depends on chance"),
    ("d(1..3). &random { f(X) : d(X) }. &do { f(4) }.", "1:1", "&do outside of the range"),
    ("&obs { a } != true.", "1:1", "&obs with '!=' is not translated"),
    ("&evidence(a) { b }.", "1:1", "&evidence has no braces"),
    ('a :- &weight("1e400").', "1:1", "the weight 1e400; expected at most 600"),
    ('a :- &weight("1e999999999").', "1:1", "is too large"),
    ('a :- &log("1e5000").', "1:1", "is too large"),
    ('a :- &problog("1e-5000").', "1:1", "is too large"),
    (f"b :- {', '.join(['a(1;2)'] * 20)}.", "1:1", "its pools stand for more than 100000 rules"),
    ("{p(1..1000)}. a :- 500 #count { X : p(X) }.", "1:1", "partial sums"),
]


@pytest.mark.parametrize(("text", "place", "words"), REFUSED, ids=range(len(REFUSED)))
def test_refusals_name_the_construct_and_the_place(text, place, words):
    with pytest.raises(ParseError) as caught:
        parse_answer_sets(text, file="x.lp")
    message = str(caught.value).splitlines()[0]
    assert message.startswith(f"x.lp:{place}: ")
    assert words in message


def test_weights_are_exact():
    assert compute_factor("problog", "0.1") == Fraction(1, 9)
    assert compute_factor("log", "0.7/0.3") == Fraction(7, 3)
    assert compute_factor("weight", "-(1+1)/4") == Fraction(exp(-0.5))
    assert compute_factor("weight", "log(3) + 2**2") == pytest.approx(3 * exp(4))
    for text in ("", "x", "__import__('os')", "1 if 1 else 2", "10**1000", "+" * 50 + "1", "1j"):
        with pytest.raises(ValueError, match=r"expected a number|characters|too large"):
            compute_factor("weight", text)


def test_facts_are_certain_and_other_atoms_are_false():
    program = parse_answer_sets("a. {b}. c :- b.")
    reasoner = Reasoner(program)
    assert reasoner.exact("c") == {"true": Fraction(1, 2), "false": Fraction(1, 2)}
    assert reasoner.exact("a")["true"] == 1


def test_contradictions_leave_no_world():
    program = parse_answer_sets("{a}. :- a. :- not a.")
    with pytest.raises(UndefinedError):
        Reasoner(program).posterior("a")

"""Programs of ProbLog with answers known by hand, and refusals of ProbLog and plingo by name."""

from __future__ import annotations

from fractions import Fraction

import pytest

from lcorpp.errors import ParseError, ProgramError, UndefinedError
from lcorpp.fitting import fit
from lcorpp.reasoning import Enumeration, Reasoner, parse_plog, program_text

ANSWERS = [
    # a fact, and noisy-or of two equal facts: 1 - 1/2 * 1/2
    ("1/2::a. query(a).", "1/2"),
    ("0.5::a. 0.5::a. query(a).", "3/4"),
    # one choice for each instance, also of a variable that only the body has
    ("b(1). b(2). 0.5::a :- b(X). query(a).", "3/4"),
    ("b(1). b(2). 0.5::a :- b(_). query(a).", "3/4"),
    ("b(1). b(2). 0.5::a(X) :- b(X). c :- a(1), \\+ a(2). query(c). query(a(Y)).", "1/4 1/2 1/2"),
    # annotated disjunctions: what remains is none of them; a value may come twice
    ("0.3::a; 0.5::b. c :- \\+a, \\+b. query(a). query(b). query(c).", "3/10 1/2 1/5"),
    ("0.3::a; 0.5::a. query(a).", "4/5"),
    ("1/3::p(1); 1/3::p(2); 1/3::p(3). q :- p(X), X > 1. query(q). evidence(\\+ p(2)).", "1/2"),
    ("0.4::c. 0.5::a; 0.5::b :- c. query(a). query(b). evidence(b, false).", "1/4 0"),
    # the choice of the alternative does not depend on the uncertain goal: b follows from a, a from b
    ("0.5::b. 0.5::a :- b. b :- a. query(b). query(a).", "1/2 1/4"),
    # positive cycles: a path from 1 to 3 exists, 1 - (1 - 1/2 * 1/2) * (1 - 1/2)
    (
        "0.5::e(1,2). 0.5::e(2,3). 0.5::e(1,3). 0.5::e(2,1). 0.5::e(3,2)."
        "p(X,Y) :- e(X,Y). p(X,Y) :- e(X,Z), p(Z,Y). query(p(1,3)).",
        "5/8",
    ),
    # negation through time: 1/2, then 1/2 * 1/4 + 1/2 * 3/4
    (
        "0.5::r(0). 0.25::r(T) :- n(S,T), r(S). 0.75::r(T) :- n(S,T), \\+ r(S). n(0,1). n(1,2). query(r(1)).",
        "1/2",
    ),
    # names that P-log reserves or cannot overload, and a constant with the name of a predicate
    ("0.5::random(a). 0.5::a. pr :- a, random(a). query(pr).", "1/4"),
    ("0.5::p(a). 0.5::p(a,b). p :- p(X), p(X,Y). query(p). query(p(Z,b)).", "1/4 1/2"),
    # comparisons, comments, evidence, certain choices, a goal that never succeeds
    ("% 0.1::c.\n/* a\n b */ 0.5::p(1). 0.5::p(2). q :- p(X), X =< 1, X =\\= 2, X \\== 3. query(q).", "1/2"),
    ("0::a. 1.0::b. c :- b, \\+ a. d(X) :- e(X), d(X). e(1). query(c). query(d(1)). query(a).", "1 0 0"),
    ("0.5::a. b :- a. evidence(b). query(a).", "1"),
]


@pytest.mark.parametrize(("text", "expected"), ANSWERS, ids=range(len(ANSWERS)))
def test_answers_known_by_hand(text: str, expected: str) -> None:
    program = parse_plog(text, file="program.pl")
    enumeration, reasoner = Enumeration(program), Reasoner(program)
    assert [enumeration.ask(query) for query in program.queries] == [Fraction(n) for n in expected.split()]
    assert [reasoner.ask(query, exact=True) for query in program.queries] == list(
        map(enumeration.ask, program.queries)
    )
    assert parse_plog(program_text(program)) == program


def test_the_alarm_of_the_problog_tutorial() -> None:
    program = parse_plog("""
        0.7::burglary.  0.2::earthquake.
        0.9::alarm :- burglary, earthquake.
        0.8::alarm :- burglary, \\+earthquake.
        0.1::alarm :- \\+burglary, earthquake.
        0.8::calls(X) :- alarm, person(X).
        0.1::calls(X) :- \\+alarm, person(X).
        person(john).  person(mary).
        evidence(calls(john), true).  evidence(calls(mary), true).
        query(burglary).  query(earthquake).""")
    alarm = {(1, 1): 0.9, (1, 0): 0.8, (0, 1): 0.1, (0, 0): 0.0}
    weights = {
        (b, e): (0.7 if b else 0.3) * (0.2 if e else 0.8) * (p * 0.8**2 + (1 - p) * 0.1**2)
        for (b, e), p in alarm.items()
    }
    burglary, earthquake = (
        sum(weight for key, weight in weights.items() if key[index]) / sum(weights.values())
        for index in (0, 1)
    )
    reasoner = Reasoner(program)
    answers = [reasoner.ask(query) for query in program.queries]
    assert answers == pytest.approx([burglary, earthquake], abs=1e-12)


def test_impossible_evidence() -> None:
    program = parse_plog("0.5::a. b :- a. evidence(b). evidence(\\+a). query(a).")
    with pytest.raises(UndefinedError):
        Reasoner(program).ask(program.queries[0])


def test_facts_remain_readable() -> None:
    program = parse_plog("person(ann). 0.25::away(X) :- person(X). 0.4::meets(ann,bob). query(away(ann)).")
    assert program_text(program).splitlines()[-6:] == [
        "person(ann)=true.",
        "random(away(X)) :- person(X)=true.",
        "pr(away(X)=true) = 1/4.",
        "random(meets(ann,bob)).",
        "pr(meets(ann,bob)=true) = 2/5.",
        "?{away(ann)=true}.",
    ]


REFUSED = [
    ("0.3::a(X) :- member(X,[1,2]).", "1:23", "ProbLog", "a list is not translated"),
    ("a :- X is 1+2, b(X). 0.3::b(3).", "1:8", "ProbLog", "the arithmetic of 'is' is not translated"),
    ("P::a(X) :- w(X,P).", "1:2", "ProbLog", "a probability that is not a number"),
    ("X/2::a(X) :- w(X).", "1:4", "ProbLog", "a probability that is not a number"),
    ("a/2::b.", "1:1", "ProbLog", "a is not a number"),
    (":- use_module(library(lists)).\n0.3::a.", "1:1", "ProbLog", "a directive is not translated"),
    ("0.3::a. b :- a; c.", "1:15", "ProbLog", "a disjunction in a body"),
    ("0.3::a. b :- (a -> c; d).", "1:17", "ProbLog", "if-then-else is not translated"),
    ("a; b. 0.3::c.", "1:1", "ProbLog", "a disjunction in a head without probabilities"),
    ("?::a.", "1:1", "ProbLog", "a decision (DTProbLog)"),
    ("0.3::a(f(b)).", "1:8", "ProbLog", "the compound term f(b) is not translated"),
    ("0.3::'A b'.", "1:6", "ProbLog", "a quoted name"),
    ("0.3::a. b :- findall(X,a,L).", "1:14", "ProbLog", "findall/3 has no clause; builtin and library"),
    ("query(a).", "1:7", "ProbLog", "a/0 has no clause"),
    ("0.6::a; 0.6::b.", "1:1", "ProbLog", "the probabilities 3/5, 3/5 are negative or exceed 1"),
    ("0.3::p(1). q(X) :- \\+ p(X).", "1:20", "ProbLog", "the variable X must occur in a positive goal to"),
    ("0.3::p(1). q :- \\+ p(_).", "1:17", "ProbLog", "the variable _1 must occur"),
    ("0.3::p(X).", "1:6", "ProbLog", "the variable X must occur"),
    ("0.3::p(1). evidence(p(X)).", "1:12", "ProbLog", "evidence with the variable X"),
    ("0.3::p(1). query(p(1) = 2).", "1:18", "ProbLog", "the comparison p(1)=2 of a constant"),
    ("0.3::p(1). 0.2::q(X) :- p(X), 2 = X, X.", "1:38", "ProbLog", "expected a literal, not X"),
    ("&random { prize(D) : door(D) }. door(1..3).", "1:1", "plingo", "expected random(f(D) : {X : p(X)})"),
    ("door(1..3).\n&pr { prize(1) } = \"0.3\".", "2:1", "plingo", "&pr is not translated; expected pr("),
    ("a(X) :- b(X), &weight(5).", "1:15", "plingo", "as P-log has no weights"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "place", "system", "words"), REFUSED, ids=range(len(REFUSED)))
def test_refusals_name_the_system_and_the_construct(text: str, place: str, system: str, words: str) -> None:
    with pytest.raises(ParseError) as caught:
        parse_plog(text, file="x.pl")
    message = str(caught.value).splitlines()[0]
    assert message.startswith(f"x.pl:{place}: this is a {system} program: ")
    assert words in message
    assert message.endswith("; see docs/coming-from.md")


@pytest.mark.parametrize(
    "text",
    ["p : boolean. random(p). p :: q.", "query : boolean. random(query). query(1).", "s = {a. % 0.3::b."],
)
def test_errors_in_p_log_are_reported_as_such(text: str) -> None:
    with pytest.raises((ParseError, ProgramError)) as caught:
        parse_plog(text)
    assert "program: " not in str(caught.value)


def test_many_instances_of_a_query_are_refused() -> None:
    facts = " ".join(f"0.5::p({number})." for number in range(101))
    with pytest.raises(ParseError, match="the query has 10201 instances; expected at most 10000"):
        parse_plog(f"{facts} q(X,Y) :- p(X), p(Y). query(q(X,Y)).")


def test_fitted_numbers_are_not_written_into_a_problog_text() -> None:
    text = "0.5::a.\n"
    result = fit(parse_plog(text), [{"a": "true"}, {"a": "false"}, {"a": "true"}])
    with pytest.raises(ProgramError, match="expected the pr-atom of the program"):
        result.rewrite(text)

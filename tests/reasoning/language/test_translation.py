"""Programs of ProbLog with answers known by hand, and refusals by name."""

from __future__ import annotations

import pickle
from fractions import Fraction

import pytest

from lcorpp.errors import ParseError, ProgramError, UndefinedError
from lcorpp.fitting import fit
from lcorpp.reasoning import Enumeration, Reasoner, ReasoningWarning, parse_plog, program_text
from lcorpp.reasoning.language.translation import tabling
from lcorpp.reasoning.language.translation.names import is_auxiliary, restore_names

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
    # arithmetic: / divides exactly, // rounds down, mod has the sign of the divisor; = and == compare terms
    ("n(3). n(4). 0.5::a(X) :- n(X). h(X) :- a(X), 2 =:= X / 2. query(h(3)). query(h(4)).", "0 1/2"),
    ("n(3). 0.5::a(X) :- n(X). h :- a(X), X // 2 =:= 1, -X // 2 =:= -2, X / 2 > 1. query(h).", "1/2"),
    (
        "n(-5). 0.5::a(X) :- n(X). h :- a(X), 1 =:= X mod 3, -1 =:= 5 rem -3, X div 2 < X / 2. query(h).",
        "1/2",
    ),
    ("n(1). n(2). 0.5::a(X) :- n(X). h(X,Y) :- a(X), n(Y), X = Y+1. query(h(2,1)).", "0"),
    ("n(1). n(2). 0.5::a(X) :- n(X). h :- a(X), n(Y), X == Y*1. query(h).", "0"),
    ("n(1). n(2). 0.5::a(X) :- n(X). h(X,Y) :- a(X), n(Y), X \\= Y+1, X \\== Y+1. query(h(2,1)).", "1/2"),
    (
        "0.5::a(2). h :- a(X), X =:= 2.0, X \\== 2.0, Y is 4 / 2, Y = 2.0, Z is 4 // 2, Z = X. query(h).",
        "1/2",
    ),
    (
        "0.5::a(1.5). 0.5::a(2). h(X) :- a(Y), X is 2 * Y. query(h(3)). query(h(3.0)). query(h(4)).",
        "0 1/2 1/2",
    ),
    (
        "0.5::a(-3). h(A,B,C,D) :- a(X), A is abs(X) ** 2, B is sign(X), C is truncate(X / 2), D is -2^2."
        "query(h(9,-1,-1,4)).",
        "1/2",
    ),
    ("0.5::a(2). h(X) :- a(Y), X is max(Y, 1.0) + min(3, Y) - -Y * 2. query(h(8)).", "1/2"),
    ("0.5::a(1). 0.5::a(5). h :- a(X), between(0, 3, X), \\+ X > 2, not X < 1. query(h).", "1/2"),
    (
        "0.5::a(1+1). h :- a(X), X =:= 2, X \\= 2. h(X+1) :- a(1+X). query(h). query(h(1+1)). query(h(2)).",
        "1/2 1/2 0",
    ),
    # recursion that counts down from the query
    ("0.5::s(0). 0.5::s(T) :- T > 0, U is T - 1, s(U). query(s(3)).", "1/16"),
    ("0.5::n(0). n(T) :- n(U), U < 3, T is U + 1. query(n(X)).", "1/2 1/2 1/2 1/2"),
    # probabilities: with an exponent, computed, of a variable; a rounded sum counts for the heads in use
    (
        "1e-3::a. 2.5E-1::b :- a. .5::c. 0.25 + 0.25::d. query(a). query(b). query(c). query(d).",
        "1/1000 1/4000 1/2 1/2",
    ),
    ("w(x,0.25). w(y,2). P::a(X) :- w(X,P), P < 1. P/8::a(X) :- w(X,P), P > 1. query(a(X)).", "1/4 1/4"),
    (
        "0.33335::f(1); 0.33335::f(2); 0.33335::f(3). query(f(1)).",
        "6667/20000",
    ),
    # control; a clause has one choice for all cases of its body
    ("0.5::a. 0.5::b. c :- true, a. d :- fail, a. d :- fail. query(c). query(d).", "1/2 0"),
    (
        "0.5::a. 0.5::b. c :- \\+(a, b). d :- not a, b. e :- a ; b. f :- \\+ (a ; b)."
        "query(c). query(d). query(e). query(f).",
        "3/4 1/4 3/4 1/4",
    ),
    ("0.5::a. 0.5::b. 0.5::c :- a ; b. query(c).", "3/8"),
    (
        "0.5::a(1). 0.5::a(2). c :- \\+ a(_). d :- \\+ (a(X), X > 1). e :- forall(a(X), X < 2)."
        "query(c). query(d). query(e).",
        "1/4 1/2 1/2",
    ),
    # terms: lists, compound terms, quoted names and strings; `[X|Y]`
    ("0.5::a([1,2]). h(X,Y) :- a([X|Y]). query(h(1,[2])). query(a([1,2])).", "1/2 1/2"),
    (
        "0.5::a(f(1,'B c')). h(X) :- a(f(_,X)). query(h('B c')). query(h(b)). 0.5::b(\"t\"). query(b(X)).",
        "1/2 0 1/2",
    ),
    ("m(X,[X|_]). m(X,[_|T]) :- m(X,T). 0.5::a(X) :- m(X,[1,2,1]). query(a(1)). query(a(2)).", "1/2 1/2"),
    # comments, no space after a full stop, queries and evidence with conditions, the negation of a query
    ("/* 0.1 % old */ 0.5::a.b:-a.query(b).% end", "1/2"),
    ("n(1). n(2). 0.5::a(X) :- n(X). query(a(X)) :- n(X), X > 1. evidence(a(X),true) :- X = 1.", "1/2"),
    ("0.25::a. query(\\+a).", "3/4"),
    ("a <- b. 0.5::b. :- use_module(library(lists)). query(a).", "1/2"),
    # a goal that tests or negates an open variable: calls differ, and a complete call answers later ones
    (
        "0.5::p(1). 0.5::p(2). q(1). q(2). h(X) :- \\+ p(X), q(X). r :- h(1). query(r). query(h(X)).",
        "1/2 1/4 1/4",
    ),
    ("0.5::p(1). 0.5::p(2). q(1). q(2). h(X) :- \\+ p(X), q(X). s :- h(1), h(X). query(s).", "1/4"),
    ("0.1::p. c(A) :- p, A = u. f(A) :- A == u. f(A) :- c(A), f(A). q :- f(A). query(q).", "1/10"),
    ("0.5::p(1). h(1) :- p(1). h(X) :- X == 1. r :- h(1). s :- h(X), r. query(s). query(r).", "1/2 1/2"),
    # a predicate that depends on its own negation, but no atom that does
    ("0.5::m(3,4). m(1,2). m(2,3). w(X) :- m(X,Y), \\+ w(Y). query(w(1)). query(w(2)).", "1/2 1/2"),
    # a probability of 0 is an answer; quotes matter but for =; a string is not atomic
    ("0.0::a(1). 0.5::a(2). query(a(X)).", "0 1/2"),
    ("0.5::a('c'). b :- a(X), X = c. d :- a(X), X == c. e :- a(c). query(b). query(d). query(e).", "1/2 0 0"),
    ('0.5::a("c"). b :- a(X), atomic(X). query(b). 0.5::s:c. query(s:c).', "0 1/2"),
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


def test_a_query_is_shown_as_it_is_written() -> None:
    program = parse_plog(
        "0.4::do. 0.4::pr(1.5). h(X) :- pr(X). query(do). query(\\+ do). query(h(X)). query(h([1,'B']))."
    )
    assert [query.written for query in program.queries] == ["do", "\\+do", "h(1.5)", "h([1,'B'])"]
    lifted = parse_plog("0.4::do. 0.4::obs(a). query(do). query(obs(X)).")
    assert [query.written for query in lifted.queries] == ["do", "obs(a)"]
    quoted = parse_plog(
        "0.5::'two words'(a). 0.5::'Cap'. 0.5::s:t. query('two words'(X)). query('Cap'). query(s:t)."
    )
    assert [query.written for query in quoted.queries] == ["'two words'(a)", "'Cap'", "s:t"]


def test_names_of_the_source_are_restored() -> None:
    lifted = parse_plog("0.5::do. 0.2::a; 0.3::obs(b) :- do. query(a).")
    assert lifted.names == {
        "do'": "do", "obs'": "obs", "choice'1_1": "[choice 1:1]", "choice'1_10": "[choice 1:10]"
    }  # fmt: skip
    program = parse_plog(
        "0.5::p(1). 0.5::p(2). q(1). q(2). h(X) :- \\+ p(X), q(X). r :- h(1), \\+ (p(2), p(1)).\n"
        "0.5::'Ab'(1.5). query(r). query(h(X)). query('Ab'(X))."
    )
    text = restore_names(program_text(program), program.names)
    for shown in (
        "h(1)=true :- not p(1)=true.",
        "[h, call 2](1)=true",
        "not [negation 1:58]=true",
        "'Ab'(1.5)",
    ):
        assert shown in text
    assert is_auxiliary("h'2(1)", {"h'2": "[h, call 2]"})
    assert not is_auxiliary("do'", lifted.names)
    assert pickle.loads(pickle.dumps(program)).names == program.names


def test_a_rounded_sum_is_named_once_and_made_1() -> None:
    thirds = "0.33335::a; 0.33335::b; 0.33335::c. query(a). query(b). query(c)."
    with pytest.warns(
        ReasoningWarning, match=r"x\.pl:1:1: the probabilities .* sum to 1\.00005, not 1"
    ) as caught:
        program = parse_plog(thirds, file="x.pl")
    assert len(caught) == 1
    assert [Reasoner(program).ask(query, exact=True) for query in program.queries] == [Fraction(1, 3)] * 3


REFUSED = [
    ("0.3::a(X) :- member(X,[1,2]).", "1:14", "ProbLog", "member/2 has no clause; builtin and library"),
    ("a :- X is b+2. 0.3::b(3). query(a).", "1:6", "ProbLog", "b is not a number"),
    ("a :- b(X), Y is 1 / X.\n0.3::b(0). query(a).", "1:12", "ProbLog", "division by zero in 1/0"),
    ("a :- b(X), X mod 0 < 1.\n0.3::b(0). query(a).", "1:12", "ProbLog", "division by zero in 0 mod 0"),
    ("a :- X > 1. 0.3::b. query(a).", "1:6", "ProbLog", "the variable X, which has no value here"),
    ("a :- b(X), X < 1.\n0.3::b(c). query(a).", "1:12", "ProbLog", "c is not a number"),
    ("a :- X is (-8) ** 0.5. 0.3::b. query(a).", "1:6", "ProbLog", "is not a real number"),
    ("a :- X is 9 ** 9 ** 9. 0.3::b. query(a).", "1:18", "ProbLog", "an operator that needs brackets here"),
    ("a :- X is 9 ** (9 ** 9). 0.3::b. query(a).", "1:6", "ProbLog", "no value, or one that is too large"),
    ("a :- X is gcd(4,6). 0.3::b. query(a).", "1:6", "ProbLog", "gcd/2 is not an arithmetic function"),
    ("w(a,3). P::a(X) :- w(X,P).", "1:9", "ProbLog", "the probability 3 is not between 0 and 1"),
    ("P::a(P) :- w(X). w(1). query(a(P)).", "1:1", "ProbLog", "arithmetic with the variable"),
    ("0.5::c. a :- \\+b, c. b :- \\+a. query(a).", "1:27", "ProbLog", "a depends on its own"),
    ("0.5::m(1,2). m(2,1). w(X) :- m(X,Y), \\+ w(Y). query(w(1)).", "1:38", "ProbLog", "w(1) depends"),
    (":- use_module('rules.pl'). 0.5::a. query(a).", "1:1", "ProbLog", "use_module('rules.pl') is not"),
    (":- use_module(library(scope)). 0.5::a.", "1:1", "ProbLog", "use_module(library(scope)) is"),
    (":- consult('rules').\na. query(a).", "1:1", "ProbLog", ":- consult('rules') is not translated"),
    ("a/2::b.", "1:1", "ProbLog", "a is not a number"),
    (":- initialization(main).\n0.3::a.", "1:1", "ProbLog", "the directive :- initialization(main) is not"),
    ("0.3::a. b :- (a -> c; d).", "1:15", "ProbLog", "if-then-else (->) is not translated"),
    ("0.3::a. b :- a, !.", "1:17", "ProbLog", "a cut (!) is not translated"),
    ("0.3::\\+a.", "1:6", "ProbLog", "the negated head \\+a is not translated"),
    ("a; b. 0.3::c.", "1:1", "ProbLog", "a disjunction in a head without probabilities"),
    ("?::a. utility(a,3).", "1:1", "ProbLog", "a decision, ?:: (DTProbLog), is not translated"),
    ("0.3::a. utility(a,3).", "1:9", "ProbLog", "a utility (DTProbLog) is not translated"),
    ("t(_)::a.", "1:1", "ProbLog", "the learnable probability t(_), which lcorpp fit estimates, is"),
    ("normal(0,1)::a.", "1:1", "ProbLog", "the density normal(0,1) is not translated"),
    ("0.3::b. a ~ normal(0,1).", "1:9", "ProbLog", "a distribution (~) is not translated"),
    ("0.3::a. b :- findall(X,a,L).", "1:14", "ProbLog", "findall is not translated"),
    ("0.3::a. b :- subquery(a,P).", "1:14", "ProbLog", "subquery is not translated"),
    ("0.3::a. b :- a \\=@= c.", "1:14", "ProbLog", "\\=@=/2 has no clause; builtin"),
    ("0.3::a. b :- G.", "1:9", "ProbLog", "the goal G, a variable, is not translated"),
    ("0.3::a. a := b.", "1:12", "ProbLog", "unexpected '='"),
    ("0.3::a. b('c.", "1:11", "ProbLog", "a quoted name without end"),
    ("0.3::a. b({c}).", "1:11", "ProbLog", "unexpected character '{'"),
    ("0.3::a. query(a)", "1:17", "ProbLog", "unexpected end of the text; expected '.'"),
    ("query(a).", "1:7", "ProbLog", "a/0 has no clause"),
    ("0.6::a; 0.6::b.", "1:1", "ProbLog", "the probabilities sum to 1.2; expected at most 1"),
    ("1.5::a. query(a).", "1:1", "ProbLog", "the probability 1.5 is not between 0 and 1"),
    ("0.3::p(1). q(X) :- \\+ p(X). query(q(X)).", "1:35", "ProbLog", "the answer q("),
    ("0.3::p(X).", "1:1", "ProbLog", "the variable X has no value when the probability is needed"),
    ("0.3::p(1). evidence(p(X)).", "1:21", "ProbLog", "with a variable is not translated"),
    ("0.3::p(1). evidence(p(1), 0.7).", "1:21", "ProbLog", "expected true or false"),
    ("0.3::p(1). query(p(1) = 2).", "1:18", "ProbLog", "query(p(1)=2) is not translated; expected an atom"),
    ("0.3::p(1). query(p(1)) :- p(1).", "1:12", "ProbLog", "query(...) that depends on chance"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "place", "system", "words"), REFUSED, ids=range(len(REFUSED)))
def test_refusals_name_the_system_and_the_construct(text: str, place: str, system: str, words: str) -> None:
    with pytest.raises(ParseError) as caught:
        parse_plog(text, file="x.pl")
    message = str(caught.value).splitlines()[0]
    assert message.startswith(f"x.pl:{place}: this is a {system} program: ")
    assert words in message
    assert message.endswith("; see docs/background/coming-from.md")


@pytest.mark.parametrize(
    "text",
    ["p : boolean. random(p). p :: q.", "query : boolean. random(query). query(1).", "s = {a. % 0.3::b."],
)
def test_errors_in_p_log_are_reported_as_such(text: str) -> None:
    with pytest.raises((ParseError, ProgramError)) as caught:
        parse_plog(text)
    assert "program: " not in str(caught.value)


@pytest.mark.parametrize("goal", ["n(Y), X is Y + 1", "Y is X + 1, n(Y)"])
def test_a_recursion_without_end_is_refused(monkeypatch: pytest.MonkeyPatch, goal: str) -> None:
    monkeypatch.setattr(tabling, "MAX_STEPS", 1000)
    with pytest.raises(ParseError, match=r"2:\d+: .* more than 1000 steps .* perhaps without end"):
        parse_plog(f"0.3::n(0).\nn(X) :- {goal}.\nquery(n(1)).")


def test_calls_without_end_are_refused_before_the_memory_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tabling, "MAX_CALLS", 100)
    with pytest.raises(ParseError, match=r"1:19: .* n/1 makes more than 100 calls .* perhaps without end"):
        parse_plog("n(X) :- Y is X+1, n(Y). 0.5::a. b :- a, n(1). query(b).")
    long = "n(X) :- Y is X*X, n(Y). 0.5::a. b :- a, n(2). query(b)."
    with pytest.raises(ParseError, match=r"program: \d{70,77}\.\.\. has no value, or one that is too large"):
        parse_plog(long)


def test_many_instances_of_a_query_are_refused() -> None:
    facts = " ".join(f"0.5::p({number})." for number in range(101))
    with pytest.raises(ParseError, match="the query has 10201 instances; expected at most 10000"):
        parse_plog(f"{facts} q(X,Y) :- p(X), p(Y). query(q(X,Y)).")


def test_fitted_numbers_are_not_written_into_a_problog_text() -> None:
    text = "0.5::a.\n"
    result = fit(parse_plog(text), [{"a": "true"}, {"a": "false"}, {"a": "true"}])
    with pytest.raises(ProgramError, match="expected the pr-atom of the program"):
        result.rewrite(text)

"""Arguments of public methods: wrong types are refused, values may be integers or truth values."""

from __future__ import annotations

import numpy as np
import pytest

from lcorpp.errors import ProgramError, UndefinedError
from lcorpp.fitting import fit
from lcorpp.reasoning import Enumeration, Reasoner, ask, explain, parse_plog, parse_query, read_plog
from lcorpp.reasoning.language.program import Program

PROGRAM = parse_plog(
    "d = {1..3}. c = {x, y}. a : d. b : c. ok : boolean. random(a). random(b). random(ok)."
    " pr(b=x | a=1, ok) = 1/4. pr(b=x | a=3) = 1."
)
REASONER = Reasoner(PROGRAM)
CIRCUIT = REASONER.compile(["a", "ok"], "b")
RNG = np.random.default_rng(1)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Reasoner("x"), "program is 'x'; expected Program"),
        (lambda: Reasoner(None), "program is None; expected Program"),
        (lambda: Enumeration(None), "program is None; expected Program"),
        (lambda: REASONER.posterior([["b"]]), "expected the name of an attribute, not"),
        (lambda: REASONER.posterior([]), "expected the name of an attribute, not"),
        (lambda: REASONER.posterior(["b", "b"]), "the query names b twice"),
        (lambda: REASONER.posterior("b", None), "evidence is None; expected Mapping"),
        (lambda: REASONER.posterior("b", ["a"]), "evidence is .*; expected Mapping"),
        (lambda: REASONER.posterior("b", {}, 3), "do is 3; expected Mapping"),
        (lambda: REASONER.posterior("b", {"a": [1]}), r"\[1\] is not a value of a; expected one of 1, 2, 3"),
        (lambda: REASONER.posterior("b", {"a": None}), "None is not a value of a; .*leave out"),
        (lambda: REASONER.posterior("b", {"a": 4}), "4 is not a value of a; expected one of 1, 2, 3"),
        (lambda: REASONER.posterior("b", {"a": True}), "True is not a value of a; expected one of 1, 2, 3"),
        (lambda: REASONER.posterior("b", {"a": 1.0}), "1.0 is not a value of a; expected one of 1, 2, 3"),
        (lambda: REASONER.exact("b", None), "evidence is None; expected Mapping"),
        (lambda: REASONER.compile("ab", "b"), r"inputs is 'ab'; expected a sequence of terms"),
        (lambda: REASONER.compile(3, "b"), "inputs is 3; expected Iterable"),
        (lambda: REASONER.compile(["a"], 3), "query is 3; expected str or Iterable"),
        (lambda: REASONER.compile(["a"], "b", 3), "do is 3; expected Mapping"),
        (lambda: REASONER.sample(3), "rng is 3; expected Generator"),
        (lambda: REASONER.sample(RNG, None), "evidence is None; expected Mapping"),
        (lambda: REASONER.ask("a=1"), "query is 'a=1'; expected Query"),
        (lambda: REASONER.ask(parse_query("b", PROGRAM), exact="no"), "exact is 'no'; expected bool"),
        (lambda: REASONER.list_worlds(None, 1), "query is None; expected Query"),
        (lambda: Enumeration(PROGRAM).ask("a=1"), "query is 'a=1'; expected Query"),
        (lambda: Enumeration(PROGRAM).posterior("b", None), "evidence is None; expected Mapping"),
        (lambda: REASONER.posterior(b"b"), "expected the name of an attribute, not b'b'"),
        (lambda: REASONER.exact(None), "expected the name of an attribute, not None"),
        (lambda: REASONER.exact("b", {}, [1]), r"do is \[1\]; expected Mapping"),
        (lambda: REASONER.expect(None), "expression is None; expected str"),
        (lambda: REASONER.expect(["a"]), r"expression is \['a'\]; expected str"),
        (lambda: REASONER.expect("a", 3), "evidence is 3; expected Mapping"),
        (lambda: REASONER.expect("b"), "b may be x, which is not a number"),
        (lambda: REASONER.most_probable(3), "evidence is 3; expected Mapping"),
        (lambda: REASONER.most_probable({}, "x"), "count is 'x'; expected int"),
        (lambda: REASONER.most_probable({}, 0), "expected 1 to 100000 worlds, not 0"),
        (lambda: REASONER.most_probable(of=3), "expected the name of an attribute, not 3"),
        (lambda: REASONER.most_probable(do=3), "do is 3; expected Mapping"),
        (lambda: REASONER.list_worlds([], 1), r"query is \[\]; expected Query"),
        (lambda: REASONER.list_worlds(parse_query("b", PROGRAM), None), "count is None; expected int"),
        (lambda: REASONER.build_model("b"), "query is 'b'; expected Query"),
        (lambda: REASONER.filter(3, [], "b"), "carried is 3; expected Mapping"),
        (lambda: REASONER.filter({"a": "a"}, 3, "b"), "inputs is 3|expected different terms"),
        (lambda: REASONER.sample(RNG, {"a": []}), r"\[\] is not a value of a"),
        (lambda: explain(3, 4), "reasoner is 3; expected Reasoner"),
        (lambda: explain(REASONER, 4), "query is 4; expected Query"),
        (lambda: explain(REASONER, parse_query("b", PROGRAM), count="x"), "count is 'x'; expected int"),
        (lambda: ask(PROGRAM, None), "query is None; expected Query"),
        (lambda: ask(3, parse_query("b", PROGRAM)), "program is 3; expected Program"),
        (lambda: Enumeration(PROGRAM, limit="x"), "limit is 'x'; expected int"),
        (lambda: Enumeration(PROGRAM, limit=-1), "limit is -1; expected at least 1"),
        (lambda: Enumeration(PROGRAM, limit=0), "limit is 0; expected at least 1"),
        (lambda: Enumeration(PROGRAM).expect("b"), "b may be x, which is not a number"),
        (lambda: Enumeration(PROGRAM).most_probable({}, 0), "expected 1 to 100000 worlds, not 0"),
        (lambda: Enumeration(PROGRAM).ask(parse_query("b", PROGRAM), exact=1), "exact is 1; expected bool"),
        (lambda: Enumeration(PROGRAM).exact(3), "expected the name of an attribute, not 3"),
        (lambda: Enumeration(PROGRAM).exact("b", {}, 3), "do is 3; expected Mapping"),
        (lambda: Enumeration(PROGRAM).ask(None), "query is None; expected Query"),
        (lambda: Enumeration(PROGRAM).sample(None), "rng is None; expected Generator"),
        (lambda: Enumeration(PROGRAM).sample(RNG, 3), "evidence is 3; expected Mapping"),
        (lambda: Enumeration(PROGRAM).list_worlds(3, 1), "query is 3; expected Query"),
        (lambda: Enumeration(PROGRAM).list_worlds(parse_query("b", PROGRAM), []), r"count is \[\]; expected"),
        (lambda: CIRCUIT(None), "expected a mapping from inputs to values, or codes, not None"),
        (lambda: CIRCUIT({"a": {}}), "the column of a is {}; expected a sequence of values"),
        (lambda: CIRCUIT({"a": {1, 2}}), "the column of a is {1, 2}; expected a sequence of values"),
        (lambda: CIRCUIT({"a": [1, 4]}), "row 1: 4 is not a value of a; expected one of 1, 2, 3"),
        (lambda: CIRCUIT.encode(None), "evidence is None; expected Mapping"),
        (lambda: CIRCUIT.exact(None), "evidence is None; expected Mapping"),
        (lambda: CIRCUIT.sample(None, {}), "rng is None; expected Generator"),
        (lambda: CIRCUIT.most_probable({}, "x"), "count is 'x'; expected int"),
        (lambda: parse_plog(None), "text is None; expected str"),
        (lambda: parse_plog("", file=3), "file is 3; expected str"),
        (lambda: parse_plog("", strict="no"), "strict is 'no'; expected bool"),
        (lambda: parse_plog("", semantics="2042"), "semantics is '2042'; expected 2009 or 2018"),
        (lambda: parse_plog("", semantics=2009), "semantics is 2009; expected 2009 or 2018"),
        (lambda: Program("x", (), "2042"), "semantics is '2042'; expected 2009 or 2018"),
        (lambda: read_plog(3), "path is 3; expected str or PathLike"),
        (lambda: parse_query(3, PROGRAM), "query is 3; expected str"),
        (lambda: parse_query("a", "x"), "program is 'x'; expected Program"),
        (lambda: Reasoner(PROGRAM, samples=True), "samples is True; expected int"),
        (lambda: Reasoner(PROGRAM, seed=False), "seed is False; expected int"),
        (lambda: REASONER.most_probable(count=True), "count is True; expected int"),
        (lambda: Enumeration(PROGRAM, limit=True), "limit is True; expected int"),
        (lambda: REASONER.filter({"a": "b"}, [], "b", window=True), "window is True; expected int"),
        (lambda: fit(PROGRAM, None), "records is None; expected Iterable"),
        (lambda: fit(PROGRAM, [{}], fixed=None), "expected a list of attributes and lines, not None"),
        (lambda: REASONER.posterior("?a=1"), r"'\?a=1': expected names of attributes only, such as '\?a, b'"),
        (lambda: REASONER.posterior("?a, b | obs(ok)"), "expected names of attributes only"),
        (lambda: REASONER.posterior("?a, a"), "the query names a twice"),
        (lambda: REASONER.expect("a] | obs(a=1) %"), "unexpected ']'"),
    ],
)  # fmt: skip
def test_wrong_types_are_refused(call, words):
    with pytest.raises(ProgramError, match=words):
        call()


@pytest.mark.parametrize("ok", [True, False])
@pytest.mark.parametrize("a", [1, 2, np.int64(3)])
def test_integers_and_truth_values_as_evidence(a, ok):
    given, named = {"a": a, "ok": ok}, {"a": str(a), "ok": str(ok).lower()}
    expected = Enumeration(PROGRAM).exact("b", named)
    assert REASONER.exact("b", given) == Enumeration(PROGRAM).exact("b", given) == expected
    assert CIRCUIT.exact(given) == expected
    for answer in (
        REASONER.posterior("b", given),
        CIRCUIT(given),
        Enumeration(PROGRAM).posterior("b", given),
    ):
        assert answer.probabilities == pytest.approx([float(p) for p in expected.values()])
    assert CIRCUIT({"a": [a, None], "ok": ok}) == pytest.approx(
        CIRCUIT({"a": [str(a), None], "ok": named["ok"]})
    )
    assert CIRCUIT.most_probable(given)[0].values["a"] == str(a)
    assert REASONER.sample(RNG, given)["ok"] == CIRCUIT.sample(RNG, given)["ok"] == named["ok"]
    assert REASONER.posterior("a", {}, {"a": a})[str(a)] == 1


def test_all_engines_answer_the_same_questions():
    enumeration, given = Enumeration(PROGRAM), {"b": "x"}
    for do in ({}, {"ok": "true"}):
        expected = enumeration.expect("a*a - 1", given, do)
        assert REASONER.expect("a*a - 1", given, do) == pytest.approx(expected)
        assert enumeration.expect("a", {"a": 3}, do) == 3
        for of in (None, "a", ["a", "ok"]):
            first, second = (r.most_probable(given, 3, of=of, do=do) for r in (REASONER, enumeration))
            assert [w.measure for w in first] == [w.measure for w in second]
            assert sum(w.measure for w in enumeration.most_probable(given, 10, of=of, do=do)) == 1
    assert enumeration.count() == REASONER.count() == len(enumeration.worlds) == 12
    with pytest.raises(UndefinedError, match="no possible world of positive measure has a=3, b=y"):
        enumeration.most_probable({"a": 3, "b": "y"})


def test_a_cached_answer_for_1_is_none_for_true():
    reasoner = Reasoner(PROGRAM)
    reasoner.posterior("b", {"a": 1})
    with pytest.raises(ProgramError, match="True is not a value of a"):
        reasoner.posterior("b", {"a": True})


def test_messages_do_not_show_the_term_of_the_query():
    program = parse_plog(
        "c = {x, y}. a : c. b : c. random(a). [r] random(b) :- a=x. [q] random(b) :- a=x. ?{a=x}."
    )
    with pytest.raises(ProgramError, match=r"Condition 1: .* in the world \{a=x, b=x\}$"):
        Reasoner(program).ask(program.queries[0])

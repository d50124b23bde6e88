"""Numbers from data: known answers, and the enumeration of the worlds as the oracle."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import log
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import DataError, ProgramError, UndefinedError
from lcorpp.fitting import SoftRecord, fit, read_records
from lcorpp.fitting.expectation import Expectation
from lcorpp.fitting.maximisation import draw_start
from lcorpp.fitting.number_model import NumberModel, build_number_model, list_free_numbers
from lcorpp.reasoning import Enumeration, Program, Reasoner, parse_plog, read_plog
from lcorpp.reasoning.language.syntax import Number, Probability

PAPER = Path(__file__).parents[1] / "plog" / "lcorpp.plog"

PROGRAMS = {
    "chain": """
        a, b, c : boolean. random(a). random(b). random(c).
        pr(a) = 0.3. pr(b | a) = 0.8. pr(b | a=false) = 0.1. pr(c | b) = 0.6. pr(c | b=false) = 0.25.""",
    "two dice with variables": """
        #domain dice(D), score(S).
        dice = {d1, d2}. score = {1..4}. roll : dice -> score. low : score -> boolean. total : n. n = {2..8}.
        random(roll(D)). low(1). low(2). #domain score(T).
        pr(roll(D)=S | low(S)) = 1/10. pr(roll(d1)=3) = 1/4.
        high : boolean. high :- roll(d1)=4, roll(d2)=4.""",
    "a dynamic range": """
        n = {1..3}. a : n. b : boolean. ok : n -> boolean. ok(1). ok(2). ok(3) :- b.
        random(b). random(a : {X : ok(X)}). pr(b) = 0.4. pr(a=1) = 0.2.""",
    "pr-atoms that apply together in some worlds": """
        n = {1..4}. a : n. b, c : boolean. random(a). random(b). random(c). pr(b) = 0.4. pr(c | b) = 0.7.
        pr(a=1) = 0.2. pr(a=2 | b) = 0.3. pr(a=3 | c) = 0.1.""",
    "terms in a cycle": """
        first, a, b : boolean. random(first). random(a). random(b). pr(first) = 0.6.
        pr(a | first) = 0.7. pr(b | first, a) = 0.9. pr(b | first=false) = 0.2.
        pr(a | first=false, b) = 0.35.""",
    "all values": """
        n = {1..3}. a : n. b : n. random(a). random(b). pr(a=1) = 0.2. pr(a=2) = 0.3. pr(a=3) = 0.5.
        pr(b=1 | a=1) = 0.5. pr(b=2 | a=1) = 0.1. pr(b=1 | a!=1) = 0.2.""",
    "no value": """
        a, b : boolean. random(a). random(b) :- a. pr(a) = 0.7. pr(b) = 0.2.
        some :- not b. some : boolean.""",
    "constraints": """
        n = {1..3}. a : n. b, c, d : boolean. random(a). random(b). random(c). d :- a=1, not b.
        pr(a=1) = 0.3. pr(a=2) = 0.6. pr(b | a=1) = 0.5. pr(b | a=2) = 0.1. pr(c | d) = 0.35.
        :- b, -c. :- a=3, -b. obs(c=true). :- d, c, a=2.""",
}  # fmt: skip


def set_numbers(program: Program, numbers: Mapping[int, Fraction]) -> Program:
    """Replace the numbers of the statements with these indexes."""
    statements = list(program.statements)
    for index, number in numbers.items():
        old = statements[index]
        assert isinstance(old, Probability)
        statements[index] = replace(old, number=Number(number))
    return Program(program.file, tuple(statements), program.semantics)


def likelihoods(program: Program, records: Sequence[Mapping[str, str]]) -> list[Fraction]:
    """The probability of each record, by enumeration."""
    worlds = Enumeration(program).worlds
    total = sum(w.measure for w in worlds)
    return [
        sum((w.measure for w in worlds if record.items() <= w.values.items()), start=Fraction(0)) / total
        for record in records
    ]


def log_likelihood(program: Program, records: Sequence[Mapping[str, str]]) -> float:
    distinct: dict[frozenset[tuple[str, str]], int] = {}
    for record in records:
        key = frozenset(record.items())
        distinct[key] = distinct.get(key, 0) + 1
    values = likelihoods(program, [dict(key) for key in distinct])
    return sum(n * log(p) if p else -1e9 for n, p in zip(distinct.values(), values, strict=True))


def draw(program: Program, count: int, seed: int, hidden: float = 0.0) -> list[dict[str, str]]:
    """Draw records; each cell is hidden with a probability."""
    rng = np.random.default_rng(seed)
    worlds = Enumeration(program).worlds
    measures = np.array([float(w.measure) for w in worlds])
    drawn = rng.choice(len(worlds), size=count, p=measures / measures.sum())
    return [{t: v for t, v in worlds[i].values.items() if rng.random() >= hidden} for i in drawn]


def build(program: Program, terms: Sequence[str]) -> NumberModel:
    return build_number_model(program, list_free_numbers(program, ()), terms)


@pytest.mark.parametrize("name", PROGRAMS)
def test_likelihoods_and_their_derivatives_are_those_of_the_enumeration(name: str) -> None:
    program = parse_plog(PROGRAMS[name])
    records = [*draw(program, 8, 1), *draw(program, 8, 2, hidden=0.5), {}]
    model = build(program, sorted({term for record in records for term in record}))
    values = np.maximum(model.evaluate(model.start), 1e-12)
    expected = Expectation(model, records, np.ones(len(records))).compute(values)
    assert np.exp(expected.log_p[:-2] - expected.log_p[-2]) == pytest.approx(
        [float(p) for p in likelihoods(program, records)], rel=1e-12
    )
    scores = model.coefficients.T @ (expected.counts / values[:, None])
    scores = scores[:, :-2] + scores[:, -1:] * np.exp(expected.log_p[-1] - expected.log_p[-2])
    step = Fraction(1, 10**5)
    is_full = {i for case in model.cases if case.is_full for i in case.parameters}
    for i, index in enumerate(model.statements):
        if i in is_full:
            continue
        at = program.statements[index]
        assert isinstance(at, Probability)
        assert isinstance(at.number, Number)
        ahead = likelihoods(set_numbers(program, {index: at.number.value + step}), records)
        behind = likelihoods(set_numbers(program, {index: at.number.value - step}), records)
        slopes = [(log(a) - log(b)) / (2 * float(step)) for a, b in zip(ahead, behind, strict=True)]
        assert scores[i] == pytest.approx(slopes, abs=1e-5, rel=1e-5)


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("hidden", [0.0, 0.3])
def test_no_other_numbers_nearby_are_more_likely(name: str, hidden: float) -> None:
    program = parse_plog(PROGRAMS[name])
    records = draw(program, 400, 3, hidden)
    result = fit(program, records)
    assert result.converged
    best = log_likelihood(result.program, records)
    assert best == pytest.approx(result.log_likelihood, abs=1e-3)
    assert best >= log_likelihood(program, records) - 1e-9
    model = build(program, ())
    linked = [case.parameters for case in model.cases if case.is_full]
    rng, changed = np.random.default_rng(4), 0
    for _ in range(5):
        numbers = [float(x.value) * (1 + 0.02 * rng.normal()) for x in result.numbers]
        exact = [Fraction(x).limit_denominator(10**6) for x in numbers]
        for own in linked:  # their sum is 1
            total = sum(exact[i] for i in own)
            for i in own:
                exact[i] /= total
        other = set_numbers(program, dict(zip(model.statements, exact, strict=True)))
        assert log_likelihood(other, records) <= best + 1e-4
        changed += other != result.program
    assert changed == 5


def test_complete_records_give_relative_frequencies() -> None:
    program = read_plog(PAPER)
    records = draw(program, 3000, 5)
    result = fit(program, records)
    assert len(result.numbers) == 14
    for number in result.numbers:
        (condition,) = number.statement.body
        own = [r for r in records if r[str(condition.term)] == str(condition.value)]
        count = sum(r[str(number.statement.term)] == str(number.statement.value) for r in own)
        assert float(number.value) == pytest.approx(count / len(own), rel=1e-5)
        assert number.cases == pytest.approx(len(own))
        p, n = count / len(own), len(own)
        odds, error = log(p / (1 - p)), 1.959964 / np.sqrt(n * p * (1 - p))
        expected = [1 / (1 + np.exp(-(odds + side * error))) for side in (-1, 1)]
        assert number.interval == pytest.approx(expected, rel=1e-4)
    assert result.n_undetermined == 0
    assert repr(result).endswith("14 numbers from 3000 records, 0 not identifiable>")


def test_hidden_attributes_of_the_paper() -> None:
    """With hidden identity, 12 numbers meet 11 frequencies; with known times, all are identifiable."""
    program = read_plog(PAPER)
    records = [{t: v for t, v in r.items() if t != "identity"} for r in draw(program, 20_000, 6)]
    result = fit(program, records)
    assert [x.statement.term.name for x in result.numbers if x.interval] == ["classifier", "classifier"]
    assert result.n_undetermined == 1
    assert "1 degrees of freedom" in str(result)
    assert "not identifiable" in str(result.numbers[0])
    known = fit(program, records, fixed=["time"])
    assert len(known.numbers) == 8
    assert known.n_undetermined == 0
    for number in known.numbers:
        assert number.interval is not None
        low, high = number.interval
        assert low < float(number.value) < high
        assert abs(float(number.value - number.old)) < high - low


def test_constraints_select_the_records() -> None:
    program = parse_plog("a, b : boolean. random(a). random(b). pr(a) = 0.3. pr(b) = 0.3. :- a, b.")
    counts = {("true", "false"): 20, ("false", "true"): 30, ("false", "false"): 10}
    records = [{"a": a, "b": b} for (a, b), n in counts.items() for _ in range(n)]
    result = fit(program, records)
    # the odds of a are those without b: 20 to 10
    assert [float(x.value) for x in result.numbers] == pytest.approx([2 / 3, 3 / 4], abs=1e-6)
    assert result.log_likelihood == pytest.approx(sum(n * log(n / 60) for n in counts.values()))
    first, second = (x.interval for x in result.numbers)
    expected = [2 / (2 + np.exp(side * 1.959964 * np.sqrt(1 / 20 + 1 / 10))) for side in (1, -1)]
    assert first == pytest.approx(expected, rel=1e-4)
    assert second is not None
    assert result.numbers[0].cases == pytest.approx(120)  # 60 draws were rejected


def test_the_ascent_is_accelerated_and_reports_its_progress() -> None:
    """Eight coins must agree: few draws are accepted; expectation-maximisation alone takes 260 steps."""
    program = parse_plog(
        "n = {1..8}. #domain n(I). x : n -> boolean. random(x(I)). pr(x(I)) = 0.4.\n"
        ":- x(I), -x(1). :- x(1), -x(I)."
    )
    steps: list[tuple[int, float]] = []
    result = fit(
        program,
        [{"x(1)": "true"}] * 40 + [{"x(3)": "false"}] * 20,
        progress=lambda n, change: steps.append((n, change)),
    )
    assert float(result.numbers[0].value) == pytest.approx(1 / (1 + (20 / 40) ** (1 / 8)), abs=1e-6)
    assert result.converged
    assert result.iterations == steps[-1][0] < 60
    assert steps[-1][1] < 1e-9


def test_a_symmetric_mixture_is_not_identifiable() -> None:
    program = parse_plog(
        "a, b : boolean. random(a). random(b). pr(a) = 0.3.\npr(b | a) = 0.9. pr(b | a=false) = 0.2."
    )
    result = fit(program, [{"b": "true"}] * 6 + [{"b": "false"}] * 4)
    assert result.n_undetermined == 2
    assert not any(x.interval for x in result.numbers)
    assert log_likelihood(result.program, [{"b": "true"}]) == pytest.approx(log(0.6), abs=1e-5)


def test_random_starts_leave_a_saddle_point() -> None:
    """Two hidden classes with equal numbers stay equal; random starts find different ones."""

    def build_mixture(numbers: Sequence[float]) -> Program:
        text = (
            "n = {1..4}. #domain n(I). c : boolean. x : n -> boolean. random(c). random(x(I)). pr(c) = 0.5."
        )
        for i in range(4):
            text += f" pr(x({i + 1}) | c) = {numbers[i]}. pr(x({i + 1}) | c=false) = {numbers[4 + i]}."
        return parse_plog(text)

    truth = build_mixture([0.9, 0.8, 0.5, 0.5, 0.5, 0.5, 0.1, 0.8])
    records = [{t: v for t, v in r.items() if t != "c"} for r in draw(truth, 2000, 8)]
    program = build_mixture([0.5] * 8)
    stuck, found = fit(program, records), fit(program, records, starts=3, seed=1)
    assert "starts" not in str(stuck)
    assert "iterations, the best of 3 starts\n" in str(found)
    assert stuck.log_likelihood < log_likelihood(truth, records) < found.log_likelihood
    assert found.log_likelihood == pytest.approx(log_likelihood(found.program, records), abs=1e-3)
    assert found.n_undetermined == 0
    again, other = (fit(program, records, starts=3, seed=seed) for seed in (1, 2))
    assert str(again) == str(found)
    assert other.log_likelihood == pytest.approx(found.log_likelihood, abs=1e-5)
    near = fit(truth, records, starts=4)  # its names are kept: a start with other names is as likely
    assert [x.value for x in near.numbers] == [x.value for x in fit(truth, records).numbers]


@pytest.mark.parametrize("name", PROGRAMS)
def test_random_starts_are_distributions(name: str) -> None:
    model = build(parse_plog(PROGRAMS[name]), ())
    rest = [case.rest for case in model.cases if case.is_full]
    for seed in range(20):
        values = model.evaluate(draw_start(model, np.random.default_rng(seed)))
        assert np.flatnonzero(values == 0).tolist() == sorted(rest)
        assert values.max() < 1


def test_numbers_of_cases_that_no_record_meets_stay() -> None:
    program = parse_plog("a, b : boolean. random(a). random(b). pr(b | a) = 0.9. pr(b | a=false) = 0.2.")
    result = fit(program, [{"a": "true", "b": "true"}, {"a": "true", "b": "false"}])
    assert [x.value for x in result.numbers] == [Fraction(1, 2), Fraction(1, 5)]
    assert result.numbers[1].interval is None
    assert result.numbers[1].cases == 0


def test_numbers_at_the_boundary_have_the_exact_interval() -> None:
    program = parse_plog("a : boolean. random(a). pr(a) = 0.3.")
    (never,) = fit(program, [{"a": "false"}] * 20).numbers
    assert never.value == 0
    assert never.interval == pytest.approx((0, 1 - 0.025 ** (1 / 20)))
    (always,) = fit(program, [{"a": "true"}] * 20).numbers
    assert always.value == 1
    assert always.interval == pytest.approx((0.025 ** (1 / 20), 1))


def test_pseudo_counts() -> None:
    program = parse_plog("n = {1..4}. a : n. random(a).\npr(a=1) = 0.2. pr(a=2) = 0.5.")
    records = [{"a": "1"}] * 3 + [{"a": "3"}] * 7
    result = fit(program, records, prior=10)
    assert [x.value for x in result.numbers] == [Fraction(3 + 2, 20), Fraction(0 + 5, 20)]
    assert fit(program, records, prior=0).numbers[1].value == 0
    lines = parse_plog("n = {1..4}. a : n. random(a).\npr(a=1) = 0.2.\npr(a=2) = 0.5.")
    (number,) = fit(
        lines, records, prior=10, fixed=[3]
    ).numbers  # 10 records: 2 with a=1, 5 with a=2, 3 others
    assert float(number.value) == pytest.approx(0.5 * (3 + 2) / (10 + 5), abs=1e-6)
    narrow, wide = (fit(program, records, prior=n).numbers[0].interval for n in (1000, 10))
    assert narrow is not None
    assert wide is not None
    assert narrow[1] - narrow[0] < (wide[1] - wide[0]) / 3


def test_fixed_numbers_leave_less_for_the_others() -> None:
    program = parse_plog("n = {1..4}. a : n. random(a).\npr(a=1) = 0.2.\npr(a=2) = 0.5.")
    records = [{"a": "1"}] * 3 + [{"a": "2"}] * 3 + [{"a": "3"}] * 4
    result = fit(program, records, fixed=[2])
    (number,) = result.numbers
    assert float(number.value) == pytest.approx(0.8 * 3 / 7, abs=1e-6)
    assert number.statement.at.line == 3
    assert result.program.statements[3] == program.statements[3]
    with pytest.raises(ProgramError, match="no pr-atom has a number that is free"):
        fit(program, records, fixed=["a"])


def test_a_number_that_others_determine() -> None:
    program = parse_plog("p : boolean. random(p).\npr(p) = 0.3.\npr(p=false) = 0.7.")
    (number,) = fit(program, [{"p": "true"}, {"p": "false"}], fixed=[2]).numbers
    assert number.value == Fraction(7, 10)
    assert number.interval == pytest.approx((0.7, 0.7))


def test_rounded_numbers_still_sum_to_one() -> None:
    text = "n = {1..3}. a : n. random(a). pr(a=1) = 0.2. pr(a=2) = 0.3. pr(a=3) = 0.5."
    result = fit(parse_plog(text), [{"a": str(1 + i % 3)} for i in range(600)])
    assert sum(x.value for x in result.numbers) == 1
    assert Reasoner(parse_plog(result.rewrite(text))).count() == 3


def test_the_text_keeps_its_comments_and_layout() -> None:
    text = """\
%* Measured
   numbers: pr(a) = 0.5. *%
a , b: boolean.   random(a).\trandom(b).
  pr( a )=0.25 .  % pr(a) = 1/2.
[r] pr(b | a) == 3/20.    pr(b|a=false)
    = (1 - 1/2) .
random(c). c : boolean.\r
"""
    program = parse_plog(text.replace("[r] ", ""))
    records = [{"a": "true", "b": "true"}] * 1 + [{"a": "true", "b": "false"}] * 3 + [
        {"a": "false", "b": "true"}, {"a": "false", "b": "false"}, {"a": "false", "b": "true"},
        {"a": "false", "b": "true"}
    ]  # fmt: skip
    text = text.replace("[r] ", "")
    changed = fit(program, records).rewrite(text)
    expected = text.replace("=0.25 .", "=0.5 .").replace("== 3/20.", "== 0.25.")
    assert changed == expected.replace("(1 - 1/2) .", "0.75 .")
    assert parse_plog(changed) == fit(program, records).program
    with pytest.raises(ProgramError, match="expected the pr-atom of the program"):
        fit(program, records).rewrite("a : boolean. random(a).")


def test_labelled_pr_atoms() -> None:
    text = "a : boolean. [r] random(a). [r] pr(a) = 0.25."
    assert fit(parse_plog(text), [{"a": "true"}] * 2).rewrite(text) == text.replace("0.25", "1")


@pytest.mark.parametrize(
    ("text", "records", "error", "message"),
    [
        ("pr(a) = 0.5.", [], DataError, "no records"),
        ("pr(a) = 0.5.", [{"a": "true"}, {"b": "x"}], ProgramError, r"record 2: 'b'"),
        ("pr(a) = 0.5.", [{"a": "2"}], ProgramError, r"record 1: '2' is not a value of a"),
        ("pr(a) = 1.", [{"a": "true"}], ProgramError, "no pr-atom has a number that is free"),
        (
            "pr(a) = 0.5. a :- not b. b : boolean. random(b). a=false :- b.",
            [{}],
            ProgramError,
            "exclude worlds",
        ),
        ("pr(a) = 0.5. :- a.", [{"a": "false"}, {"a": "true"}], UndefinedError, "record 2"),
        ("pr(a) = 0.5. obs(a). :- a.", [{}], UndefinedError, "record 1"),
        ("pr(a) = 0.5. b : boolean. b +- .", [{"a": "true"}], ProgramError, "cr-rules"),
        ("pr(a) = 0.5. b : boolean. b :- a.", [{}, {"a": "false", "b": "true"}], UndefinedError, "record 2"),
    ],
)
def test_bad_input(text: str, records: list[dict[str, str]], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        fit(parse_plog(f"a : boolean. random(a). {text}"), records)


def test_records_of_other_types() -> None:
    program = parse_plog("n = {1, 2}. a : n. b : boolean. random(a). random(b). pr(a=1) = 0.5. pr(b) = 0.5.")
    result = fit(program, [{"a": 1, "b": True}, {"a": "1"}, {"b": "false"}])  # type: ignore[dict-item]
    assert [x.value for x in result.numbers] == [1, Fraction(1, 2)]
    with pytest.raises(ProgramError, match="record 2: expected a mapping from terms to values"):
        fit(program, [{"a": "1"}, {"a": ["1"]}])  # type: ignore[dict-item]
    with pytest.raises(ProgramError, match="record 1 is 'a'; expected Mapping"):
        fit(program, ["a"])  # type: ignore[list-item]
    with pytest.raises(ProgramError, match="record 1: None is not a value of a"):
        fit(program, [{"a": None}])  # type: ignore[dict-item]
    with pytest.raises(ProgramError, match="record 1: the evidence gives a  two values"):
        fit(program, [{"a": "1", "a ": "2"}])


def test_records_of_a_file_are_named_by_their_lines(tmp_path: Path) -> None:
    program = parse_plog("a : boolean. random(a). pr(a) = 0.5. b : boolean. b :- a.")
    file = tmp_path / "records.csv"
    file.write_text("a,b\ntrue,true\n\n?,true\nfalse,true\n")
    assert list(read_records(file))[1] == {"b": "true"}
    with pytest.raises(UndefinedError, match=r"records\.csv:5 is in no possible world"):
        fit(program, read_records(file))
    file.write_text("a,b\ntrue,2\n")
    with pytest.raises(ProgramError, match=r"records\.csv:2: '2' is not a value of b"):
        fit(program, read_records(file))


def test_bad_options() -> None:
    with pytest.raises(ProgramError, match="expected Program"):
        fit("a.plog", [{}])  # type: ignore[arg-type]
    program = parse_plog("a : boolean. random(a). pr(a) = 0.5.")
    for prior in (-1, 1e308, float("nan")):
        with pytest.raises(DataError, match=rf"pseudo-counts from 0 to 1e\+100, not {re.escape(str(prior))}"):
            fit(program, [{"a": "true"}], prior=prior)
    with pytest.raises(ProgramError, match="'b' is neither an attribute with pr-atoms nor the line of one"):
        fit(program, [{"a": "true"}], fixed=["b"])
    with pytest.raises(ProgramError, match="starts is 0; expected at least 1"):
        fit(program, [{"a": "true"}], starts=0)
    with pytest.raises(ProgramError, match="seed is -1; expected at least 0"):
        fit(program, [{"a": "true"}], seed=-1)
    with pytest.raises(ProgramError, match="expected a list"):
        fit(program, [{"a": "true"}], fixed="a")


def test_sums_that_are_one_in_some_worlds_only() -> None:
    program = parse_plog(
        "n = {1..3}. a : n. ok : n -> boolean. ok(1). ok(2). ok(3) :- b. b : boolean. random(b).\n"
        "random(a : {X : ok(X)}).\npr(a=1) = 0.4.\npr(a=2 | b=false) = 0.6."
    )
    with pytest.raises(ProgramError, match="the numbers at lines 3, 4 sum to 1 in some worlds"):
        fit(program, [{"a": "1"}])
    assert fit(program, [{"a": "1"}, {"a": "2"}], fixed=[3]).numbers[0].value == Fraction(3, 5)


def test_long_chains_do_not_underflow() -> None:
    text = "n = {0..999}. s : n -> boolean. random(s(0)). random(s(I)) :- I > 0.\n#domain n(I).\n"
    text += "pr(s(I) | s(I-1)) = 0.8.\npr(s(I) | s(I-1)=false) = 0.4."
    program = parse_plog(text)
    states, rng = [True], np.random.default_rng(7)
    for _ in range(999):
        states.append(bool(rng.random() < (0.9 if states[-1] else 0.1)))
    result = fit(program, [{f"s({i})": str(s).lower() for i, s in enumerate(states)}])
    pairs = list(pairwise(states))
    for number, before in zip(result.numbers, (True, False), strict=True):
        own = [after for state, after in pairs if state == before]
        assert float(number.value) == pytest.approx(sum(own) / len(own), abs=1e-5)
    chances = [float(result.numbers[not before].value) for before, _ in pairs]
    steps = sum(log(p if after else 1 - p) for p, (_, after) in zip(chances, pairs, strict=True))
    assert result.log_likelihood == pytest.approx(log(0.5) + steps, abs=1e-3)


@pytest.mark.slow
def test_intervals_cover_the_numbers_of_the_paper() -> None:
    """100 data sets of 20,000 records: identity hidden; hidden with known times; hidden in half of them."""
    program = read_plog(PAPER)
    worlds = Enumeration(program).worlds
    measures = np.array([float(w.measure) for w in worlds])
    inside: dict[str, list[bool]] = {"hidden": [], "known times": [], "half": []}
    for seed in range(100):
        rng = np.random.default_rng(seed)
        counts = rng.multinomial(20_000, measures / measures.sum())
        full = [dict(w.values) for w, n in zip(worlds, counts, strict=True) for _ in range(n)]
        hidden = [{t: v for t, v in record.items() if t != "identity"} for record in full]
        half = [own[int(rng.integers(2))] for own in zip(full, hidden, strict=True)]
        for name, data, fixed in (
            ("hidden", hidden, []),
            ("known times", hidden, ["time"]),
            ("half", half, []),
        ):
            for number in fit(program, data, fixed=fixed).numbers:
                is_open = name == "hidden" and number.statement.term.name != "classifier"
                assert (number.interval is None) == is_open
                if number.interval is not None:
                    low, high = number.interval
                    inside[name].append(low <= float(number.old) <= high)
    assert [len(own) for own in inside.values()] == [200, 800, 1400]
    assert {name: 0.93 <= np.mean(own) <= 0.97 for name, own in inside.items()} == dict.fromkeys(inside, True)


def test_likelihoods_of_values_are_mixtures_of_records():
    """With likelihoods 1 and 0 a value is observed; with equal ones it is not."""
    program = parse_plog(
        "a: {x, y}. b: {u, v}. random(a). random(b). pr(a=x) = 0.3. pr(b=u | a=x) = 0.6. pr(b=u | a=y) = 0.2."
    )
    hard = (
        [{"a": "x", "b": "u"}] * 6
        + [{"a": "y", "b": "u"}] * 2
        + [{"a": "y", "b": "v"}] * 5
        + [{"b": "u"}] * 4
    )
    soft = [
        SoftRecord(
            {"b": own["b"]}, (({"a": "x"}, float(own["a"] == "x")), ({"a": "y"}, float(own["a"] == "y")))
        )
        for own in hard[:13]
    ]
    soft += [SoftRecord({"b": "u"}, (({"a": "x"}, 0.5), ({"a": "y"}, 0.5)))] * 4
    one, other = fit(program, hard), fit(program, soft)
    assert [own.value for own in one.numbers] == [own.value for own in other.numbers]
    assert [own.interval for own in one.numbers] == [
        pytest.approx(own.interval, abs=1e-4) for own in other.numbers
    ]
    with pytest.raises(
        DataError, match=r"a record has the likelihoods \[-1.0, 2.0\]; expected numbers from 0"
    ):
        SoftRecord({}, (({"a": "x"}, -1.0), ({"a": "y"}, 2.0)))


def test_a_search_begins_at_other_numbers():
    """A hidden cause has two maxima, and the search finds that of its beginning."""
    text = "h: {{l, r}}. b: {{u, v}}. random(h). random(b). pr(h=l) = 1/2. "
    text += "pr(b=u | h=l) = {}. pr(b=u | h=r) = {}."
    program = parse_plog(text.format(0.5, 0.5))
    records = [{"b": "u"}] * 5 + [{"b": "v"}] * 5
    for first, second in ((0.9, 0.2), (0.2, 0.9)):
        begin = parse_plog(text.format(first, second))
        numbers = [float(own.value) for own in fit(program, records, begin=begin).numbers]
        assert (numbers[1] > numbers[2]) == (first > second)
    other = parse_plog("h: {l, r}. random(h). pr(h=l) = 1/2.")
    with pytest.raises(ProgramError, match=r"has random\(h\)\. where"):
        fit(program, records, begin=other)
    with pytest.raises(ProgramError, match="a number to begin with is 0 or 1"):
        fit(program, records, begin=parse_plog(text.format(0, 0.5)))


def test_records_of_parquet_are_those_of_csv(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    columns = {"a": ["x", None, "y"], "n": [1, 2, None], "is_open": [True, False, None]}
    parquet.write_table(arrow.table(columns), tmp_path / "own.parquet")
    records = list(read_records(tmp_path / "own.parquet"))
    assert records == [{"a": "x", "n": "1", "is_open": "true"}, {"n": "2", "is_open": "false"}, {"a": "y"}]
    assert records[1].place == f"{tmp_path / 'own.parquet'}: row 2"
    (tmp_path / "bad.parquet").write_bytes(b"a,b\n1,2\n")
    with pytest.raises(DataError, match=r"bad\.parquet: not a Parquet file, or a damaged one"):
        list(read_records(tmp_path / "bad.parquet"))

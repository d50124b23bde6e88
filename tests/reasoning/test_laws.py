"""Laws on random programs: worlds counted in plain Python, round trips of texts, errors of invalid texts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import pytest
from hypothesis import example, given, settings, strategies as st

from lcorpp.errors import ParseError, ProgramError, UndefinedError
from lcorpp.reasoning import Enumeration, Program, parse_plog, parse_query, program_text
from lcorpp.reasoning.language.syntax import Arithmetic, Number, Probability, Term, Variable

World = dict[str, str]
VALUES = ("u", "v", "w")


@dataclass(frozen=True)
class Condition:
    """One condition on an earlier attribute: sign is '', 'not ' or '!='."""

    name: str
    value: str
    sign: str

    def __str__(self) -> str:
        return f"{self.name}!={self.value}" if self.sign == "!=" else f"{self.sign}{self.name}={self.value}"

    def holds(self, world: World) -> bool:
        has = world.get(self.name)
        if self.sign == "!=":
            return has is not None and has != self.value
        return (has == self.value) != (self.sign == "not ")


@dataclass(frozen=True)
class Step:
    """One attribute, random or derived, that depends on earlier ones."""

    name: str
    body: tuple[Condition, ...]
    excluded: (
        tuple[Condition, str] | None
    )  # this value is outside of the dynamic range if the condition holds
    numbers: tuple[tuple[str, Fraction, tuple[Condition, ...]], ...]
    derived: str | None

    def text(self) -> str:
        body = f" :- {', '.join(map(str, self.body))}" if self.body else ""
        if self.derived:
            return f"{self.name} : s. {self.name}={self.derived}{body}."
        lines = [f"{self.name} : s."]
        chosen = ""
        if self.excluded:
            condition, value = self.excluded
            lines.append(f"out_{self.name} : s -> boolean. out_{self.name}({value}) :- {condition}.")
            chosen = f" : {{X : not out_{self.name}(X)}}"
        lines.append(f"random({self.name}{chosen}){body}.")
        for value, number, needed in self.numbers:
            condition = f" | {', '.join(map(str, needed))}" if needed else ""
            lines.append(f"pr({self.name}={value}{condition}) = {number}.")
        return " ".join(lines)


class Broken(Exception):
    """A condition of the language is broken."""


def brute(steps: list[Step], world: World, weight: Fraction, cut: str) -> Iterator[tuple[World, Fraction]]:
    """All worlds, in causal order; `cut` is the observed attribute that do() sets."""
    if not steps:
        yield world, weight
        return
    step, rest = steps[0], steps[1:]
    name, _, value = cut.partition("=")
    if name == step.name:
        yield from brute(rest, {**world, name: value}, weight, cut)
        return
    if not all(condition.holds(world) for condition in step.body):
        yield from brute(rest, world, weight, cut)
        return
    if step.derived:
        yield from brute(rest, {**world, step.name: step.derived}, weight, cut)
        return
    out = step.excluded[1] if step.excluded and step.excluded[0].holds(world) else ""
    possible = [value for value in VALUES if value != out]
    numbers: dict[str, Fraction] = {}
    for outcome, number, needed in step.numbers:
        if all(condition.holds(world) for condition in needed):
            if outcome in numbers or outcome not in possible:
                raise Broken
            numbers[outcome] = number
    free = [v for v in possible if v not in numbers]
    total = sum(numbers.values(), Fraction(0))
    if total > 1 or (not free and total != 1):
        raise Broken
    for outcome in possible:
        share = numbers.get(outcome, (1 - total) / max(len(free), 1))
        yield from brute(rest, {**world, step.name: outcome}, weight * share, cut)


@st.composite
def programs(draw: st.DrawFn) -> list[Step]:
    steps: list[Step] = []
    for index in range(draw(st.integers(1, 4))):
        earlier = [step.name for step in steps]
        condition = (
            st.builds(
                Condition,
                st.sampled_from(earlier),
                st.sampled_from(VALUES),
                st.sampled_from(["", "not ", "!="]),
            )
            if earlier
            else None
        )
        bodies = st.lists(condition, max_size=1).map(tuple) if condition is not None else st.just(())
        numbers = st.tuples(st.sampled_from(VALUES), st.integers(0, 4).map(lambda n: Fraction(n, 4)), bodies)
        derived = draw(st.sampled_from([None, None, None, *VALUES])) if earlier else None
        excluded = (
            st.none() | st.tuples(condition, st.sampled_from(VALUES)) if condition is not None else st.none()
        )
        steps.append(
            Step(
                f"a{index}",
                draw(bodies),
                None if derived else draw(excluded),
                () if derived else tuple(draw(st.lists(numbers, max_size=2))),
                derived,
            )
        )
    return steps


@given(steps=programs(), data=st.data())
@settings(max_examples=30)
def test_agrees_with_worlds_counted_in_plain_python(steps: list[Step], data: st.DataObject) -> None:
    names = [step.name for step in steps]
    literals = st.builds(
        Condition, st.sampled_from(names), st.sampled_from(VALUES), st.sampled_from(["", "not ", "!="])
    )
    seen, asked = data.draw(st.lists(literals, max_size=2)), data.draw(literals)
    free = [step.name for step in steps if not step.derived]
    cut = data.draw(st.just("") | st.builds("{}={}".format, st.sampled_from(free), st.sampled_from(VALUES)))
    program = parse_plog("s = {u, v, w}. " + "\n".join(step.text() for step in steps))
    conditions = [f"obs({literal})" for literal in seen] + ([f"do({cut})"] if cut else [])
    query = parse_query(f"?{{{asked}}}{' | ' if conditions else ''}{', '.join(conditions)}", program)
    try:
        worlds = list(brute(steps, {}, Fraction(1), cut))
    except Broken:
        with pytest.raises(ProgramError):
            Enumeration(program).ask(query)
        return
    kept = [(world, weight) for world, weight in worlds if all(literal.holds(world) for literal in seen)]
    total = sum(weight for _, weight in kept)
    if total == 0:
        with pytest.raises(UndefinedError):
            Enumeration(program).ask(query)
        return
    answer = sum(weight for world, weight in kept if asked.holds(world)) / Fraction(total)
    assert Enumeration(program).ask(query) == answer


@given(steps=programs())
@settings(max_examples=25)
def test_text_reads_back_equal(steps: list[Step]) -> None:
    program = parse_plog("s = {u, v, w}. " + "\n".join(step.text() for step in steps))
    assert parse_plog(program_text(program)) == program


NUMBERS = st.recursive(
    st.builds(Number, st.decimals(-9, 9, places=2).map(Fraction)) | st.just(Variable("K")),
    lambda inner: st.builds(Arithmetic, st.sampled_from(["+", "-", "*", "/", "mod"]), inner, inner),
    max_leaves=8,
)


@given(number=NUMBERS)
@settings(max_examples=50)
def test_arithmetic_reads_back_equal(number: Number | Arithmetic) -> None:
    base = parse_plog("n = {1..3}. k : n. random(k). p : boolean. random(p). q : boolean. q :- k = K.")
    number = Arithmetic("+", Variable("K"), number)  # a number without variables would be kept evaluated
    atom = Probability(Term("k"), Variable("K"), number)
    program = Program("made", (*base.statements, atom))
    assert parse_plog(program_text(program)) == program


TOKENS = r"""
s p f X Y 1 2.5 .. . , : :- = != < ( ) { } [ ] | ? - + * / \ -> # #domain not random pr obs do mod sorts
attributes statements boolean #s #const #semantics +- :+ %* *% & ! _ 2018 true %"""
WORDS = st.sampled_from([*TOKENS.split(), "\n"])


@given(st.text(max_size=40) | st.lists(WORDS, max_size=25).map(" ".join))
@settings(max_examples=75)
@example("s={a,b}. f : s -> s. random(f(X)). pr(f(a)=X | f(b)=X) = X.")
@example("p : boolean. p :- " + "(" * 5000)
@example("p : boolean. -" + "-" * 5000 + "1.")
@example("\x00")
@example("p : boolean. random(p). pr(p) = 0." + "1" * 5000 + ".")
@example("#s = " + "(" * 5000)
@example("#s = f(" * 5000)
@example("#s = f({a}(X)) : " + "(" * 5000)
@example("#s = {a}" + " * {a}" * 5000 + ".")
@example("p : boolean. ?{" + "!" * 5000 + "p}.")
@example("p : boolean. ?{" + "(" * 5000 + "p}.")
@example("%*" * 5000 + "*%")
@example("s={1..99999}. " * 3 + "#t = f(#s, #s).")
@example("".join(f"s{i}={{1..99999}}. " for i in range(30)))
def test_any_text_is_a_program_or_a_typed_error(text: str) -> None:
    try:
        program = parse_plog(text)
    except (ParseError, ProgramError) as error:
        located = str(error)
    else:
        located = "<text>:"
        assert parse_plog(program_text(program)) == program
    assert located.startswith("<text>:")

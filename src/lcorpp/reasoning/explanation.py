"""Explanations of answers: the effect of each condition, and the most probable worlds with their rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from lcorpp.errors import LcorppError, ProgramError, UndefinedError, check_type
from lcorpp.reasoning.answers import PossibleWorld, QueryAnswer
from lcorpp.reasoning.grounding.ground_program import ASSIGN, DERIVE, SELECT, Clause, GroundProgram
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.reasoner import Reasoner
from lcorpp.reasoning.resolve import resolve_query


@dataclass(frozen=True)
class FiredRule:
    """A statement whose body is true in a world.

    at: its place.
    statement: its text.
    effect: its consequence in the world, such as `a=v`.
    """

    at: Place
    statement: str
    effect: str


@dataclass(frozen=True, repr=False)
class Explanation:
    """The parts of an answer.

    answer: the answer, None if no possible world satisfies the conditions.
    without: each condition of the query, and the answer without it, or the message of its error.
    worlds: the most probable worlds that satisfy the conditions, each with the rules that fire in it. World
        probabilities are conditional. Empty for programs with cr-rules.
    """

    query: Query
    answer: QueryAnswer | None
    without: tuple[tuple[str, QueryAnswer | str], ...]
    worlds: tuple[tuple[PossibleWorld, tuple[FiredRule, ...]], ...]

    def __repr__(self) -> str:
        return (
            f"<Explanation of {self.query}: answer {self.answer}, {len(self.without)} conditions,"
            f" {len(self.worlds)} worlds>"
        )


def explain(reasoner: Reasoner, query: Query, *, count: int = 3) -> Explanation:
    """Explain the answer to a query.

    Args:
        reasoner: the reasoner that answers.
        query: a query to its program.
        count: the number of worlds.

    Raises:
        ProgramError: a name in the query is unknown, or a world violates a condition of the language.
        TooLargeError: the program is too large to be compiled.
    """
    check_type(reasoner, Reasoner, "reasoner", ProgramError)
    query = resolve_query(reasoner.program, query)
    worlds = () if reasoner.program.has_cr_rules else reasoner.list_worlds(query, count)
    answer: QueryAnswer | None
    try:
        answer = reasoner.ask(query, exact=True)
    except UndefinedError:
        answer = None
    without: list[tuple[str, QueryAnswer | str]] = []
    for condition, rest in _drop_conditions(query):
        try:
            without.append((condition, reasoner.ask(rest, exact=True)))
        except LcorppError as error:
            without.append((condition, str(error)))
    fired = [_find_fired(reasoner.build_model(query).ground, world.values) for world in worlds]
    return Explanation(query, answer, tuple(without), tuple(zip(worlds, fired, strict=True)))


def _drop_conditions(query: Query) -> Iterator[tuple[str, Query]]:
    """Iterate over the conditions of a query: its text, and the query without it."""
    for name in ("observations", "interventions"):
        conditions = getattr(query, name)
        for i, condition in enumerate(conditions):
            yield str(condition)[:-1], replace(query, **{name: conditions[:i] + conditions[i + 1 :]})


def _find_fired(ground: GroundProgram, values: Mapping[str, str]) -> tuple[FiredRule, ...]:
    """Find the statements whose bodies are true in a world, in program order; facts are omitted."""
    outcomes = []
    for name, domain in zip(ground.names, ground.values, strict=True):
        value = values.get(name)
        outcomes.append(len(domain) if value is None else domain.index(value))
    true = [c for c in ground.clauses if all(allowed >> outcomes[t] & 1 for t, allowed, _ in c.body)]
    selected = {c.term for c in true if c.kind is SELECT and c.term not in ground.do}
    fired: dict[tuple[int, str], FiredRule] = {}
    for clause in true:
        effect = _format_effect(ground, clause, outcomes, selected)
        if effect:
            statement = ground.source.statements[clause.statement]
            fired.setdefault((clause.statement, effect), FiredRule(statement.at, str(statement), effect))
    return tuple([fired[key] for key in sorted(fired)])


def _format_effect(
    ground: GroundProgram, clause: Clause, outcomes: Sequence[int], selected: set[int]
) -> str | None:
    if clause.statement < 0 or clause.term < 0:
        return None
    name, values, outcome = ground.names[clause.term], ground.values[clause.term], outcomes[clause.term]
    if clause.kind is DERIVE:
        return f"{name}={values[clause.value]}" if clause.body else None
    if clause.kind is ASSIGN and clause.term in selected and outcome == clause.value:
        return f"{name}={values[clause.value]} with probability {clause.number}"
    if clause.kind is SELECT and clause.term in selected and outcome < len(values):
        return f"{name} is random, here {values[outcome]}"
    return None

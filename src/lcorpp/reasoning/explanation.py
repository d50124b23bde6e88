"""Why an answer is what it is: what each condition does, the most probable worlds, their rules."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from lcorpp.errors import LcorppError, UndefinedError
from lcorpp.reasoning.circuit.trellis import build_trellis
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.grounder import QUERY_TERM, ground_program
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Place, Query
from lcorpp.reasoning.reasoner import Answer, Reasoner
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.reasoning.world import World

Result = dict[str, Answer] | Answer


@dataclass(frozen=True)
class Fired:
    """A statement whose condition is true in a world.

    at: where it stands.
    statement: its text.
    says: what it says there, of which term.
    """

    at: Place
    statement: str
    says: str


@dataclass(frozen=True)
class Explanation:
    """An answer taken apart.

    answer: the answer itself; None if no possible world has the evidence.
    without: each condition of the query, and the answer without it, or the words of the error it then is.
    worlds: the most probable worlds with their probabilities given the evidence, and what fired in each.
    """

    query: Query
    answer: Result | None
    without: tuple[tuple[str, Result | str], ...]
    worlds: tuple[tuple[World, tuple[Fired, ...]], ...]


def explain(program: Program, query: Query, *, count: int = 3) -> Explanation:
    """Explain the answer to a query.

    Args:
        count: how many worlds.

    Raises:
        ProgramError: the query is not about this program, or a world breaks a condition of the language.
        TooLargeError: the program has too many states.
    """
    engine = Reasoner(program)
    try:
        answer: Result | None = engine.ask(query, exact=True)
    except UndefinedError:
        answer = None
    without: list[tuple[str, Result | str]] = []
    for number, observation in enumerate(query.observations):
        rest = query.observations[:number] + query.observations[number + 1 :]
        without.append((str(observation)[:-1], _answer(engine, replace(query, observations=rest))))
    for number, intervention in enumerate(query.interventions):
        others = query.interventions[:number] + query.interventions[number + 1 :]
        without.append((str(intervention)[:-1], _answer(engine, replace(query, interventions=others))))
    return Explanation(query, answer, tuple(without), _worlds(program, query, count))


def _answer(engine: Reasoner, query: Query) -> Result | str:
    try:
        return engine.ask(query, exact=True)
    except LcorppError as error:
        return str(error)


def _worlds(program: Program, query: Query, count: int) -> tuple[tuple[World, tuple[Fired, ...]], ...]:
    if program.has_cr_rules:
        return ()
    query = program.named(query)
    do = {canonical_text(item.term): canonical_text(item.value) for item in query.interventions}
    observed = [observation.literal for observation in query.observations]
    found = WorldQueries(build_trellis(build_transition_system(program, do, observed))).most_probable(
        {}, count
    )
    ground_rules = ground_program(program, do, observed)
    return tuple([(world, _fired(ground_rules, world.values)) for world in found])


def _fired(program: GroundProgram, values: Mapping[str, str]) -> tuple[Fired, ...]:
    """The statements whose bodies are true in a world, in the order of the program; facts are left out."""
    has = []
    for name, own in zip(program.names, program.values, strict=True):
        value = values.get(name)
        has.append(len(own) if value is None else own.index(value))
    true = [c for c in program.clauses if all(allowed >> has[t] & 1 for t, allowed, _ in c.body)]
    selected = {c.term for c in true if c.kind is ClauseKind.SELECT and c.term not in program.do}
    found: dict[tuple[int, str], Fired] = {}
    for clause in true:
        says = _says(program, clause, has, selected)
        if says:
            statement = program.source.statements[clause.statement]
            found.setdefault((clause.statement, says), Fired(statement.at, str(statement), says))
    return tuple([found[key] for key in sorted(found)])


def _says(program: GroundProgram, clause: Clause, has: list[int], selected: set[int]) -> str | None:
    if clause.statement < 0 or clause.term < 0 or program.names[clause.term] == QUERY_TERM:
        return None
    name, values = program.names[clause.term], program.values[clause.term]
    if clause.kind is ClauseKind.DERIVE:
        return f"{name}={values[clause.value]}" if clause.body else None
    if clause.kind is ClauseKind.ASSIGN and clause.term in selected and has[clause.term] == clause.value:
        return f"{name}={values[clause.value]} with probability {clause.number}"
    if clause.kind is ClauseKind.SELECT and clause.term in selected and has[clause.term] < len(values):
        return f"{name} is random, here {values[has[clause.term]]}"
    return None

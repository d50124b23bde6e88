"""Explanations of answers: the effect of each condition, and the most probable worlds with their rules."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from lcorpp.errors import LcorppError, ProgramError, UndefinedError, check_type
from lcorpp.notebook import html_table
from lcorpp.reasoning.answers import PossibleWorld, QueryAnswer, format_world
from lcorpp.reasoning.grounding.ground_program import ASSIGN, DERIVE, SELECT, Clause, GroundProgram
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.reasoner import Reasoner
from lcorpp.reasoning.resolve import resolve_query
from lcorpp.values import format_value


@dataclass(frozen=True)
class FiredRule:
    """A statement whose body is true in a world.

    at: its place.
    statement: its text.
    effect: its consequence in the world, such as `a=v`.
    term, value: the head, in the world; the value "" of a selection without probabilities.
    conditions: the terms of the body with their values in the world, "" of a term without value.
    probability: that a pr-atom assigns to the value, else None.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> from lcorpp.reasoning import explain, parse_query
        >>> wet = parse_plog("rain, wet : boolean. random(rain). wet :- rain.")
        >>> (_, rules), *_ = explain(Reasoner(wet), parse_query("?rain | obs(wet).", wet)).worlds
        >>> [(rule.statement, rule.effect) for rule in rules]
        [('random(rain).', 'rain is random, here true'), ('wet=true :- rain=true.', 'wet=true')]
    """

    at: Place
    statement: str
    effect: str
    term: str
    value: str
    conditions: tuple[tuple[str, str], ...]
    probability: Fraction | None = None


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

    def _repr_html_(self) -> str:
        rows = [("answer", str(self.query), format_answer(self.answer))]
        for condition, answer in self.without:
            rows.append(("without", condition, format_answer(answer)))
        for world, fired in self.worlds:
            rules = " ".join(rule.statement for rule in fired if rule.value)
            rows.append((f"world of {float(world.measure):.3g}", format_world(world.values), rules))
        return html_table(("part", "what", "answer or rules"), rows, caption=f"Explanation of {self.query}")


def format_answer(answer: QueryAnswer | str | None) -> str:
    """Format an answer in decimals; None is that of conditions that no world satisfies."""
    if isinstance(answer, dict):
        return ", ".join(f"{format_value(value)}: {float(p):.4g}" for value, p in answer.items())
    return "no world" if answer is None else answer if isinstance(answer, str) else f"{float(answer):.4g}"


def explain(reasoner: Reasoner, query: Query, *, count: int = 3) -> Explanation:
    """Explain the answer to a query.

    Args:
        reasoner: the reasoner that answers.
        query: a query to its program.
        count: the number of worlds.

    Raises:
        ProgramError: a name in the query is unknown, or a world violates a condition of the language.
        TooLargeError: the program is too large to be compiled.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> from lcorpp.reasoning import explain, parse_query
        >>> program = parse_plog("a, b : boolean. random(a). random(b). pr(b | a) = 3/4. pr(b | -a) = 1/4.")
        >>> explanation = explain(Reasoner(program), parse_query("?{a} | obs(b).", program))
        >>> str(explanation.answer), [(condition, str(answer)) for condition, answer in explanation.without]
        ('3/4', [('obs(b=true)', '1/2')])
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
    fired = [find_fired(reasoner, query, world) for world in worlds]
    return Explanation(query, answer, tuple(without), tuple(zip(worlds, fired, strict=True)))


def _drop_conditions(query: Query) -> Iterator[tuple[str, Query]]:
    """Iterate over the conditions of a query: its text, and the query without it."""
    for name in ("observations", "interventions"):
        conditions = getattr(query, name)
        for i, condition in enumerate(conditions):
            yield str(condition)[:-1], replace(query, **{name: conditions[:i] + conditions[i + 1 :]})


def find_fired(reasoner: Reasoner, query: Query, world: PossibleWorld) -> tuple[FiredRule, ...]:
    """Find the statements whose bodies are true in a world, in program order; facts are omitted.

    A pr-atom is listed if it assigns the probability of the value in the world, or if no other one does, so
    that the value has what the pr-atoms of other values leave.

    Args:
        query: to which the world belongs, as `Reasoner.list_worlds` found it.

    Examples:
        >>> from lcorpp import Reasoner, parse_plog
        >>> from lcorpp.reasoning import find_fired, parse_query
        >>> program = parse_plog("rain, wet : boolean. random(rain). pr(rain) = 1/5. wet :- rain.")
        >>> reasoner, query = Reasoner(program), parse_query("?wet | obs(rain).", program)
        >>> [rule.effect for rule in find_fired(reasoner, query, *reasoner.list_worlds(query, 1))]
        ['rain is random, here true', 'rain=true with probability 1/5', 'wet=true']
    """
    ground, values = reasoner.build_model(resolve_query(reasoner.program, query)).ground, world.values
    outcomes = []
    for name, domain in zip(ground.names, ground.values, strict=True):
        value = values.get(name)
        outcomes.append(len(domain) if value is None else domain.index(value))
    true = [c for c in ground.clauses if all(allowed >> outcomes[t] & 1 for t, allowed, _ in c.body)]
    selected = {c.term for c in true if c.kind is SELECT and c.term not in ground.do}
    assigned = {c.term for c in true if c.kind is ASSIGN and outcomes[c.term] == c.value}
    fired: dict[tuple[int, str], FiredRule] = {}
    for clause in true:
        if clause.kind is ASSIGN and clause.term in assigned and outcomes[clause.term] != clause.value:
            continue
        effect = _format_effect(ground, clause, outcomes, selected)
        if effect:
            statement = ground.source.statements[clause.statement]
            conditions = {ground.names[t]: values.get(ground.names[t], "") for t, _, _ in clause.body}
            fired.setdefault(
                (clause.statement, effect),
                FiredRule(
                    statement.at,
                    str(statement),
                    effect,
                    ground.names[clause.term],
                    "" if clause.kind is SELECT else ground.values[clause.term][clause.value],
                    tuple(conditions.items()),
                    clause.number if clause.kind is ASSIGN else None,
                ),
            )
    return tuple([fired[key] for key in sorted(fired)])


def _format_effect(
    ground: GroundProgram, clause: Clause, outcomes: Sequence[int], selected: set[int]
) -> str | None:
    if clause.statement < 0 or clause.term < 0:
        return None
    name, values, outcome = ground.names[clause.term], ground.values[clause.term], outcomes[clause.term]
    if clause.kind is DERIVE:
        return f"{name}={values[clause.value]}" if clause.body else None
    if clause.kind is ASSIGN and clause.term in selected and outcome < len(values):
        other = "" if outcome == clause.value else f", here {values[outcome]}"
        return f"{name}={values[clause.value]} with probability {clause.number}{other}"
    if clause.kind is SELECT and clause.term in selected and outcome < len(values):
        return f"{name} is random, here {values[outcome]}"
    return None

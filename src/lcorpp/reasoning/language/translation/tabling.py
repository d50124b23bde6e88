"""Tabled evaluation of a ProbLog program: the ground instances of clauses on which its queries depend.

As ProbLog, from the goals to the facts, with the goals of a body from left to right. Each call has a table of
its answers; calls that depend on each other are evaluated repeatedly until no table changes. Chance is left
open: an atom that may be true has its derivations, whose literals are atoms of that kind, too. Atoms that are
certainly true or false are decided here.

Source: Fierens et al., TPLP 15(3), 2015, section 5.1 (grounding); Zhou, Sato and Shen, "Linear tabling
strategies and optimizations", TPLP 8(1), 2008.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TypeAlias

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.translation.problog_clauses import Goal, PrologClause
from lcorpp.reasoning.language.translation.prolog_arithmetic import compute_probability
from lcorpp.reasoning.language.translation.prolog_builtins import BUILTINS, MODAL
from lcorpp.reasoning.language.translation.prolog_terms import (
    Compound,
    PrologTerm,
    PrologVariable,
    abbreviate,
    is_ground,
    iter_term_variables,
    rename,
    substitute,
    unify,
)
from lcorpp.reasoning.language.translation.tables import Choice, Derivation, GroundLiteral, Table

MAX_STEPS = 2_000_000
"""Maximal number of solutions of goals, counted again when a call is evaluated again."""

MAX_CALLS = 100_000
"""Maximal number of calls that wait for each other; each needs about a kilobyte."""


@dataclass(eq=False)
class _Frame:
    """A table that is being evaluated.

    low: the least depth of a table in evaluation on which this one depends.
    """

    table: Table
    steps: Generator[tuple[Compound, Place], Table, None]
    low: float = inf
    members: list[Table] = field(default_factory=list)


_State: TypeAlias = tuple[dict[PrologVariable, PrologTerm], tuple[GroundLiteral, ...]]
"""Bindings of a clause's variables, and the literals that they leave open."""


class Evaluation:
    """Evaluates calls to a program."""

    def __init__(self, clauses: Sequence[PrologClause]) -> None:
        self.tables: dict[Compound, Table] = {}
        # ground atom -> the complete table of a call with variables that has this answer; as in ProbLog, the
        # table answers later calls of the atom
        self._shared: dict[Compound, Table] = {}
        self._clauses = clauses
        # predicate -> (index of the clause, index of the head); with the constant that is the first argument
        self._heads: dict[tuple[str, int], list[tuple[int, int]]] = {}
        self._indexed: dict[tuple[str, int], dict[PrologTerm | None, list[tuple[int, int]]]] = {}
        for index, clause in enumerate(clauses):
            for number, (_, head) in enumerate(clause.heads):
                self._heads.setdefault(head.key, []).append((index, number))
        self._round = self._steps = self._names = 0

    def defines(self, key: tuple[str, int]) -> bool:
        """Whether a predicate has clauses."""
        return key in self._heads

    def solve(self, call: Compound, at: Place) -> Table:
        """Return the complete table of a call.

        Raises:
            SourceIssue: a predicate without clauses, an error of arithmetic, or too many answers.
        """
        stack: list[_Frame] = []
        table: Table | None = self._enter(call, at, stack)
        while stack:
            frame = stack[-1]
            try:
                call, at = next(frame.steps) if table is None else frame.steps.send(table)
            except StopIteration:
                table = self._leave(stack)
            else:
                table = self._enter(call, at, stack)
        assert table is not None
        return table

    def _enter(self, call: Compound, at: Place, stack: list[_Frame]) -> Table | None:
        """Return the table of a call, or push a frame that evaluates it."""
        call = rename(call, {}, "_''")  # type: ignore[assignment]  # a compound term
        table = self._shared.get(call) or self.tables.get(call)
        if table is None:
            if not self.defines(call.key):
                words = "has no clause; builtin and library predicates are not translated"
                raise SourceIssue(at, f"{call.name}/{len(call.arguments)} {words}")
            table = self.tables[call] = Table(call, at)
        low = inf
        if table.is_complete:
            pass
        elif table.depth is not None:
            low = table.depth
        elif table.round == self._round:
            low = table.low
        else:
            table.depth = len(stack)
            if table.depth >= MAX_CALLS:
                words = "calls that wait for each other, perhaps without end"
                raise SourceIssue(
                    at, f"{call.name}/{len(call.arguments)} makes more than {MAX_CALLS} {words}"
                )
            stack.append(_Frame(table, self._evaluate(table)))
            return None
        if stack:
            stack[-1].low = min(stack[-1].low, low)
            stack[-1].table.uses[table] = None
        return table

    def _leave(self, stack: list[_Frame]) -> Table | None:
        """End the evaluation of a table: repeat it with those that depend on it until nothing changes."""
        frame = stack[-1]
        table = frame.table
        if frame.low == table.depth and table.has_changed:
            self._round += 1
            table.has_changed = False
            frame.steps, frame.members = self._evaluate(table), []
            return None
        stack.pop()
        if frame.low < len(stack):  # it depends on a table below, with which it is repeated
            parent = stack[-1]
            parent.low = min(parent.low, frame.low)
            parent.table.has_changed |= table.has_changed
            parent.members += [*frame.members, table]
            table.round, table.low, table.has_changed = self._round, frame.low, False
        else:
            for member in (table, *frame.members):
                self._complete(member)
        table.depth = None
        if stack:
            stack[-1].table.uses[table] = None
        return table

    def _complete(self, table: Table) -> None:
        table.is_complete = True
        if not table.call.is_ground and all(answer.is_ground for answer in table.answers):
            self._shared.update(dict.fromkeys(table.answers, table))

    def _count_steps(self, count: int, at: Place) -> None:
        self._steps += count
        if self._steps > MAX_STEPS:
            raise SourceIssue(at, f"more than {MAX_STEPS} steps to find the instances, perhaps without end")

    # clauses

    def _evaluate(self, table: Table) -> Generator[tuple[Compound, Place], Table, None]:
        """Add the answers that the clauses give now; yields calls and receives their tables."""
        table.derivations = {}
        for index, number in self._list_heads(table.call):
            clause = self._clauses[index]
            probability, head = clause.heads[number]
            for conjunction in clause.alternatives:
                bindings: dict[PrologVariable, PrologTerm] = {}
                if not unify(head, table.call, bindings):
                    break
                states: list[_State] = [(bindings, ())]
                for goal in conjunction:
                    states = yield from self._extend(table, states, goal)
                    self._count_steps(1 + len(states), goal.at)
                    if not states:
                        break
                for state in states:
                    self._add(table, head, probability, clause, index, number, state)

    def _list_heads(self, call: Compound) -> list[tuple[int, int]]:
        """List the clauses whose head may match a call, by its first argument if that is known."""
        key = call.key
        first = call.arguments[0] if call.arguments else None
        if first is None or not is_ground(first):
            return self._heads[key]
        if key not in self._indexed:
            self._indexed[key] = self._index_heads(key)
        index = self._indexed[key]
        return index.get(first, index[None])

    def _index_heads(self, key: tuple[str, int]) -> dict[PrologTerm | None, list[tuple[int, int]]]:
        """Index the heads of a predicate by the first argument; the key None is for all other constants."""
        firsts = [(pair, self._clauses[pair[0]].heads[pair[1]][1].arguments[0]) for pair in self._heads[key]]
        index: dict[PrologTerm | None, list[tuple[int, int]]] = {None: []}
        index |= {first: [] for _, first in firsts if is_ground(first)}
        for pair, first in firsts:
            for pairs in [index[first]] if is_ground(first) else index.values():
                pairs.append(pair)
        return index

    def _extend(
        self, table: Table, states: Iterable[_State], goal: Goal
    ) -> Generator[tuple[Compound, Place], Table, list[_State]]:
        """Extend the states by the solutions of a goal."""
        extended: list[_State] = []
        for bindings, literals in states:
            atom = substitute(goal.term, bindings)
            assert isinstance(atom, Compound)
            if not atom.is_ground and (goal.negated or atom.key in MODAL):
                table.is_modal = True
            if builtin := BUILTINS.get(atom.key):
                solutions = [
                    new
                    for left, right in builtin(atom.arguments, goal.at)
                    if unify(left, right, new := dict(bindings), quoted=False)
                ]
                if goal.negated:
                    solutions = [] if solutions else [bindings]
                extended.extend((new, literals) for new in solutions)
            elif goal.negated:
                called = yield atom, goal.at
                if not called.is_complete:
                    words = "depends on its own negation; ProbLog has no answer for such a cycle"
                    raise SourceIssue(goal.at, f"{abbreviate(atom)} {words}")
                answers = called.select_answers(atom)
                if not any(answers.values()):
                    added = [GroundLiteral(called, _require_ground(x, goal.at), True) for x in answers]
                    extended.append((bindings, (*literals, *added)))
            else:
                called = yield atom, goal.at
                extended.extend(self._join(atom, called, bindings, literals, goal.at))
        return extended

    def _join(
        self,
        atom: Compound,
        table: Table,
        bindings: dict[PrologVariable, PrologTerm],
        literals: tuple[GroundLiteral, ...],
        at: Place,
    ) -> Iterator[_State]:
        for answer, is_certain in table.select_answers(atom).items():
            new = dict(bindings)
            if not answer.is_ground:
                self._names += 1
                fresh = rename(answer, {}, f"A{self._names}'")
            else:
                fresh = answer
            if unify(atom, fresh, new):
                if is_certain:
                    yield new, literals
                else:
                    yield new, (*literals, GroundLiteral(table, _require_ground(answer, at), False))

    def _add(
        self,
        table: Table,
        head: Compound,
        probability: PrologTerm | None,
        clause: PrologClause,
        index: int,
        number: int,
        state: _State,
    ) -> None:
        """Add the answer of a clause."""
        bindings, literals = state
        answer = rename(substitute(head, bindings), {}, "_''")
        assert isinstance(answer, Compound)
        choice = None
        if probability is not None:
            value = compute_probability(substitute(probability, bindings), clause.at)
            values = tuple([substitute(name, bindings) for name in clause.variables])
            for name, term in zip(clause.variables, values, strict=True):
                if not is_ground(term):
                    words = "has no value when the probability is needed; expected a goal that binds it"
                    raise SourceIssue(clause.at, f"the variable {name} {words}")
            if value < 1 or len(clause.heads) > 1:
                choice = Choice(index, values, number, value)
        literals = tuple(dict.fromkeys(literals))
        is_certain = choice is None and not literals
        known = table.answers.get(answer)
        if known is None or is_certain > known:
            table.answers[answer] = is_certain
            table.has_changed = True
        if not is_certain:
            table.derivations.setdefault(answer, {})[Derivation(literals, choice, clause.at)] = None


def _require_ground(answer: Compound, at: Place) -> Compound:
    if not answer.is_ground:
        name = next(iter_term_variables(answer))
        raise SourceIssue(
            at, f"the answer {abbreviate(answer)} depends on chance and has the variable {name}"
        )
    return answer

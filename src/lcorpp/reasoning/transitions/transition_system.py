"""A program made ready to be walked through: its terms in order, and what deciding each does to the state."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from lcorpp.reasoning.gc_pause import gc_paused
from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Literal as SyntaxLiteral
from lcorpp.reasoning.transitions.elimination_order import order_components
from lcorpp.reasoning.transitions.recursive_components import RecursiveComponent
from lcorpp.reasoning.transitions.transition import Transition
from lcorpp.reasoning.transitions.transition_builder import build_transitions


@dataclass(slots=True, eq=False)
class TransitionSystem:
    """A program made ready.

    ground: its terms, without the clauses; `index` finds one by its text.
    order: the terms that each step decides.
    steps: what deciding them does to the state.
    consistent: False where it is plain that there is no world.
    """

    ground: GroundProgram
    order: Sequence[tuple[int, ...]]
    steps: list[Transition]
    consistent: bool
    index: dict[str, int]


def build_transition_system(
    program: Program,
    do: Mapping[str, str],
    observed: Iterable[SyntaxLiteral] = (),
    wanted: Iterable[str] = (),
    asked: Sequence[SyntaxLiteral] = (),
) -> TransitionSystem:
    """Ground a program and order its terms.

    Args:
        do: interventions beside those in the program, term -> value.
        observed: literals without which there is no world, beside the observations in the program.
        wanted: the terms whose outcomes will be asked for.
        asked: literals for which the term `ASKED` stands.

    Raises:
        ProgramError: arithmetic is undefined.
    """
    with gc_paused():
        return _plan(program, do, observed, wanted, asked)


def _plan(
    program: Program,
    do: Mapping[str, str],
    observed: Iterable[SyntaxLiteral],
    wanted: Iterable[str],
    asked: Sequence[SyntaxLiteral],
) -> TransitionSystem:
    ground = ground_program(program, do, observed, asked)
    clauses, outcomes = simplify(ground)
    order = order_components(clauses, outcomes)
    joined = _joined(ground, clauses, order)
    index = {name: term for term, name in enumerate(ground.names)}
    consistent = not any(c.term < 0 and not c.body for c in clauses)
    needed = {index[name] for name in wanted if name in index}
    steps = build_transitions(ground, clauses, outcomes, joined, needed)
    if len(joined) < len(order) and any(isinstance(step.decision, RecursiveComponent) for step in steps):
        joined = order  # what was joined could not be stratified
        steps = build_transitions(ground, clauses, outcomes, joined, needed)
    ground.clauses = []  # the steps have what they need of them
    return TransitionSystem(ground, joined, steps, consistent, index)


def _joined(
    ground: GroundProgram, clauses: Sequence[Clause], order: Sequence[tuple[int, ...]]
) -> Sequence[tuple[int, ...]]:
    """The components, where circles without chance are made one with their neighbours without chance.

    Such a circle is worked out for all states at once, so that what leads to it had better be, too.
    """
    if all(len(terms) == 1 for terms in order):
        return order
    chance = {clause.term for clause in clauses if clause.kind is ClauseKind.SELECT} | ground.do.keys()
    joined: list[tuple[int, ...]] = []
    run: list[tuple[int, ...]] = []

    def end() -> None:
        if any(len(terms) > 1 for terms in run):
            joined.append(tuple([term for terms in run for term in terms]))
        else:
            joined.extend(run)
        run.clear()

    for terms in order:
        if chance.isdisjoint(terms):
            run.append(terms)
        else:
            end()
            joined.append(terms)
    end()
    return joined

"""A program made ready to be walked through: its terms in order, and what deciding each does to the state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from lcorpp.reasoning.gc_pause import gc_paused
from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
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


def build_transition_system(ground: GroundProgram, wanted: Iterable[str] = ()) -> TransitionSystem:
    """Order the terms of a ground program and build the transition of each; drops the ground clauses.

    Args:
        wanted: the terms whose outcomes are queried.
    """
    with gc_paused():
        clauses, outcomes = simplify(ground)
        order = order_components(clauses, outcomes)
        joined = _joined(ground, clauses, order)
        index = {name: term for term, name in enumerate(ground.names)}
        consistent = not any(c.term < 0 and not c.body for c in clauses)
        needed = {index[name] for name in wanted if name in index}
        steps = build_transitions(ground, clauses, outcomes, joined, needed)
        if len(joined) < len(order) and any(isinstance(step.decision, RecursiveComponent) for step in steps):
            joined = order  # the joined component cannot be stratified
            steps = build_transitions(ground, clauses, outcomes, joined, needed)
        ground.clauses = []  # the transitions contain what they need of the clauses
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

"""Compilation, step 2: a program as a transition system whose steps decide one component each.

ground program -> simplification -> variable order -> transitions
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, groupby

from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.transitions.recursive_components import RecursiveComponent
from lcorpp.reasoning.transitions.transition import Transition
from lcorpp.reasoning.transitions.transition_builder import TransitionBuilder
from lcorpp.reasoning.transitions.variable_order import order_components


@dataclass(slots=True, eq=False)
class TransitionSystem:
    """A program as a sequence of steps over a state of bits; the initial state is 0.

    program: the ground program, without its clauses.
    order: step -> the terms that it decides.
    transitions: step -> the outcomes of its terms and their effect on the state.
    consistent: False if a constraint without body shows that there is no world.
    term_numbers: term as text -> its number in `program`.
    """

    program: GroundProgram
    order: Sequence[tuple[int, ...]]
    transitions: list[Transition]
    consistent: bool
    term_numbers: dict[str, int]

    def __repr__(self) -> str:
        return (
            f"TransitionSystem({self.program.source.file}: {len(self.program.names)} terms,"
            f" {len(self.order)} steps)"
        )


def build_transition_system(program: GroundProgram, queried: Iterable[str] = ()) -> TransitionSystem:
    """Simplify a ground program, order its components and build the transitions.

    Args:
        queried: the terms whose outcomes queries read.
    """
    with pause_gc():
        clauses, outcomes = simplify(program)
        program = replace(program, clauses=[])  # the transitions contain what they need of the clauses
        components = order_components(clauses, outcomes)
        order = _merge_deterministic_neighbours(program, clauses, components)
        term_numbers = {name: term for term, name in enumerate(program.names)}
        consistent = not any(c.term < 0 and not c.body for c in clauses)
        needed = {term_numbers[name] for name in queried if name in term_numbers}
        transitions = TransitionBuilder(program, clauses, outcomes, order, needed).build()
        if len(order) < len(components) and any(
            isinstance(transition.distribution, RecursiveComponent) for transition in transitions
        ):
            order = components  # a merged component is not stratified
            transitions = TransitionBuilder(program, clauses, outcomes, order, needed).build()
        return TransitionSystem(program, order, transitions, consistent, term_numbers)


def _merge_deterministic_neighbours(
    program: GroundProgram, clauses: Sequence[Clause], order: Sequence[tuple[int, ...]]
) -> Sequence[tuple[int, ...]]:
    """Merge each deterministic component of several terms with its deterministic neighbours in the order.

    `Stratified` evaluates such a component for all states at once, so its deterministic inputs should be part
    of it.
    """
    if all(len(terms) == 1 for terms in order):
        return order
    random = {clause.term for clause in clauses if clause.kind is ClauseKind.SELECT} | program.do.keys()
    merged: list[tuple[int, ...]] = []
    for is_deterministic, neighbours in groupby(order, random.isdisjoint):
        run = list(neighbours)
        if is_deterministic and any(len(terms) > 1 for terms in run):
            run = [tuple(chain.from_iterable(run))]
        merged.extend(run)
    return merged

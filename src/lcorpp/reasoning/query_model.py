"""A program grounded for a query: its worlds, or samples of them if they are too many."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

from lcorpp.errors import ProgramError, check_type
from lcorpp.reasoning.circuit.choice import choose_engine
from lcorpp.reasoning.diagram.decision_diagram import DecisionDiagram, build_decision_diagram
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.questions import get_interventions, is_joint, list_questions, list_values
from lcorpp.reasoning.transitions.transition_system import TransitionSystem, build_transition_system

if TYPE_CHECKING:
    from lcorpp.reasoning.grounding.ground_program import GroundProgram
    from lcorpp.reasoning.inference import Worlds


class QueryModel:
    """The worlds of a program that satisfy the conditions of a query.

    Args:
        program: a program without cr-rules.
        query: a query resolved by `resolve_query`.
        facts: terms that evidence will name.

    progress: called while a large decision diagram is expanded, with a share and a text.

    Raises:
        ProgramError: arithmetic is undefined.
        TooLargeError: the joint of the subjects has too many values.
    """

    def __init__(self, program: Program, query: Query, facts: tuple[str, ...] = ()) -> None:
        check_type(query, Query, "query", ProgramError)
        self.query = query
        observed = [observation.formula for observation in query.observations]
        terms = (*list_questions(query), *facts)
        self.program, self._observed, self._terms = program, observed, terms
        self._questions, self._facts = list_questions(query), facts
        self.progress: Callable[[float, str], None] | None = None
        for question in filter(is_joint, terms):
            list_values(program, question)  # raises an error if they are too many

    @cached_property
    def ground(self) -> GroundProgram:
        """The ground program."""
        do = get_interventions(self.query)
        return ground_program(self.program, do, self._observed, self.query.formula, self._terms)

    @cached_property
    def system(self) -> TransitionSystem:
        """The program as a transition system."""
        return build_transition_system(self.ground, self._terms)

    @cached_property
    def worlds(self) -> Worlds:
        """The worlds.

        Raises:
            TooLargeError: the program is too large to be compiled.
            ProgramError: a world violates a condition of the language.
        """
        from lcorpp.reasoning.diagram.world_queries import WorldQueries  # a decision needs no worlds

        engine = choose_engine(
            self.program,
            get_interventions(self.query),
            self._questions,
            self._facts,
            self,
            observed=self._observed,
            asked=self.query.formula,
            progress=self.progress,
        )
        if isinstance(engine, DecisionDiagram):
            return WorldQueries(engine)
        from lcorpp.reasoning.circuit.table_worlds import TableWorlds  # imports numpy

        return TableWorlds(
            engine, lambda: WorldQueries(build_decision_diagram(self.system, progress=self.progress))
        )

"""A program grounded for a query: its worlds, or samples of them if they are too many."""

from __future__ import annotations

from functools import cached_property

from lcorpp.errors import ProgramError, check_type
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Query
from lcorpp.reasoning.questions import get_interventions, list_questions
from lcorpp.reasoning.transitions.transition_system import build_transition_system


class QueryModel:
    """The worlds of a program that satisfy the conditions of a query.

    Args:
        program: a program without cr-rules.
        query: a query resolved by `resolve_query`.
        facts: terms that evidence will name.

    Raises:
        ProgramError: arithmetic is undefined.
        TooLargeError: the joint of the subjects has too many values.
    """

    def __init__(self, program: Program, query: Query, facts: tuple[str, ...] = ()) -> None:
        check_type(query, Query, "query", ProgramError)
        self.query = query
        observed = [observation.formula for observation in query.observations]
        terms = (*list_questions(query), *facts)
        self.ground = ground_program(program, get_interventions(query), observed, query.formula, terms)
        self.system = build_transition_system(self.ground, terms)

    @cached_property
    def worlds(self) -> WorldQueries:
        """The worlds.

        Raises:
            TooLargeError: the program is too large to be compiled.
            ProgramError: a world violates a condition of the language.
        """
        return WorldQueries(build_decision_diagram(self.system))

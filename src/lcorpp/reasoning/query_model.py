"""A program grounded for some questions: its worlds, or samples of them if they are too many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.world_queries import WorldQueries
from lcorpp.reasoning.grounding.grounder import ground_program
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Formula
from lcorpp.reasoning.transitions.transition_system import build_transition_system


class QueryModel:
    """The worlds of a program, without cr-rules, that satisfy observations.

    Args:
        do: interventions, term -> value.
        questions: see `questions`; the names of other terms may be among them, such as those of evidence.
        observed, asked: as in `ground_program`.

    Raises:
        ProgramError: arithmetic is undefined.
        TooLargeError: the joint of terms has too many values.
    """

    def __init__(
        self,
        program: Program,
        do: Mapping[str, str],
        questions: Sequence[str],
        observed: Sequence[Formula] = (),
        asked: Formula = (),
    ) -> None:
        self.ground = ground_program(program, do, observed, asked, questions)
        self.system = build_transition_system(self.ground, questions)

    @cached_property
    def worlds(self) -> WorldQueries:
        """The worlds.

        Raises:
            TooLargeError: the program is too large to be compiled.
            ProgramError: a world violates a condition of the language.
        """
        return WorldQueries(build_decision_diagram(self.system))

"""The table of a block: its measure for each combination of outcomes of its boundary, by a decision diagram.

The terms of the boundary that the block does not define are its inputs. In the program of the block each of
them is selected at random, so that all combinations are among its worlds; the probabilities of these
selections are divided out. An input that may have no value is selected if a coin shows heads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.diagram.decision_diagram import DecisionDiagram, build_decision_diagram
from lcorpp.reasoning.diagram.layers import build_layers, weigh
from lcorpp.reasoning.diagram.world_queries import WorldQueries
from lcorpp.reasoning.evidence import EncodedEvidence
from lcorpp.reasoning.grounding.ground_program import (
    DERIVE,
    FORBID,
    SELECT,
    Clause,
    GroundProgram,
    make_full_mask,
)
from lcorpp.reasoning.questions import QUERY_TERM
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array

MAX_BYTES = 2**26
"""Maximum memory of the arcs of the decision diagram of a block."""

MAX_WORK = 2_000_000_000
"""Maximum product of the arcs of a block and the entries of its table, about ten seconds."""

MAX_VISITED_ARCS = 20_000_000
"""Maximum number of arcs that are visited for the fractions of a table, about ten seconds."""

MIN_LOG = -600.0
"""A table whose entries differ by more, as logarithms, is left to the decision diagram."""


@dataclass(eq=False)
class BlockTable:
    """The measures of a block.

    program: its clauses, with those of the inputs.
    terms: the boundary. outcomes: the possible outcomes of each of these terms.
    scales: for each of these terms what the measure of each outcome is multiplied by; 1 for terms that the
        block defines.
    """

    program: GroundProgram
    terms: Sequence[int]
    outcomes: Sequence[Sequence[int]]
    scales: Sequence[Sequence[int]]

    @classmethod
    def from_clauses(
        cls,
        program: GroundProgram,
        clauses: list[Clause],
        outcomes: Mapping[int, Sequence[int]],
        inputs: Mapping[int, Sequence[int]],
    ) -> BlockTable:
        """Make the table of some clauses of a program.

        Args:
            outcomes: term of the boundary -> its possible outcomes.
            inputs: the same of those terms that the clauses do not define.
        """
        own, number_of, scales = _add_inputs(program, clauses, inputs)
        every = [scales.get(term, [1] * len(possible)) for term, possible in outcomes.items()]
        return cls(own, [number_of[term] for term in outcomes], list(outcomes.values()), every)

    def __repr__(self) -> str:
        return f"BlockTable({self.program!r}, {len(self.terms)} terms)"

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name not in ("diagram", "fractions")}

    @cached_property
    def diagram(self) -> DecisionDiagram:
        """The decision diagram.

        Raises:
            TooLargeError: it takes more memory than `MAX_BYTES`.
            ProgramError: a world of the block breaks a condition of the language.
        """
        return build_decision_diagram(build_transition_system(self.program, self._names), MAX_BYTES)

    @property
    def _names(self) -> list[str]:
        return [self.program.names[term] for term in self.terms]

    def compute(self) -> Array | None:
        """Compute the entries, the last term fastest, up to a common factor.

        Returns:
            None if floating point does not represent them, or they take more work than `MAX_WORK`.

        Raises:
            TooLargeError, ProgramError: as `diagram`.
        """
        diagram = self.diagram
        n_rows = prod([len(own) for own in self.outcomes])
        if not diagram.has_worlds:
            return np.zeros(n_rows)
        if diagram.graph.n_arcs * n_rows > MAX_WORK:
            return None
        grid = np.meshgrid(*[np.array(own, dtype=np.intp) for own in self.outcomes], indexing="ij")
        codes: npt.NDArray[np.intp] = np.zeros((n_rows, len(grid)), dtype=np.intp)
        for i, column in enumerate(grid):
            codes[:, i] = column.ravel()
        layers = build_layers(diagram, self._names)
        _, logarithms = weigh(layers, EncodedEvidence(codes), ())
        finite = logarithms[np.isfinite(logarithms)]
        if len(finite) and finite.max() - finite.min() > -MIN_LOG:
            return None
        is_extreme = len(finite) and (finite.min() < MIN_LOG or finite.max() > -MIN_LOG)
        shift = finite.max() if is_extreme else 0.0
        table: Array = np.exp(logarithms - shift)
        for own in self._list_scales():
            table *= own
        return table

    def _list_scales(self) -> list[Array]:
        """List for each term by what each entry is multiplied."""
        sizes = [len(own) for own in self.scales]
        return [
            np.tile(np.repeat(np.array(own, dtype=np.float64), prod(sizes[i + 1 :])), prod(sizes[:i]))
            for i, own in enumerate(self.scales)
            if set(own) != {1}
        ]

    @cached_property
    def fractions(self) -> list[Fraction]:
        """The entries as fractions.

        Raises:
            TooLargeError: the sums visit more than `MAX_VISITED_ARCS`.
        """
        n_arcs = self.diagram.graph.n_arcs * prod([len(own) for own in self.outcomes])
        if n_arcs > MAX_VISITED_ARCS:
            raise TooLargeError(
                f"{self.program.source.file}: fractions visit {n_arcs} arcs of a decision diagram, expected"
                f" at most {MAX_VISITED_ARCS}"
            )
        worlds, entries = WorldQueries(self.diagram), list[Fraction]()
        for codes, scales in zip(product(*self.outcomes), product(*self.scales), strict=True):
            measure = worlds.compute_measure(dict(zip(self.terms, codes, strict=True)))
            entries.append(measure * prod(scales))
        return entries


def _add_inputs(
    program: GroundProgram, clauses: list[Clause], inputs: Mapping[int, Sequence[int]]
) -> tuple[GroundProgram, dict[int, int], dict[int, list[int]]]:
    """Make a program of clauses in which inputs are random.

    Returns:
        The program, the number of each term in it, and input -> by what the measures of its outcomes are
        multiplied.
    """
    terms = sorted({*inputs, *[t for c in clauses for t in (c.term, *[x[0] for x in c.body])]} - {-1})
    number_of = {term: number for number, term in enumerate(terms)}
    names, values = [program.names[term] for term in terms], [program.values[term] for term in terms]
    number_of[-1] = -1
    own = []
    for c in clauses:
        body = tuple([(number_of[t], mask, negated) for t, mask, negated in c.body])
        own.append(
            Clause(c.kind, number_of[c.term], c.value, body, c.statement, c.label, c.instance, c.number)
        )
    scales: dict[int, list[int]] = {}
    for term, outcomes in inputs.items():
        number, n_values = number_of[term], len(program.values[term])
        chosen = [outcome for outcome in outcomes if outcome < n_values]
        if len(outcomes) == 1:
            scales[term] = [1]
            own += [Clause(DERIVE, number, value, ()) for value in chosen]
            continue
        scales[term] = [n_values] * len(chosen)
        body = ()
        if len(chosen) < len(outcomes):  # none of the values, too
            coin = len(names)
            names.append(f"{QUERY_TERM} {program.names[term]} has a value")
            values.append(("true", "false"))
            own.append(Clause(SELECT, coin, 0, ()))
            body = ((coin, 0b001, False),)
            scales[term] = [*[2 * scale for scale in scales[term]], 2]
        own.append(Clause(SELECT, number, 0, body))
        if len(chosen) < n_values:
            allowed = sum([1 << outcome for outcome in outcomes])
            own.append(Clause(FORBID, -1, 0, ((number, make_full_mask(n_values) & ~allowed, False),)))
    do = {number_of[t]: value for t, value in program.do.items() if t in number_of and t not in inputs}
    return replace(program, names=names, values=values, clauses=own, do=do), number_of, scales

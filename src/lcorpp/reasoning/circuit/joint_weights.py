"""The joint weights of outcomes of several terms, for all combinations at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcorpp.reasoning.circuit.compiler import build_layers
from lcorpp.reasoning.circuit.decision_diagram import build_decision_diagram
from lcorpp.reasoning.circuit.evidence import Codes
from lcorpp.reasoning.circuit.passes import evaluate
from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.transitions.transition_system import build_transition_system
from lcorpp.values import Array


class JointWeights:
    """The joint weights of outcomes of some terms of a ground program.

    Args:
        ground: the program.
        names: the terms.
    """

    def __init__(self, ground: GroundProgram, names: Sequence[str]) -> None:
        columns = dict.fromkeys(names)
        self._layers = build_layers(
            build_decision_diagram(build_transition_system(ground, columns)), list(columns)
        )
        self._columns = {name: i for i, name in enumerate(columns)}

    def compute(self, *parts: tuple[Sequence[str], Codes]) -> Array:
        """(n1, n2, ...) Compute the weight of each combination of a row of each part.

        Args:
            parts: terms, and their outcomes (n, terms) in n rows; all other terms are free.
        """
        shape = tuple(len(rows) for _, rows in parts)
        codes = np.full((*shape, len(self._columns)), -1, dtype=np.intp)
        agree = np.ones(shape, dtype=bool)  # a term may occur in several parts
        for axis, (terms, rows) in enumerate(parts):
            for term, outcomes in zip(terms, rows.T, strict=True):
                wanted = outcomes.reshape([-1 if i == axis else 1 for i in range(len(shape))])
                own = codes[..., self._columns[term]]
                agree &= (own < 0) | (own == wanted)
                own[...] = wanted
        weights = evaluate(self._layers, codes.reshape(-1, len(self._columns)))
        return weights.reshape(shape) * agree

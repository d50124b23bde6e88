"""The worlds of a program of tables: sums by tables, single worlds by the decision diagram."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.answers import PossibleWorld, Value
from lcorpp.reasoning.diagram.world_queries import WorldQueries
from lcorpp.reasoning.evidence import EncodedEvidence
from lcorpp.reasoning.factors.exact import sum_exactly
from lcorpp.reasoning.factors.network import TableNetwork
from lcorpp.reasoning.questions import is_joint, list_question_terms

if TYPE_CHECKING:
    from numpy.random import Generator


class TableWorlds:
    """The worlds that satisfy the conditions of a query, see `Worlds`.

    Args:
        network: the tables, with the conditions.
        make_queries: expands the decision diagram, which finds, samples and counts worlds.
    """

    def __init__(self, network: TableNetwork, make_queries: Callable[[], WorldQueries]) -> None:
        self._network, self._make_queries = network, make_queries

    def __repr__(self) -> str:
        return f"TableWorlds({self._network.graph!r})"

    @cached_property
    def _queries(self) -> WorldQueries:
        return self._make_queries()

    def compute_float_weights(self, question: str, facts: Mapping[str, str]) -> dict[Value, float]:
        """Sum the measures of the worlds by the value of a question; only the ratios matter."""
        graph = self._network.graph
        codes = [graph.program.values[graph.terms[graph.variable_of[t]]].index(v) for t, v in facts.items()]
        evidence = EncodedEvidence(np.array([codes], dtype=np.intp).reshape(1, -1))
        terms = list_question_terms(question)
        weights = self._network.weigh(terms, list(facts), evidence)[0]
        return self._name_values(question, weights)

    def compute_exact_weights(self, question: str, facts: Mapping[str, str]) -> dict[Value, Fraction]:
        """Sum as `compute_float_weights` in fractions, with the measures of the worlds.

        The decision diagram of the whole program does it if the fractions of a block take too much work.
        """
        terms = list_question_terms(question)
        try:
            return self._name_values(question, sum_exactly(self._network, terms, facts))
        except TooLargeError:
            if not self._network.graph.has_blocks:
                raise
        return self._queries.compute_exact_weights(question, facts)

    def _name_values(self, question: str, weights: npt.NDArray[Any]) -> dict[Value, Any]:
        """Map the positive weights of outcomes to values; "" is for no value."""
        graph, terms = self._network.graph, list_question_terms(question)
        values = [graph.program.values[graph.terms[graph.variable_of[term]]] for term in terms]
        named: dict[Value, Any] = {}
        for index in np.argwhere(weights != 0).tolist():
            has_all = all(i < len(own) for i, own in zip(index, values, strict=True))
            found = tuple([own[i] for i, own in zip(index, values, strict=True)]) if has_all else ()
            key: Value = (found if is_joint(question) else found[0]) if found else ""
            weight = weights[tuple(index)]
            named[key] = named.get(key, 0) + (float(weight) if weights.dtype == np.float64 else weight)
        return named

    def most_probable(self, facts: Mapping[str, str], count: int) -> tuple[PossibleWorld, ...]:
        """Find the most probable worlds."""
        return self._queries.most_probable(facts, count)

    def sample(self, count: int, rng: Generator, facts: Mapping[str, str]) -> list[dict[str, str]] | None:
        """Draw worlds."""
        return self._queries.sample(count, rng, facts)

    def count(self) -> int:
        """Count the worlds."""
        return self._queries.count()

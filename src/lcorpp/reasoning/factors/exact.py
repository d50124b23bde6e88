"""Exact sums of products of tables: the plan of `network`, with integers of any size.

The entries of each table are integers over a common denominator, so that sums and products need no fractions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import lcm, prod
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.factors.network import TableNetwork

MAX_COST = 2e8
"""Maximum number of multiplications of integers, about a minute."""

_Table = tuple[tuple[int, ...], npt.NDArray[Any]]
"""The variables of a table of integers, and the table."""


def sum_exactly(network: TableNetwork, terms: Sequence[str], facts: Mapping[str, str]) -> npt.NDArray[Any]:
    """(outcomes of each term) Sum the measures of the worlds with some facts by the outcomes of terms.

    Args:
        terms: queried terms of the graph.
        facts: term -> value.

    Raises:
        TooLargeError: the sums take more work than `MAX_COST`.
    """
    graph = network.graph
    values = graph.program.values
    variables = [graph.variable_of[term] for term in terms]
    result = np.zeros([len(values[graph.terms[v]]) + 1 for v in variables], dtype=object)
    if not graph.has_worlds:
        return result
    observed: dict[int, int] = {}
    for term, value in facts.items():
        v = graph.variable_of[term]
        outcome = values[graph.terms[v]].index(value)
        if outcome not in graph.outcomes[v]:
            return result
        observed[v] = graph.outcomes[v].index(outcome)
    kept = [v for v in variables if v not in observed and len(graph.outcomes[v]) > 1]
    plan = network.find_plan([v for v in variables if v not in observed], sorted(observed), ())
    if plan.cost > MAX_COST:
        raise TooLargeError(
            f"{graph.program.source.file}: an exact answer takes {plan.cost:.2g} multiplications of integers,"
            f" expected at most {MAX_COST:.2g}"
        )
    needed = set(plan.tables)
    tables: list[_Table] = []
    unit = Fraction(1)
    for i, factor in enumerate(graph.factors):
        if i not in needed:
            continue
        numbers = factor.list_fractions()
        common = lcm(*[number.denominator for number in numbers])
        unit /= common
        integers = np.array(
            [number.numerator * (common // number.denominator) for number in numbers], dtype=object
        )
        varying = [v for v in factor.scope if len(graph.outcomes[v]) > 1]  # numpy has at most 64 axes
        sizes = [len(graph.outcomes[v]) for v in varying]
        chosen = tuple([observed.get(v, slice(None)) for v in varying])
        left = tuple([v for v in varying if v not in observed])
        tables.append((left, np.array(integers.reshape(sizes)[chosen], dtype=object)))
    for v in [v for v in plan.order if len(graph.outcomes[v]) > 1]:
        own = [table for table in tables if v in table[0]]
        tables = [table for table in tables if v not in table[0]]
        scope = tuple(dict.fromkeys([u for variables_, _ in own for u in variables_ if u != v]))
        tables.append((scope, np.asarray(_multiply(own, (*scope, v)).sum(axis=-1), dtype=object)))
    total = _multiply(tables, tuple(kept)) * unit
    index = [
        [graph.outcomes[v][observed[v]]] if v in observed else list(graph.outcomes[v]) for v in variables
    ]
    result[np.ix_(*index)] = np.reshape(total, [len(own) for own in index])
    return result


def _multiply(tables: Sequence[_Table], scope: tuple[int, ...]) -> npt.NDArray[Any]:
    """Multiply tables, with an axis for each variable of a scope, which has all of theirs."""
    product: Any = 1
    for variables, table in tables:
        order = [variables.index(v) for v in scope if v in variables]
        shape = [table.shape[variables.index(v)] if v in variables else 1 for v in scope]
        product = product * table.transpose(order).reshape(shape)
    return np.asarray(product, dtype=object) if scope else np.asarray(prod([product]), dtype=object)

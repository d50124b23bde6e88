"""An upper bound of the probability of the evidence in a world, for rejection sampling.

In a world, each observed term has its value with a probability that depends on the terms which its clauses
name: a row of its conditional probability table. The bound is the maximum of the product of these
probabilities over all outcomes of those terms, found by bucket elimination. If the joint table of a bucket is
too large, the bucket is divided, and the maxima are multiplied, which can only enlarge the bound.

Source: Dechter and Rish, "Mini-buckets: a general scheme for bounded inference", JACM 50, 2003.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import product
from math import inf, log, prod
from typing import NamedTuple

import numpy as np

from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.transitions.local_distribution import enumerate_outcomes
from lcorpp.values import Array

MAX_ROWS = 1000
"""The maximal size of a table."""


class _Table(NamedTuple):
    """A function of the outcomes of terms.

    terms: sorted. logs: logarithms of probabilities, with an axis for each term.
    """

    terms: tuple[int, ...]
    logs: Array


def bound_evidence(
    ground: GroundProgram, possible: Mapping[int, int], step_of: Mapping[int, int]
) -> tuple[dict[int, float], float]:
    """Bound the probability that terms have some of their outcomes.

    Args:
        possible: observed term -> the mask of its outcomes.
        step_of: term -> the step that decides it; later ones are eliminated first.

    Returns:
        (the logarithm of a bound for each term, the logarithm of a bound for all).
    """
    clauses, masks = simplify(ground)
    clauses_of: dict[int, list[Clause]] = {term: [] for term in possible}
    tests: dict[int, set[int]] = {}  # parent -> the masks in literals about it
    for clause in clauses:
        if clause.term in possible:
            clauses_of[clause.term].append(clause)
            for parent, allowed, _ in clause.body:
                tests.setdefault(parent, set()).add(allowed)
    domains: dict[int, list[int]] = {}
    for parent, literals in tests.items():
        mask = masks[parent] & possible.get(parent, -1)
        outcomes = [1 << i for i in range(len(ground.values[parent]) + 1) if mask >> i & 1]
        # of outcomes that satisfy the same literals one suffices
        domains[parent] = list({tuple([bool(m & o) for m in literals]): o for o in outcomes}.values())
        if not outcomes:  # it is observed to have a value that it has in no world
            return {}, -inf
    tables = {
        term: _make_table(ground, term, own, domains, possible[term]) for term, own in clauses_of.items()
    }
    bounds = {term: float(table.logs.max(initial=-inf)) for term, table in tables.items()}
    rest = list(tables.values())
    for parent in sorted(domains, key=lambda term: step_of.get(term, -1), reverse=True):
        rest = _eliminate(rest, parent)
    return bounds, sum([table.logs.item() for table in rest])


def compute_log(probability: Fraction) -> float:
    """Compute the logarithm of a probability, which may be too small for a float."""
    return log(probability.numerator) - log(probability.denominator) if probability else -inf


def _make_table(
    ground: GroundProgram,
    term: int,
    clauses: Sequence[Clause],
    domains: Mapping[int, list[int]],
    possible: int,
) -> _Table:
    """Compute the probability of the possible outcomes of a term given each combination of its parents.

    It is 0 where a condition of the language is broken, as no world is accepted there, and 1 for all
    combinations if they are too many, or if the term depends on itself.
    """
    parents = tuple(sorted({parent for clause in clauses for parent, _, _ in clause.body}))
    varying = [parent for parent in parents if len(domains[parent]) > 1]
    shape = [len(domains[parent]) for parent in varying]
    if term in parents or prod(shape) > MAX_ROWS:
        return _Table((), np.zeros(()))
    logs = []
    for row in product(*[domains[parent] for parent in parents]):
        outcome_of = dict(zip(parents, row, strict=True))
        true = [c for c in clauses if all(outcome_of[parent] & allowed for parent, allowed, _ in c.body)]
        column = enumerate_outcomes(ground, term, true, {})
        is_broken = any(violation for _, _, violation in column)
        share = sum([p for value, p, _ in column if possible >> value & 1], Fraction(0))
        logs.append(-inf if is_broken else compute_log(share))
    return _Table(tuple(varying), np.array(logs).reshape(shape))


def _eliminate(tables: Sequence[_Table], term: int) -> list[_Table]:
    """Replace the tables about a term by their sum, maximized over its outcomes; by several if too large."""
    rest, parts = [], list[_Table]()
    for table in tables:
        if term not in table.terms:
            rest.append(table)
            continue
        if parts:
            terms = tuple(sorted({*parts[-1].terms, *table.terms}))
            here, there = (part.logs.reshape(_align(part, terms)) for part in (parts[-1], table))
            if prod(np.broadcast_shapes(here.shape, there.shape)) <= MAX_ROWS:
                parts[-1] = _Table(terms, here + there)
                continue
        parts.append(table)
    for terms, logs in parts:
        at = terms.index(term)
        rest.append(_Table(terms[:at] + terms[at + 1 :], logs.max(axis=at, initial=-inf)))
    return rest


def _align(table: _Table, terms: Sequence[int]) -> list[int]:
    """The shape of a table with an axis of length 1 for each other term."""
    length = dict(zip(table.terms, table.logs.shape, strict=True))
    return [length.get(term, 1) for term in terms]

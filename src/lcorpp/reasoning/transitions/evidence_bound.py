"""An upper bound of the probability of the evidence in a world, for rejection sampling.

In a world, each observed term has its value with a probability that depends on the terms which its clauses
name: a row of its conditional probability table. The bound is the maximum of the product of these
probabilities over all outcomes of those terms, found by bucket elimination. If the joint table of a bucket is
too large, the bucket is divided, and the maxima are multiplied, which can only enlarge the bound.

Source: Dechter and Rish, "Mini-buckets: a general scheme for bounded inference", JACM 50, 2003.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from math import inf, log, prod
from typing import NamedTuple

from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.transitions.local_distribution import enumerate_outcomes

MAX_ROWS = 1000
"""The maximal size of a table."""


class _Table(NamedTuple):
    """A function of the outcomes of terms.

    terms: in the order of the keys of `rows`.
    rows: outcomes, each as a mask -> logarithm of a probability.
    """

    terms: tuple[int, ...]
    rows: Mapping[tuple[int, ...], float]


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
    tables = {
        term: _make_table(ground, term, own, domains, possible[term]) for term, own in clauses_of.items()
    }
    bounds = {term: max(table.rows.values(), default=-inf) for term, table in tables.items()}
    parents = sorted(domains, key=lambda term: step_of.get(term, -1), reverse=True)
    total = _maximize(list(tables.values()), parents, domains)
    return bounds, total


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
    if term in parents or prod(len(domains[parent]) for parent in parents) > MAX_ROWS:
        return _Table((), {(): 0.0})
    rows = {}
    for row in product(*[domains[parent] for parent in parents]):
        outcome_of = dict(zip(parents, row, strict=True))
        true = [c for c in clauses if all(outcome_of[parent] & allowed for parent, allowed, _ in c.body)]
        column = enumerate_outcomes(ground, term, true, {})
        is_broken = any(violation for _, _, violation in column)
        share = sum(p for value, p, _ in column if possible >> value & 1)
        rows[row] = log(share) if share and not is_broken else -inf
    return _Table(parents, rows)


def _maximize(tables: Sequence[_Table], order: Sequence[int], domains: Mapping[int, list[int]]) -> float:
    """Bound the maximum of a sum of tables, eliminating terms in the given order."""
    rank = {term: i for i, term in enumerate(order)}
    buckets: dict[int, list[_Table]] = {term: [] for term in order}
    total = 0.0

    def place(table: _Table) -> float:
        if not table.terms:
            return table.rows.get((), -inf)
        buckets[min(table.terms, key=rank.__getitem__)].append(table)
        return 0.0

    for table in tables:
        total += place(table)
    for term in order:
        parts: list[_Table] = []
        for table in buckets.pop(term):
            if parts and _count_rows({*parts[-1].terms, *table.terms}, domains) <= MAX_ROWS:
                parts[-1] = _add(parts[-1], table, domains)
            else:
                parts.append(table)
        for part in parts:
            total += place(_eliminate(part, term))
    return total


def _count_rows(terms: set[int], domains: Mapping[int, list[int]]) -> int:
    return prod(len(domains[term]) for term in terms)


def _add(first: _Table, second: _Table, domains: Mapping[int, list[int]]) -> _Table:
    terms = tuple(sorted({*first.terms, *second.terms}))
    here, there = ([terms.index(term) for term in table.terms] for table in (first, second))
    rows = {
        row: first.rows[tuple([row[i] for i in here])] + second.rows[tuple([row[i] for i in there])]
        for row in product(*[domains[term] for term in terms])
    }
    return _Table(terms, rows)


def _eliminate(table: _Table, term: int) -> _Table:
    """Maximize a table over the outcomes of a term."""
    at = table.terms.index(term)
    rows: dict[tuple[int, ...], float] = {}
    for row, value in table.rows.items():
        rest = row[:at] + row[at + 1 :]
        rows[rest] = max(rows.get(rest, -inf), value)
    return _Table(table.terms[:at] + table.terms[at + 1 :], rows)

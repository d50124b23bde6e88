"""Programs as tables: a ground program whose terms each depend on few others is a product of factors.

A term that does not depend on itself has a distribution for each combination of outcomes of the terms in the
bodies of its clauses: a factor. A constraint is a factor of zeros and ones. The measure of a world is the
product of all factors at its outcomes. Example:

    random(a). random(b). pr(b | a) = 3/4. pr(b | -a) = 1/4. :- a, -b.

    scope (a,)     [1/2, 1/2]
    scope (a, b)   [[3/4, 1/4], [1/4, 3/4]]
    scope (a, b)   [[1, 0], [1, 1]]          the constraint
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from itertools import product
from math import prod

import numpy as np

from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.grounding.simplification import simplify
from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork, ProbabilityTable
from lcorpp.reasoning.transitions.local_distribution import ProbabilityCache, enumerate_outcomes
from lcorpp.reasoning.transitions.relevance import separate_irrelevant_rules
from lcorpp.values import Array

MAX_ENTRIES = 2**16
"""A table that is computed from clauses has at most this many entries; larger ones are better expanded."""

MAX_TERMS = 20_000
"""Programs with more terms are expanded: an elimination order takes time and memory for pairs of terms."""


@dataclass(frozen=True, eq=False)
class Factor:
    """A function of the outcomes of some terms.

    scope: the terms; an entry for each combination of their outcomes, the last term fastest.
    table: flat; source: the same numbers, in fractions or as a table.
    child: the term whose distribution it is, so that each row sums to 1; -1 for others.
    """

    scope: tuple[int, ...]
    table: Array
    source: ProbabilityTable | Sequence[Fraction]
    child: int

    def list_fractions(self) -> list[Fraction]:
        """List the entries as fractions."""
        if isinstance(self.source, ProbabilityTable):
            return [number for row in self.source.list_fractions() for number in row]
        return list(self.source)


@dataclass(frozen=True, eq=False)
class FactorGraph:
    """A program as a product of factors.

    terms: the number of each variable in the ground program; variables are numbered from 0.
    outcomes: the possible outcomes of each variable; its values in tables are indexes into them.
    factors: over variables.
    variable_of: queried term as text -> variable.
    has_worlds: False if a term has no possible outcome.
    """

    program: GroundProgram
    terms: Sequence[int]
    outcomes: Sequence[Sequence[int]]
    factors: Sequence[Factor]
    variable_of: Mapping[str, int]
    has_worlds: bool = True

    def __repr__(self) -> str:
        file, n = self.program.source.file, len(self.terms)
        return f"FactorGraph({file}: {n} variables, {len(self.factors)} factors)"


def make_network_graph(network: BayesianNetwork, do: Mapping[str, str]) -> FactorGraph:
    """Make the factors of a Bayesian network with interventions, term -> value.

    It equals that of `build_factor_graph`, without the grounding that takes most of the time of small ones.
    """
    names = list(network.tables)
    values = [network.attributes[name].values for name in names]
    variable_of = {name: i for i, name in enumerate(names)}
    factors = []
    for i, (name, table) in enumerate(network.tables.items()):
        if name in do:
            chosen = [Fraction(value == do[name]) for value in values[i]]
            factors.append(Factor((i,), np.array(chosen, dtype=np.float64), chosen, i))
        else:
            scope = (*[variable_of[parent] for parent in table.parents], i)
            factors.append(Factor(scope, table.probabilities.ravel(), table, i))
    program = GroundProgram(network, names, list(values))
    return FactorGraph(program, range(len(names)), [range(len(own)) for own in values], factors, variable_of)


def build_factor_graph(
    program: GroundProgram,
    queried: Iterable[str],
    tables: Mapping[str, ProbabilityTable] | None = None,
) -> FactorGraph | None:
    """Build the factors of a ground program.

    Args:
        queried: terms that questions and evidence will name.
        tables: term -> its distribution, for terms whose selections have no other pr-atoms.

    Returns:
        None if terms depend on each other in a cycle, a table would be too large, or a condition of the
        language may be broken; the decision diagram then is the way.
    """
    program, numbers = program.number_terms(set(queried))
    clauses, masks = simplify(program)
    needed = set(numbers.values())
    table_of = (
        {term: tables[name] for term, name in enumerate(program.names) if name in tables} if tables else {}
    )
    table_of = {term: table for term, table in table_of.items() if term not in program.do}
    number_of = {name: term for term, name in enumerate(program.names)} if table_of else {}
    for table in table_of.values():
        needed.update([number_of[parent] for parent in table.parents])
    clauses, _, _ = separate_irrelevant_rules(program, clauses, needed)
    builder = _Builder(program, clauses, masks)
    terms = sorted({c.term for c in clauses if c.term >= 0} | program.do.keys() | needed | builder.bodies)
    if len(terms) > MAX_TERMS:
        return None
    for term in terms:
        if term in table_of:
            parents = tuple([number_of[parent] for parent in table_of[term].parents])
            builder.add_table(term, parents, table_of[term])
        elif not builder.add_term(term):
            return None
    if not (builder.is_acyclic() and builder.add_constraints()):
        return None
    variable_of = {term: i for i, term in enumerate(terms)}
    factors = [
        Factor(tuple([variable_of[t] for t in f.scope]), f.table, f.source, variable_of.get(f.child, -1))
        for f in builder.factors
    ]
    queried_variables = {name: variable_of[term] for name, term in numbers.items()}
    outcomes = [builder.outcomes_of[term] for term in terms]
    has_worlds = all(outcomes) and all(clause.body for clause in clauses if clause.term < 0)
    return FactorGraph(program, terms, outcomes, factors, queried_variables, has_worlds)


class _Builder:
    """Builds factors over the terms of the ground program."""

    def __init__(self, program: GroundProgram, clauses: Sequence[Clause], masks: Sequence[int]) -> None:
        self._program = program
        self._clauses_of: defaultdict[int, list[Clause]] = defaultdict(list)
        for clause in clauses:
            self._clauses_of[clause.term].append(clause)
        self.bodies = {literal[0] for clause in clauses for literal in clause.body}
        decoded: dict[int, list[int]] = {}
        self.outcomes_of = [
            decoded.get(mask)
            or decoded.setdefault(mask, [i for i in range(mask.bit_length()) if mask >> i & 1])
            for mask in masks
        ]
        self.observed: set[int] = set()  # terms of which constraints exclude outcomes
        for clause in self._clauses_of.get(-1, ()):
            if len(clause.body) == 1:
                ((term, mask, _),) = clause.body
                self.outcomes_of[term] = [i for i in self.outcomes_of[term] if not mask >> i & 1]
                self.observed.add(term)
        self.factors: list[Factor] = []
        self._needs: dict[int, tuple[int, ...]] = {}
        self._probabilities: ProbabilityCache = {}

    def is_acyclic(self) -> bool:
        """Whether no term depends on itself."""
        try:
            TopologicalSorter(self._needs).prepare()
        except CycleError:
            return False
        return True

    def add_table(self, term: int, parents: tuple[int, ...], table: ProbabilityTable) -> None:
        """Add a distribution that is given."""
        self._needs[term] = parents
        scope = (*parents, term)
        sizes = [len(self.outcomes_of[t]) for t in scope]
        if sizes == list(table.numbers.shape):
            self.factors.append(Factor(scope, table.probabilities.ravel(), table, term))
            return
        # only some of the values are possible, by interventions or observations
        chosen = np.ix_(*[self.outcomes_of[t] for t in scope])
        array = table.probabilities[chosen]
        indexes = np.arange(table.numbers.size).reshape(table.numbers.shape)[chosen].ravel()
        fractions = [number for row in table.list_fractions() for number in row]
        child = -1 if term in self.observed else term
        self.factors.append(Factor(scope, array.ravel(), [fractions[i] for i in indexes], child))

    def add_term(self, term: int) -> bool:
        """Add the distribution of a term given its clauses; return False if it is no table."""
        clauses = self._clauses_of.get(term, [])
        parents = tuple(dict.fromkeys([literal[0] for clause in clauses for literal in clause.body]))
        if term in parents:
            return False
        self._needs[term] = parents
        own = self.outcomes_of[term]
        sizes = [len(self.outcomes_of[t]) for t in parents]
        if not own or not all(sizes):  # there is no world
            return True
        if prod(sizes) * len(own) > MAX_ENTRIES:
            return False
        found = self._compute_table(term, clauses, parents, sizes, own)
        if found is None:
            return False
        array, fractions, is_distribution = found
        self.factors.append(Factor((*parents, term), array, fractions, term if is_distribution else -1))
        return True

    def _compute_table(
        self,
        term: int,
        clauses: Sequence[Clause],
        parents: Sequence[int],
        sizes: Sequence[int],
        own: Sequence[int],
    ) -> tuple[Array, list[Fraction], bool] | None:
        """Compute a table, and whether each row is a distribution.

        Rows do not sum to 1 where outcomes are excluded, or two rules derive different values. None if a
        condition of the language may be broken.
        """
        true_at = self._list_true(clauses, parents, sizes)
        index_of = {outcome: i for i, outcome in enumerate(own)}
        rows: dict[tuple[int, ...], list[Fraction]] = {}
        fractions: list[Fraction] = []
        zero = Fraction(0)
        for true in true_at:
            key = tuple(true)
            if key not in rows:
                row = [zero] * len(own)
                for value, weight, violation in enumerate_outcomes(
                    self._program, term, [clauses[i] for i in key], self._probabilities
                ):
                    if violation:
                        return None
                    if value in index_of:
                        row[index_of[value]] = weight
                    elif weight and term not in self.observed:
                        return None
                rows[key] = row
            fractions += rows[key]
        is_distribution = all(sum(row) == 1 for row in rows.values())
        return np.array(fractions, dtype=np.float64), fractions, is_distribution

    def _list_true(
        self, clauses: Sequence[Clause], parents: Sequence[int], sizes: Sequence[int]
    ) -> list[list[int]]:
        """List the indexes of the clauses that are true for each combination of outcomes of the parents."""
        strides = [prod(sizes[i + 1 :]) for i in range(len(sizes))]
        place = {parent: i for i, parent in enumerate(parents)}
        true_at: list[list[int]] = [[] for _ in range(prod(sizes))]
        for number, clause in enumerate(clauses):
            chosen: list[Sequence[int]] = [range(size) for size in sizes]
            masks: dict[int, int] = {}
            for term, mask, _ in clause.body:
                masks[term] = masks.get(term, -1) & mask
            for term, mask in masks.items():
                chosen[place[term]] = [i for i, o in enumerate(self.outcomes_of[term]) if mask >> o & 1]
            for combination in product(*chosen):
                true_at[sum([i * stride for i, stride in zip(combination, strides, strict=True)])].append(
                    number
                )
        return true_at

    def add_constraints(self) -> bool:
        """Add a factor for each set of terms that constraints are about; return False if one is too large."""
        by_scope: defaultdict[tuple[int, ...], list[Clause]] = defaultdict(list)
        for clause in self._clauses_of.get(-1, ()):
            if len(clause.body) == 1:  # among the outcomes already
                continue
            by_scope[tuple(sorted({literal[0] for literal in clause.body}))].append(clause)
        for scope, clauses in by_scope.items():
            sizes = [len(self.outcomes_of[term]) for term in scope]
            if prod(sizes) > MAX_ENTRIES:
                return False
            true_at = self._list_true(clauses, scope, sizes)
            fractions = [Fraction(not true) for true in true_at]
            self.factors.append(Factor(scope, np.array(fractions, dtype=np.float64), fractions, -1))
        return True

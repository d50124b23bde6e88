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

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import prod

import numpy as np

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning.factors.block_table import BlockTable
from lcorpp.reasoning.factors.blocks import Block, Part
from lcorpp.reasoning.factors.division import Division
from lcorpp.reasoning.grounding.ground_program import Clause, GroundLiteral, GroundProgram
from lcorpp.reasoning.language.networks.bayesian_network import BayesianNetwork, ProbabilityTable
from lcorpp.reasoning.transitions.local_distribution import ProbabilityCache, enumerate_outcomes
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Factor:
    """A function of the outcomes of some terms.

    scope: the terms; an entry for each combination of their outcomes, the last term fastest.
    table: flat; source: the same numbers, in fractions or as a table.
    child: the term whose distribution it is, so that each row sums to 1; -1 for others.
    """

    scope: tuple[int, ...]
    table: Array
    source: ProbabilityTable | BlockTable | Sequence[Fraction]
    child: int

    def list_fractions(self) -> list[Fraction]:
        """List the entries as fractions."""
        if isinstance(self.source, ProbabilityTable):
            return [number for row in self.source.list_fractions() for number in row]
        if isinstance(self.source, BlockTable):
            return self.source.fractions
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

    @property
    def has_blocks(self) -> bool:
        """Whether a decision diagram computed some of the factors."""
        return any(isinstance(factor.source, BlockTable) for factor in self.factors)

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


def build_factor_graph(division: Division, tables: Mapping[str, ProbabilityTable]) -> FactorGraph | None:
    """Compute the factors of a program that is divided.

    Args:
        tables: term -> its distribution, for terms whose selections have no other pr-atoms.

    Returns:
        None if a block is too large, or a condition of the language may be broken; the decision diagram then
        is the way.
    """
    builder = _Builder(division, tables)
    if not all(builder.add_table(part) for part in division.tables):
        return None
    if not all(builder.add_block(block) for block in division.blocks):
        return None
    inner = {term for block in division.blocks for term in block.inner}
    builder.add_constants([term for term in division.terms if term not in inner])
    variable_of = {term: i for i, term in enumerate([term for term in division.terms if term not in inner])}
    factors = [
        Factor(tuple([variable_of[t] for t in f.scope]), f.table, f.source, variable_of.get(f.child, -1))
        for f in builder.factors
    ]
    queried = {name: variable_of[term] for name, term in division.numbers.items()}
    outcomes = [division.outcomes_of[term] for term in variable_of]
    return FactorGraph(division.program, list(variable_of), outcomes, factors, queried, division.has_worlds)


class _Builder:
    """Builds factors over the terms of the ground program."""

    def __init__(self, division: Division, tables: Mapping[str, ProbabilityTable]) -> None:
        self._program, self._division, self._tables = division.program, division, tables
        self.factors: list[Factor] = []
        self._probabilities: ProbabilityCache = {}

    def add_table(self, part: Part) -> bool:
        """Add the factor of a part; return False if a condition of the language may be broken."""
        if not part.terms:
            self._add_constraints(tuple(sorted(part.scope)), self._division.constraints[part.scope])
            return True
        (term,) = part.terms
        name = self._program.names[term]
        if name in self._tables and term not in self._program.do:
            self._add_given(term, self._tables[name])
            return True
        return self._add_term(term)

    def add_constants(self, terms: Iterable[int]) -> None:
        """Add a factor for each term with one outcome that is in none, so that its marginal is known."""
        seen = {term for factor in self.factors for term in factor.scope}
        for term in terms:
            if term not in seen and len(self._division.outcomes_of[term]) == 1:
                self.factors.append(Factor((term,), np.ones(1), [Fraction(1)], -1))

    def add_block(self, block: Block) -> bool:
        """Add the factor of a block; return False if it is too large, or a condition may be broken."""
        division = self._division
        defined = [term for part in block.parts for term in part.terms]
        keys = [part.scope for part in block.parts if not part.terms]
        keys += [frozenset([term]) for term in defined if term in division.observed]
        clauses = [clause for term in defined for clause in division.clauses_of.get(term, ())]
        clauses += [clause for key in keys for clause in division.constraints[key]]
        # terms with one outcome are constants of the block
        outcomes = {term: division.outcomes_of[term] for term in block.boundary}
        inputs = {term: own for term, own in outcomes.items() if term not in defined}
        outcomes = {term: own for term, own in outcomes.items() if len(own) > 1}
        table = BlockTable.from_clauses(self._program, clauses, outcomes, inputs)
        try:
            array = table.compute()
        except (ProgramError, TooLargeError):  # the whole program has fewer worlds, maybe without the reason
            return False
        if array is not None:
            self.factors.append(Factor(tuple(outcomes), array, table, -1))
        return array is not None

    def _add_given(self, term: int, table: ProbabilityTable) -> None:
        """Add a distribution that is given."""
        division = self._division
        scope = (*division.parents_of[term], term)
        sizes = [len(division.outcomes_of[t]) for t in scope]
        if sizes == list(table.numbers.shape):
            self.factors.append(Factor(scope, table.probabilities.ravel(), table, term))
            return
        # only some of the values are possible, by interventions or observations
        chosen = np.ix_(*[division.outcomes_of[t] for t in scope])
        array = table.probabilities[chosen]
        indexes = np.arange(table.numbers.size).reshape(table.numbers.shape)[chosen].ravel()
        fractions = [number for row in table.list_fractions() for number in row]
        child = -1 if term in division.observed else term
        self.factors.append(Factor(scope, array.ravel(), [fractions[i] for i in indexes], child))

    def _add_term(self, term: int) -> bool:
        """Add the distribution of a term given its clauses; return False if it is no table."""
        division = self._division
        parents = tuple([parent for parent in division.parents_of[term] if parent != term])
        sizes = [len(division.outcomes_of[t]) for t in parents]
        found = self._compute_table(term, parents, sizes)
        if found is None:
            return False
        array, fractions, is_distribution = found
        self.factors.append(Factor((*parents, term), array, fractions, term if is_distribution else -1))
        return True

    def _compute_table(
        self, term: int, parents: Sequence[int], sizes: Sequence[int]
    ) -> tuple[Array, list[Fraction], bool] | None:
        """Compute a table, and whether each row is a distribution.

        Rows do not sum to 1 where outcomes are excluded, or the term has no or several stable models. None if
        a condition of the language may be broken.
        """
        clauses, own = self._division.clauses_of.get(term, ()), self._division.outcomes_of[term]
        bodies = [[literal for literal in clause.body if literal[0] != term] for clause in clauses]
        list_outcomes = self._find_distribution(term, clauses)
        index_of = {outcome: i for i, outcome in enumerate(own)}
        rows: dict[tuple[int, ...], list[Fraction]] = {}
        fractions: list[Fraction] = []
        for true in self._list_true(bodies, parents, sizes):
            key = tuple(true)
            if key not in rows:
                row = [Fraction(0)] * len(own)
                for value, weight, violation in list_outcomes(key):
                    if violation:
                        return None
                    if value in index_of:
                        row[index_of[value]] += weight
                    elif weight and term not in self._division.observed:
                        return None
                rows[key] = row
            fractions += rows[key]
        is_distribution = all(sum(row) == 1 for row in rows.values())
        return np.array(fractions, dtype=np.float64), fractions, is_distribution

    def _find_distribution(
        self, term: int, clauses: Sequence[Clause]
    ) -> Callable[[Sequence[int]], Iterable[tuple[int, Fraction, object]]]:
        """Return the function that lists the outcomes of a term, given the clauses that others make true."""
        own_literals = [[literal for literal in clause.body if literal[0] == term] for clause in clauses]
        if not any(own_literals):
            return lambda key: enumerate_outcomes(
                self._program, term, [clauses[i] for i in key], self._probabilities
            )
        from lcorpp.reasoning.transitions.recursive_components import build_component  # few terms need it

        guarded = [(1 << i, clause, own_literals[i]) for i, clause in enumerate(clauses)]
        component = build_component(self._program, (term,), guarded, self._probabilities, (term,))

        def list_models(key: Sequence[int]) -> Iterable[tuple[int, Fraction, object]]:
            state = sum([1 << i for i in key])
            found = component.list_outcomes([state])[state]
            return [(outcome.values[0], outcome.weight, outcome.violation) for outcome in found]

        return list_models

    def _list_true(
        self, bodies: Sequence[Sequence[GroundLiteral]], parents: Sequence[int], sizes: Sequence[int]
    ) -> list[list[int]]:
        """List the indexes of the bodies that are true for each combination of outcomes of the parents."""
        strides = [prod(sizes[i + 1 :]) for i in range(len(sizes))]
        place = {parent: i for i, parent in enumerate(parents)}
        true_at: list[list[int]] = [[] for _ in range(prod(sizes))]
        for number, body in enumerate(bodies):
            chosen: list[Sequence[int]] = [range(size) for size in sizes]
            masks: dict[int, int] = {}
            for term, mask, _ in body:
                masks[term] = masks.get(term, -1) & mask
            for term, mask in masks.items():
                chosen[place[term]] = [
                    i for i, o in enumerate(self._division.outcomes_of[term]) if mask >> o & 1
                ]
            for combination in product(*chosen):
                true_at[sum([i * stride for i, stride in zip(combination, strides, strict=True)])].append(
                    number
                )
        return true_at

    def _add_constraints(self, scope: tuple[int, ...], clauses: Sequence[Clause]) -> None:
        """Add a factor of zeros and ones for constraints about the same terms."""
        sizes = [len(self._division.outcomes_of[term]) for term in scope]
        true_at = self._list_true([clause.body for clause in clauses], scope, sizes)
        fractions = [Fraction(not true) for true in true_at]
        self.factors.append(Factor(scope, np.array(fractions, dtype=np.float64), fractions, -1))

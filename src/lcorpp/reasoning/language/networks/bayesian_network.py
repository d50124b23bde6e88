"""Bayesian networks as programs: a random selection for each variable, and a table instead of pr-atoms.

A table of a hundred thousand numbers is an array. The program as statements, with a pr-atom for each number,
is made only for what reads statements, such as `program_text`, the enumeration or an explanation.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from itertools import product
from typing import Any

import numpy as np

from lcorpp.errors import ProgramError
from lcorpp.reasoning.language.arithmetic import is_integer
from lcorpp.reasoning.language.issues import Place, ReasoningWarning
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.sorts import SortDefinition, SortSet
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Expression,
    Literal,
    Number,
    Probability,
    Selection,
    Statement,
    Term,
)
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class ProbabilityTable:
    """The distribution of a variable for each combination of values of others.

    parents: the variables on which it depends.
    numbers: (values of each parent..., values) as written; the numbers of a row sum to 1 but for rounding.
    at: the place where it begins.
    fractions: the probabilities of each row, where `numbers` are not exact.
    """

    parents: tuple[str, ...]
    numbers: Array
    at: Place
    fractions: list[list[Fraction]] | None = None

    @cached_property
    def probabilities(self) -> Array:
        """The numbers, with rows that sum to 1."""
        shares: Array = self.numbers / self.numbers.sum(axis=-1, keepdims=True)
        return shares

    def list_fractions(self) -> list[list[Fraction]]:
        """List the probabilities of each row, exact for decimals of up to 15 digits."""
        if self.fractions is not None:
            return self.fractions
        exact: dict[float, Fraction] = {}
        rows = []
        for row in self.numbers.reshape(-1, self.numbers.shape[-1]).tolist():
            own = [exact.get(number) or exact.setdefault(number, Fraction(repr(number))) for number in row]
            total = sum(own)
            rows.append(own if total == 1 else [number / total for number in own])
        return rows


RoundedRow = tuple[Place, str, float]
"""The place of a table, its variable, and the sum of a row that rounding explains."""


def check_acyclic(tables: Mapping[str, ProbabilityTable]) -> None:
    """Raise `ProgramError` if a variable depends on itself."""
    try:
        TopologicalSorter({name: table.parents for name, table in tables.items()}).prepare()
    except CycleError as error:
        cycle = list(reversed(error.args[1]))
        first = tables[cycle[0]].at
        raise ProgramError(
            f"{first}: {cycle[0]} depends on itself: {' -> '.join(cycle[:12])}; expected no cycle"
        ) from None


def warn_of_rounding(rows: Sequence[RoundedRow], stacklevel: int) -> None:
    """Warn of rows that are divided by their sum, naming the first."""
    if rows:
        (at, name, total), *others = rows
        also = f" (and so {len(others)} other rows)" if others else ""
        text = f"the probabilities of {name} sum to {total:.10g}, not 1, and are divided by their sum{also}"
        warnings.warn(f"{at}: {text}", ReasoningWarning, stacklevel=stacklevel)


_LETTERS = re.compile("[A-Za-z0-9_]+")


class BayesianNetwork(Program):
    """A Bayesian network as a program.

    Args:
        file: the file name, for errors.
        values: variable -> its values.
        tables: variable -> its distribution.
        places: variable -> the place of its declaration.

    skeleton: the program without pr-atoms.

    Raises:
        ProgramError: a name cannot be declared.
    """

    tables: Mapping[str, ProbabilityTable]
    skeleton: Program

    def __init__(
        self,
        file: str,
        values: Mapping[str, Sequence[str]],
        tables: Mapping[str, ProbabilityTable],
        places: Mapping[str, Place],
    ) -> None:
        declared = tuple(_declare(values, places))
        skeleton = Program(file, declared)
        own = {"file": file, "semantics": "2009", "names": {}, "signature": skeleton.signature}
        for name, value in {**own, "tables": dict(tables), "skeleton": skeleton}.items():
            object.__setattr__(self, name, value)

    @cached_property
    def statements(self) -> tuple[Statement, ...]:
        """The statements, with a pr-atom for each number."""
        atoms = [atom for name, table in self.tables.items() for atom in self._list_atoms(name, table)]
        return (*self.skeleton.statements, *atoms)

    has_cr_rules = False
    has_tables = True

    def _list_atoms(self, name: str, table: ProbabilityTable) -> list[Statement]:
        attributes, at = self.signature.attributes, table.at
        literals = [
            [
                Literal(Term(parent, at=at), "=", _make_value(value, at), at=at)
                for value in attributes[parent].values
            ]
            for parent in table.parents
        ]
        values = [_make_value(value, at) for value in attributes[name].values]
        term = Term(name, at=at)
        return [
            Probability(term, value, Number(number, at=at), body, at=at)
            for body, row in zip(product(*literals), table.list_fractions(), strict=True)
            for value, number in zip(values, row, strict=True)
        ]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, BayesianNetwork):
            return super().__eq__(other)
        return self.skeleton == other.skeleton and all(
            table.parents == (its := other.tables[name]).parents
            and np.array_equal(table.numbers, its.numbers)
            for name, table in self.tables.items()
        )

    __hash__ = Program.__hash__

    def __reduce__(self) -> tuple[Any, ...]:
        values = {name: attribute.values for name, attribute in self.attributes.items()}
        places = {name: attribute.at for name, attribute in self.attributes.items()}
        return BayesianNetwork, (self.file, values, self.tables, places)


def _declare(values: Mapping[str, Sequence[str]], places: Mapping[str, Place]) -> list[Statement]:
    """Declare the variables, with a sort for each different range."""
    sort_of: dict[tuple[str, ...], str] = {}
    sorts: list[Statement] = []
    attributes: list[Statement] = []
    selections: list[Statement] = []
    for name, own in values.items():
        at, key = places[name], tuple(own)
        if key not in sort_of:
            sort = f"values_of_{name}" if _LETTERS.fullmatch(name) else f"values_{len(sort_of) + 1}"
            while sort in values or sort in sort_of.values():
                sort += "_"
            sort_of[key] = sort
            sorts.append(
                SortDefinition(sort, SortSet(tuple([_make_value(v, at) for v in key]), at=at), at=at)
            )
        attributes.append(AttributeDeclaration(name, (), sort_of[key], at=at))
        selections.append(Selection(Term(name, at=at), at=at))
    return [*sorts, *attributes, *selections]


def _make_value(text: str, at: Place) -> Expression:
    return Number(Fraction(text), at=at) if is_integer(text) else Term(text, at=at)

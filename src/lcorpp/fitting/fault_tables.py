"""Tables of an attribute as faults of a program: a lattice of its conditional distributions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product
from math import comb

import numpy as np

from lcorpp.fitting.pr_atoms import find_number, is_ground, list_pr_atoms
from lcorpp.reasoning import Attribute, Program
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.syntax import Body, Literal, Number, Probability, Term
from lcorpp.values import Array

MAX_TABLES = 64
"""Maximum number of tables of one attribute: an alarm is due after few people, whose data do not distinguish
finer tables."""

Rows = Mapping[Body, Sequence[Fraction]]
"""A table: the probability of each value in each condition; elsewhere all values are equally probable."""


def find_table(program: Program, name: str) -> Rows | None:
    """Return the table that the pr-atoms of an attribute state; {} without pr-atoms.

    Returns:
        None for attributes that are not random, with arguments, with fewer than two values or with a dynamic
        range, and if the conditions of two pr-atoms may hold together, or are not ground.
    """
    attribute, atoms_of = program.attributes[name], dict[Body, list[Probability]]()
    if attribute.arguments or len(attribute.values) < 2:
        return None
    selections = program.signature.selections.get(name, ())
    if not selections or any(selection.range is not None for selection in selections):
        return None
    for atom in list_pr_atoms(program, name):
        if not is_ground(atom) or find_number(atom) is None:
            return None
        atoms_of.setdefault(atom.body, []).append(atom)
    if any(not _are_exclusive(one, other) for one, other in combinations(atoms_of, 2)):
        return None
    return {body: _complete_row(atoms, attribute) for body, atoms in atoms_of.items()}


def is_equal(one: Rows, other: Rows, tolerance: float) -> bool:
    """Whether two tables of an attribute have the same probabilities."""
    return all(
        abs(p - q) <= tolerance
        for body in {**one, **other}
        for p, q in zip(_find_row(one, body, other), _find_row(other, body, one), strict=True)
    )


def list_tables(program: Program, name: str, stated: Rows) -> tuple[Array, list[Program]]:
    """List tables of an attribute.

    As one row of a table applies in each world, probabilities are affine in the table. So they follow from
    those of the program, and of the programs with one row halfway to one value.

    Args:
        stated: the table of the program; its conditions are those of the tables.

    Returns:
        (tables, 1 + mixtures) the weight of each program, and the mixtures.
    """
    values, mixtures = program.attributes[name].values, list[Program]()
    for body, row in stated.items():
        for value in values:
            mixed = [(p + (v == value)) / 2 for v, p in zip(values, row, strict=True)]
            mixtures.append(replace_row(program, name, body, mixed))
    own = np.array([*stated.values()], dtype=np.float64)
    # each row sums to 1, so the differences sum to 0 and the programs' other halves cancel
    differences = [2 * (table - own).ravel() for table in make_lattice(*own.shape)]
    return np.column_stack([np.ones(len(differences)), differences]), mixtures


def make_lattice(n_rows: int, n_values: int) -> Iterator[Array]:
    """Yield tables (n_rows, n_values) whose rows are all points of a lattice, or a random part of them."""
    steps = 1
    while comb(steps + n_values, n_values - 1) ** n_rows <= MAX_TABLES:
        steps += 1
    points = np.array(
        [
            (np.bincount(chosen, minlength=n_values) + 1 / n_values) / (steps + 1)
            for chosen in combinations_with_replacement(range(n_values), steps)
        ]
    )
    if len(points) ** n_rows <= MAX_TABLES:
        for indices in product(range(len(points)), repeat=n_rows):
            yield points[list(indices)]
    else:
        for drawn in np.random.default_rng(0).integers(len(points), size=(MAX_TABLES, n_rows)):
            yield points[drawn]


def replace_row(program: Program, name: str, body: Body, row: Sequence[Fraction]) -> Program:
    """Return the program with a pr-atom for each value in place of the pr-atoms of one condition."""
    own = [atom for atom in list_pr_atoms(program, name) if atom.body == body]
    label, replaced = own[0].label if own else None, {id(atom) for atom in own}
    new = [
        Probability(Term(name), parse_term(value, "<value>"), Number(p), body, label)
        for value, p in zip(program.attributes[name].values, row, strict=True)
    ]
    kept = [statement for statement in program.statements if id(statement) not in replaced]
    return program.with_statements((*kept, *new))


def _find_row(table: Rows, body: Body, other: Rows) -> Sequence[Fraction]:
    """Return the row of a condition in one of two tables."""
    n_values = len(table.get(body, other.get(body, ())))
    return table.get(body, [Fraction(1, n_values)] * n_values)


def _are_exclusive(one: Body, other: Body) -> bool:
    """Whether two conditions exclude each other by a literal of each."""
    return any(
        a.term == b.term
        and a.relation == b.relation == "="
        and ((a.negated != b.negated) if a.value == b.value else not (a.negated or b.negated))
        for a in one
        for b in other
        if isinstance(a, Literal) and isinstance(b, Literal)
    )


def _complete_row(atoms: Sequence[Probability], attribute: Attribute) -> list[Fraction]:
    """Return the probability of each value; what the pr-atoms leave is shared equally."""
    stated = {str(atom.value): find_number(atom) or Fraction(0) for atom in atoms}
    rest = (1 - sum(stated.values(), Fraction(0))) / max(len(attribute.values) - len(stated), 1)
    return [stated.get(value, rest) for value in attribute.values]

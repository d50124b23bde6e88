"""Tables of an attribute as faults of a program: a lattice of its conditional distributions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product
from math import comb

import numpy as np

from lcorpp.fitting.pr_atoms import find_number, is_ground, list_pr_atoms
from lcorpp.reasoning import Attribute, Program, Reasoner
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.syntax import Body, Literal, Number, Probability
from lcorpp.values import Array

MAX_TABLES = 256
"""Maximum number of tables of one attribute."""


def list_tables(program: Program, name: str, *, first: int) -> tuple[list[dict[int, float]], list[Reasoner]]:
    """List tables of an attribute: P(value | condition) for all conditions of its pr-atoms.

    As one row of a table applies in each world, probabilities are affine in the table. So they follow from
    those of the program, and of the programs with one row half-way to one value.

    Args:
        first: the index of the first of these programs.

    Returns:
        For each table the weight of each program, and the reasoners of the programs.
    """
    bodies = _group_by_condition(program, name)
    if bodies is None:
        return [], []
    attribute = program.attributes[name]
    values, mixtures = attribute.values, list[Reasoner]()
    stated = [_complete_row(atoms, attribute) for atoms in bodies.values()]
    for atoms, row in zip(bodies.values(), stated, strict=True):
        for value in values:
            mixed = [(p + (v == value)) / 2 for v, p in zip(values, row, strict=True)]
            mixtures.append(Reasoner(_replace_row(program, atoms, mixed, attribute)))
    own, tables = np.array(stated, dtype=np.float64), list[dict[int, float]]()
    for table in make_lattice(len(own), len(values)):
        # each row sums to 1, so the differences sum to 0 and the programs' other halves cancel
        differences = 2 * (table - own).ravel()
        tables.append({0: 1.0, **{first + i: float(d) for i, d in enumerate(differences)}})
    return tables, mixtures


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


def _group_by_condition(program: Program, name: str) -> dict[Body, list[Probability]] | None:
    """Return the pr-atoms of each condition; None if there is no table, see `faults.list_faults`."""
    attribute, rows = program.attributes[name], dict[Body, list[Probability]]()
    if attribute.arguments or len(attribute.values) < 2:
        return None
    if any(selection.range is not None for selection in program.signature.selections[name]):
        return None
    for atom in list_pr_atoms(program, name):
        if not is_ground(atom) or find_number(atom) is None:
            return None
        rows.setdefault(atom.body, []).append(atom)
    if any(not _are_exclusive(one, other) for one, other in combinations(rows, 2)):
        return None
    return rows


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


def _replace_row(
    program: Program, atoms: Sequence[Probability], row: Sequence[Fraction], attribute: Attribute
) -> Program:
    """Return the program with a pr-atom for each value in place of the pr-atoms of one condition."""
    first, old = atoms[0], {id(atom) for atom in atoms}
    kept = [s for s in program.statements if id(s) not in old]
    new = [
        replace(first, value=parse_term(value, "<value>"), number=Number(p))
        for value, p in zip(attribute.values, row, strict=True)
    ]
    return replace(program, statements=(*kept, *new))

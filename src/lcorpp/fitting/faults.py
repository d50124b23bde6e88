"""Faults: programs in which the pr-atoms of one attribute are wrong, as alternatives to a program."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import combinations, combinations_with_replacement, product
from math import comb

import numpy as np

from lcorpp.errors import LcorppError
from lcorpp.reasoning import Attribute, Program, Reasoner
from lcorpp.reasoning.language.arithmetic import iter_variables
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.syntax import Body, Expression, Literal, Number, Probability
from lcorpp.values import Array

MAX_TABLES = 256
"""Maximum number of tables of one attribute."""

MAX_EXCHANGES = 30
"""Maximum number of pairs of values of one attribute, or of one condition, that are exchanged."""

TABLE_CHANGE = "other probabilities"
"""What a fault that is a table changes."""


@dataclass(frozen=True, eq=False)
class Faults:
    """F alternatives to a program: wherever evidence has the probability p_b in program b of B, it has the
    probability ``weights @ p`` in the alternatives.

    reasoners: (B,) of the programs; the first is the program itself.
    weights: (F, B). attributes: (F,) the attribute whose pr-atoms are wrong, "" in row 0, the program itself.
    changes: (F,) what is wrong. priors: (F,) prior probabilities: equal for the attributes and the
        program; within an attribute one half each for simple faults and for tables.
    """

    reasoners: Sequence[Reasoner]
    weights: Array
    attributes: Sequence[str]
    changes: Sequence[str]
    priors: Array


def list_faults(program: Program, used: Sequence[str]) -> Faults:
    """List faults of each attribute with pr-atoms.

    Simple faults are: pr-atoms that are missing, so that all values are equally probable; numbers half-way to
    that; numbers p inverted to (1 - p) / (n - 1) for n values; two values exchanged; and two values of a
    condition exchanged. Tables are a lattice of all conditional distributions, for attributes
    without arguments whose pr-atoms have conditions that exclude each other.

    Args:
        used: the attributes that are observed or inferred. Faults that are no valid programs for these are
            left out.
    """
    reasoners, rows = [Reasoner(program)], [{0: 1.0}]
    attributes, changes, priors = [""], [""], [1.0]
    names = dict.fromkeys(s.term.name for s in program.statements if isinstance(s, Probability))
    for name in names:
        simple = [
            (what, r) for what, p in _list_simple(program, name, used) if (r := _check(p, used)) is not None
        ]
        tables, corners = _list_tables(program, name, first=len(reasoners) + len(simple))
        for what, reasoner in simple:
            rows.append({len(reasoners): 1.0})
            reasoners.append(reasoner)
            changes.append(what)
        reasoners += corners
        rows += tables
        changes += [TABLE_CHANGE] * len(tables)
        groups = [group for group in (simple, tables) if group]
        for group in groups:
            attributes += [name] * len(group)
            priors += [1 / (len(groups) * len(group))] * len(group)
    weights = np.zeros((len(rows), len(reasoners)))
    for f, row in enumerate(rows):
        weights[f, list(row)] = list(row.values())
    return Faults(reasoners, weights, attributes, changes, np.array(priors) / sum(priors))


def _check(program: Program, used: Sequence[str]) -> Reasoner | None:
    """Return the reasoner of a program; None if the program is invalid."""
    reasoner = Reasoner(program)
    try:
        for name in used:
            reasoner.posterior(name, {})
    except LcorppError:
        return None
    return reasoner


def _list_simple(program: Program, name: str, used: Sequence[str]) -> Iterator[tuple[str, Program]]:
    """List the simple faults of an attribute, with what each changes."""
    attribute = program.attributes[name]
    n, atoms = len(attribute.values), _list_atoms(program, name)
    if n > 1:
        yield "equally probable values", _rewrite(program, name, lambda atom: None)
        if any(_find_number(atom) is not None for atom in atoms):
            halfway = partial(_map_number, change=lambda p: (p + Fraction(1, n)) / 2)
            yield "half-way to equally probable values", _rewrite(program, name, halfway)
            inverted = partial(_map_number, change=lambda p: (1 - p) / (n - 1))
            yield "inverted probabilities", _rewrite(program, name, inverted)
    if n > 2 and all(_is_ground(atom) for atom in atoms):
        for pair in _list_pairs(attribute.values):
            yield (
                f"{pair[0]} and {pair[1]} exchanged",
                _rewrite(program, name, partial(_swap_value, pair=pair)),
            )
    for term, values in _list_conditions(program, atoms):
        also = "" if term in used else _name_mirror(program, name, term)
        for pair in _list_pairs(values):
            exchanged = _rewrite(program, name, partial(_swap_condition, term=term, pair=pair))
            yield f"{term}={pair[0]} and {term}={pair[1]} exchanged{also}", exchanged


def _list_tables(program: Program, name: str, *, first: int) -> tuple[list[dict[int, float]], list[Reasoner]]:
    """List tables of an attribute: P(value | condition) for all conditions of its pr-atoms.

    As one row of a table applies in each world, probabilities are affine in the table. So they follow from
    those of the program, and of the programs with one row half-way to one value.

    Args:
        first: the index of the first of these programs.

    Returns:
        For each table the weight of each program, and the reasoners of the programs.
    """
    bodies = _find_rows(program, name)
    if bodies is None:
        return [], []
    attribute = program.attributes[name]
    values, corners = attribute.values, list[Reasoner]()
    stated = [_complete(atoms, attribute) for atoms in bodies.values()]
    for atoms, row in zip(bodies.values(), stated, strict=True):
        for value in values:
            mixed = [(p + (v == value)) / 2 for v, p in zip(values, row, strict=True)]
            corners.append(Reasoner(_replace_row(program, atoms, mixed, attribute)))
    own, tables = np.array(stated, dtype=np.float64), list[dict[int, float]]()
    for table in _make_lattice(len(own), len(values)):
        # each row sums to 1, so the differences sum to 0 and the programs' other halves cancel
        differences = 2 * (table - own).ravel()
        tables.append({0: 1.0, **{first + i: float(d) for i, d in enumerate(differences)}})
    return tables, corners


def _make_lattice(n_rows: int, n_values: int) -> Iterator[Array]:
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


def _find_rows(program: Program, name: str) -> dict[Body, list[Probability]] | None:
    """Return the pr-atoms of each condition; None if there is no table: see `list_faults`."""
    attribute, rows = program.attributes[name], dict[Body, list[Probability]]()
    if attribute.arguments or len(attribute.values) < 2:
        return None
    if any(selection.range is not None for selection in program.signature.selections[name]):
        return None
    for atom in _list_atoms(program, name):
        if not _is_ground(atom) or _find_number(atom) is None:
            return None
        rows.setdefault(atom.body, []).append(atom)
    if any(not _exclude(one, other) for one, other in combinations(rows, 2)):
        return None
    return rows


def _exclude(one: Body, other: Body) -> bool:
    """Whether two conditions exclude each other by a literal of each."""
    return any(
        a.term == b.term
        and a.relation == b.relation == "="
        and ((a.negated != b.negated) if a.value == b.value else not (a.negated or b.negated))
        for a in one
        for b in other
        if isinstance(a, Literal) and isinstance(b, Literal)
    )


def _complete(atoms: Sequence[Probability], attribute: Attribute) -> list[Fraction]:
    """Return the probability of each value; what the pr-atoms leave is shared equally."""
    stated = {str(atom.value): _find_number(atom) or Fraction(0) for atom in atoms}
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


def _list_atoms(program: Program, name: str) -> list[Probability]:
    return [s for s in program.statements if isinstance(s, Probability) and s.term.name == name]


def _rewrite(program: Program, name: str, change: Callable[[Probability], Probability | None]) -> Program:
    """Return the program with the pr-atoms of an attribute changed, or removed for None."""
    statements = [
        change(s) if isinstance(s, Probability) and s.term.name == name else s for s in program.statements
    ]
    return replace(program, statements=tuple(s for s in statements if s is not None))


def _find_number(atom: Probability) -> Fraction | None:
    return atom.number.value if isinstance(atom.number, Number) else None


def _map_number(atom: Probability, change: Callable[[Fraction], Fraction]) -> Probability:
    number = _find_number(atom)
    return atom if number is None else replace(atom, number=Number(change(number)))


def _is_ground(atom: Probability) -> bool:
    expressions: list[Expression] = [atom.term, atom.value]
    for literal in atom.body:
        expressions += (
            [literal.term, literal.value] if isinstance(literal, Literal) else [literal.left, literal.right]
        )
    return not any(True for expression in expressions for _ in iter_variables(expression))


def _list_pairs(values: Iterable[str]) -> list[tuple[str, str]]:
    return list(combinations(values, 2))[:MAX_EXCHANGES]


def _list_conditions(program: Program, atoms: Sequence[Probability]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """List the terms in the conditions of pr-atoms that have constant values there, with all values."""
    terms = {
        str(literal.term): program.attributes[literal.term.name].values
        for atom in atoms
        for literal in atom.body
        if isinstance(literal, Literal) and literal.relation == "=" and not literal.negated
        if literal.term.name in program.attributes
        if str(literal.value) in program.attributes[literal.term.name].values
    }
    yield from terms.items()


def _name_mirror(program: Program, name: str, term: str) -> str:
    """Return where else the values of a hidden term may be exchanged: nobody can tell the two apart."""
    atoms = [s for s in program.statements if isinstance(s, Probability) and s.term.name != name]
    others = dict.fromkeys(
        atom.term.name
        for atom in atoms
        if str(atom.term) == term or any(isinstance(x, Literal) and str(x.term) == term for x in atom.body)
    )
    return f", or in all of {', '.join(others)} instead" if others else ""


def _swap_value(atom: Probability, pair: tuple[str, str]) -> Probability:
    return replace(atom, value=_swap(atom.value, pair))


def _swap_condition(atom: Probability, term: str, pair: tuple[str, str]) -> Probability:
    body = [
        replace(literal, value=_swap(literal.value, pair))
        if isinstance(literal, Literal) and str(literal.term) == term
        else literal
        for literal in atom.body
    ]
    return replace(atom, body=tuple(body))


def _swap(value: Expression, pair: tuple[str, str]) -> Expression:
    one, other = pair
    swapped = {one: other, other: one}.get(str(value))
    return value if swapped is None else parse_term(swapped, "<value>")

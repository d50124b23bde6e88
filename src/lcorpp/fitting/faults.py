"""Faults: programs in which the pr-atoms of one attribute are wrong, as alternatives to a program."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import combinations

import numpy as np

from lcorpp.errors import LcorppError
from lcorpp.fitting.fault_tables import Rows, find_table, is_equal, list_tables, replace_row
from lcorpp.fitting.pr_atoms import find_number, is_ground, list_pr_atoms, map_pr_atoms
from lcorpp.reasoning import Program, Reasoner
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.syntax import Expression, Literal, Number, Probability
from lcorpp.values import Array

PROGRAM_PRIOR, SIMPLE_PRIOR = 0.05, 0.6
"""Prior probability of the program, and of the simple faults of an attribute that has tables, too."""

CHANGE_TOLERANCE = 1e-3
"""A fault that changes no probability by more is left out."""

MAX_EXCHANGES = 30
"""Maximum number of pairs of values of one attribute, or of one condition, that are exchanged."""

TABLE_CHANGE = "other probabilities"
"""The change of a fault that is a table."""


@dataclass(frozen=True, eq=False)
class Faults:
    """F hypotheses about a program: the program itself, and alternatives with one wrong attribute.

    reasoners: (B,) of programs; the first is the program itself. weights: (F, B): evidence with the
        probabilities p (B,) in these programs has the probabilities ``weights @ p`` under the hypotheses.
    attributes: (F,) the attribute whose pr-atoms are wrong, "" in row 0. changes: (F,) what is wrong.
    priors: (F,) prior probabilities: `PROGRAM_PRIOR`, and equal for the attributes.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import parse_plog
        >>> from lcorpp.fitting import list_faults
        >>> program = parse_plog("toss: {heads, tails}. random(toss). pr(toss = heads) = 9/10.")
        >>> faults = list_faults(program, used=["toss"])
        >>> heads = np.array([reasoner.posterior("toss", {})["heads"] for reasoner in faults.reasoners])
        >>> (faults.weights @ heads)[:4].round(2).tolist()  # P(heads): as stated, uniform, halfway, inverted
        [0.9, 0.5, 0.7, 0.1]
    """

    reasoners: Sequence[Reasoner]
    weights: Array
    attributes: Sequence[str]
    changes: Sequence[str]
    priors: Array


def list_faults(program: Program, used: Sequence[str], may_lack_rules: Sequence[str] = ()) -> Faults:
    """List faults of each attribute with pr-atoms, and of random attributes whose pr-atoms may be missing.

    Simple faults are: pr-atoms that are missing, so that all values are equally probable; numbers halfway to
    that; twice the log-odds between values; numbers p inverted to (1 - p) / (n - 1) for n values; two values
    exchanged; and two values of a condition exchanged. Tables are a lattice of all conditional distributions,
    for attributes without arguments whose pr-atoms have conditions that exclude each other. The tables of an
    attribute without pr-atoms have no conditions, or those of another attribute.

    Args:
        used: the attributes that are observed or inferred. Faults whose programs are invalid for these are
            left out.
        may_lack_rules: attributes that may lack pr-atoms.

    Examples:
        >>> from lcorpp import parse_plog
        >>> from lcorpp.fitting import list_faults
        >>> program = parse_plog("toss: {heads, tails}. random(toss). pr(toss = heads) = 9/10.")
        >>> list_faults(program, used=["toss"]).changes[1:4]
        ['equally probable values', 'halfway to equally probable values', 'inverted probabilities']
    """
    reasoners, rows = [Reasoner(program)], [{0: 1.0}]
    attributes, changes, priors = [""], [""], list[float]()
    with_rules = dict.fromkeys(s.term.name for s in program.statements if isinstance(s, Probability))
    for name in dict.fromkeys([*with_rules, *may_lack_rules]):
        simple = [
            (what, r)
            for what, p in (_list_simple_faults(program, name, used) if name in with_rules else ())
            if (r := build_valid_reasoner(p, used)) is not None
        ]
        groups = [(SIMPLE_PRIOR, [{len(reasoners) + i: 1.0} for i in range(len(simple))])] if simple else []
        changes += [what for what, _ in simple]
        reasoners += [reasoner for _, reasoner in simple]
        tables = [list_tables(program, name, stated) for stated in _list_stated(program, name)]
        if name not in with_rules:  # the conditions of other attributes may depend on this one
            tables = [t for t in tables if build_valid_reasoner(t[1][0], used) is not None]
        for table_weights, mixtures in tables:
            used_by = [0, *range(len(reasoners), len(reasoners) + len(mixtures))]
            group = [dict(zip(used_by, row.tolist(), strict=True)) for row in table_weights]
            groups.append(((1 - SIMPLE_PRIOR) / len(tables), group))
            changes += [TABLE_CHANGE] * len(group)
            reasoners += [Reasoner(mixture) for mixture in mixtures]
        total = sum(prior for prior, _ in groups)
        for prior, group in groups:
            rows += group
            attributes += [name] * len(group)
            priors += [prior / total / len(group)] * len(group)
    weights = np.zeros((len(rows), len(reasoners)))
    for f, row in enumerate(rows):
        weights[f, list(row)] = list(row.values())
    alternatives = np.array(priors) * (1 - PROGRAM_PRIOR) / max(sum(priors), 1)
    return Faults(reasoners, weights, attributes, changes, np.array([1 - alternatives.sum(), *alternatives]))


def build_valid_reasoner(program: Program, used: Sequence[str]) -> Reasoner | None:
    """Return the reasoner of a program; None if the program has no answer about a used attribute."""
    reasoner = Reasoner(program)
    try:
        for name in used:
            reasoner.posterior(name, {})
    except LcorppError:
        return None
    return reasoner


def _list_stated(program: Program, name: str) -> list[Rows]:
    """Return the stated table; several equal ones for an attribute without pr-atoms, by their conditions."""
    stated = find_table(program, name)
    if stated is None:
        return []
    if stated:
        return [stated]
    others = dict.fromkeys(s.term.name for s in program.statements if isinstance(s, Probability))
    found = [tuple(table) for other in others if (table := find_table(program, other))]
    values = program.attributes[name].values
    return [
        dict.fromkeys(bodies, [Fraction(1, len(values))] * len(values))
        for bodies in dict.fromkeys([((),), *found])
    ]


def _list_simple_faults(program: Program, name: str, used: Sequence[str]) -> Iterator[tuple[str, Program]]:
    """List the simple faults of an attribute that change it, with what each changes."""
    stated = find_table(program, name)
    rewritten = [*_list_changes(program, name, used)]
    if stated:
        rewritten.append(("more certain probabilities", _sharpen(program, name, stated)))
    for what, fault in rewritten:
        table = find_table(fault, name)
        if stated is None or table is None or not is_equal(stated, table, CHANGE_TOLERANCE):
            yield what, fault


def _list_changes(program: Program, name: str, used: Sequence[str]) -> Iterator[tuple[str, Program]]:
    """List the simple faults of an attribute that change its pr-atoms one by one."""
    attribute = program.attributes[name]
    n, atoms = len(attribute.values), list_pr_atoms(program, name)
    if n > 1:
        yield "equally probable values", map_pr_atoms(program, name, lambda atom: None)
        if any(find_number(atom) is not None for atom in atoms):
            halfway = partial(_map_number, change=lambda p: (p + Fraction(1, n)) / 2)
            yield "halfway to equally probable values", map_pr_atoms(program, name, halfway)
            inverted = partial(_map_number, change=lambda p: (1 - p) / (n - 1))
            yield "inverted probabilities", map_pr_atoms(program, name, inverted)
    if n > 2 and all(is_ground(atom) for atom in atoms):
        for pair in _list_pairs(attribute.values):
            yield (
                f"{pair[0]} and {pair[1]} exchanged",
                map_pr_atoms(program, name, partial(_swap_value, pair=pair)),
            )
    for term, values in _list_conditions(program, atoms):
        also = "" if term in used else _describe_equivalent(program, name, term)
        for pair in _list_pairs(values):
            exchanged = map_pr_atoms(program, name, partial(_swap_condition, term=term, pair=pair))
            yield f"{term}={pair[0]} and {term}={pair[1]} exchanged{also}", exchanged


def _map_number(atom: Probability, change: Callable[[Fraction], Fraction]) -> Probability:
    number = find_number(atom)
    return atom if number is None else replace(atom, number=Number(change(number)))


def _sharpen(program: Program, name: str, table: Rows) -> Program:
    """Return the program with twice the log-odds between the values of an attribute."""
    for body, row in table.items():
        squares = [p**2 for p in row]
        program = replace_row(program, name, body, [p / sum(squares) for p in squares])
    return program


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


def _describe_equivalent(program: Program, name: str, term: str) -> str:
    """Return where else the values of a hidden term may be exchanged, with the same distribution."""
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

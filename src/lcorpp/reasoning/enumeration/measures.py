"""Compute the measures of possible worlds from answer sets, and check the conditions of P-log.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2: Conditions 1 to 3, the probability of an
atom with and without a pr-atom (equations 3 to 5), the measure of a world (6), unitarity (section 5.1).
Condition 1 of 2018: Balai, Gelfond and Zhang, 2019, section 3.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import NamedTuple

from lcorpp.errors import ProgramError
from lcorpp.reasoning.answers import format_world
from lcorpp.reasoning.language.arithmetic import as_value, canonical_text, compare_values, evaluate_number
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Literal, Probability, Selection
from lcorpp.reasoning.language.traversal import as_selection, list_variables


class SelectionAtom(NamedTuple):
    """A random selection that applies."""

    statement: int
    label: str
    instance: str
    term: str


class AssignmentAtom(NamedTuple):
    """A pr-atom that applies; `instance` are the values of its variables."""

    statement: int
    label: str
    instance: tuple[str, ...]
    term: str
    value: str


RangeAtom = tuple[int, str, str, str]
"""A member of a dynamic range: (statement of the selection, instance, term, value)."""

DerivationAtom = tuple[int, str]
"""A rule with a true body: (statement, term in the head)."""


@dataclass(frozen=True)
class AnswerSet:
    """An answer set of the logical part of a program; statements are indexes, labels their arguments.

    values: term -> value, sorted by term.
    selections: the selections that apply to terms without intervention.
    possible: the members of dynamic ranges.
    assigned: the pr-atoms about selected terms.
    derived: the rules that derive a value of a selected term; semantics of 2018 only.
    """

    values: Mapping[str, str]
    selections: tuple[SelectionAtom, ...]
    possible: frozenset[RangeAtom]
    assigned: tuple[AssignmentAtom, ...]
    derived: tuple[DerivationAtom, ...] = ()


def measure_worlds(
    program: Program, answer_sets: Iterable[AnswerSet]
) -> Iterator[tuple[Mapping[str, str], Fraction]]:
    """Compute the possible worlds of a program with their measures, not normalised.

    Args:
        answer_sets: the answer sets of the program's logical part.

    Raises:
        ProgramError: a world breaks a condition of the language.
    """
    distributions: dict[tuple[object, ...], Mapping[str, Fraction]] = {}
    for answer_set in answer_sets:
        measure = Fraction(1)
        assigned: dict[str, list[AssignmentAtom]] = {}
        for atom in answer_set.assigned:
            assigned.setdefault(atom.term, []).append(atom)
        applied: dict[str, SelectionAtom] = {}
        _check_derived(program, answer_set)
        for selected in answer_set.selections:
            if not _is_first_selection(program, applied, selected, answer_set.values):
                continue
            possible = _list_dynamic_range(program, selected, answer_set)
            atoms = tuple(assigned.get(selected.term, ()))
            key = (selected, possible, atoms)
            if key not in distributions:  # most worlds share the selections of others
                distributions[key] = _compute_distribution(
                    program, selected, possible, atoms, answer_set.values
                )
            measure *= distributions[key][answer_set.values[selected.term]]
        yield MappingProxyType(dict(answer_set.values)), measure


def satisfies(literal: Literal, values: Mapping[str, str]) -> bool:
    """Whether a ground literal is true in a world; if its term has no value, only `not` makes it true."""
    value = values.get(canonical_text(literal.term))
    return literal.negated != (
        value is not None
        and compare_values(as_value(value), literal.relation, as_value(canonical_text(literal.value)))
    )


def _list_dynamic_range(program: Program, selected: SelectionAtom, answer_set: AnswerSet) -> tuple[str, ...]:
    """List the dynamic range of a selection in a world, in the order of the declaration."""
    selection = _get_selection(program, selected)
    values = program.attributes[selection.term.name].values
    if selection.range is None:
        return values
    place = selected.statement, selected.instance, selected.term
    return tuple(value for value in values if (*place, value) in answer_set.possible)


def _is_first_selection(
    program: Program, applied: dict[str, SelectionAtom], selected: SelectionAtom, values: Mapping[str, str]
) -> bool:
    """Whether this is the first selection of its term in the world; a different second one is an error.

    2018: random(label, term, range) is an atom, so rules with the same atom are one selection.
    """
    other = applied.setdefault(selected.term, selected)
    if other is selected:
        return True
    first, second = _get_selection(program, other), _get_selection(program, selected)
    if program.semantics == "2018" and other[1:] == selected[1:]:
        name, other_name = (s.label.name if s.label else "" for s in (first, second))
        if name == other_name and first.range == second.range:
            return False
    after = " with other values of its variables" if first.at == second.at else ""
    raise ProgramError(
        f"{second.at}: Condition 1: {selected.term} is also selected at random by the rule at {first.at}"
        f"{after}, in the world {format_world(values)}"
    )


def _check_derived(program: Program, answer_set: AnswerSet) -> None:
    """Check that no rule derives a value of a term that is selected at random (2018)."""
    for index, term in answer_set.derived:
        at = program.statements[index].at
        selection = next(selected for selected in answer_set.selections if selected.term == term)
        raise ProgramError(
            f"{at}: Condition 1: {term} has a value by this rule and is selected at random by the rule at"
            f" {_get_selection(program, selection).at}, in the world {format_world(answer_set.values)}"
        )


def _get_selection(program: Program, selected: SelectionAtom) -> Selection:
    selection = as_selection(program.statements[selected.statement])
    assert selection is not None
    return selection


def _compute_distribution(
    program: Program,
    selected: SelectionAtom,
    possible: tuple[str, ...],
    atoms: Iterable[AssignmentAtom],
    values: Mapping[str, str],
) -> Mapping[str, Fraction]:
    """Compute the probability of each possible value of one selected term in a world."""
    numbers: dict[str, Fraction] = {}
    atom_of: dict[str, Probability] = {}
    for index, label, instance, term, value in atoms:
        atom = program.statements[index]
        assert isinstance(atom, Probability)
        if not _applies_to(program, atom, label, selected):
            continue
        if value in atom_of:
            raise ProgramError(
                f"{atom.at}: Condition 2: {term}={value} also has a pr-atom at {atom_of[value].at}"
                f"{' with other values of its variables' if atom is atom_of[value] else ''},"
                f" in the world {format_world(values)}"
            )
        if value not in possible:
            raise ProgramError(
                f"{atom.at}: Condition 3: {term}={value} has a pr-atom outside of its dynamic range"
                f" {{{', '.join(possible)}}}, in the world {format_world(values)}"
            )
        atom_of[value], numbers[value] = atom, _evaluate_number(atom, instance, values)
    total = sum(numbers.values(), Fraction(0))
    rest = [value for value in possible if value not in numbers]
    if total > 1 or (total != 1 and not rest):
        first = min((atom.at for atom in atom_of.values()), key=lambda at: (at.line, at.column))
        raise ProgramError(
            f"{first}: not unitary: the probabilities of {selected.term} sum to {total}, not"
            f" {'at most ' if rest else ''}1, in the world {format_world(values)}"
        )
    share = (1 - total) / len(rest) if rest else Fraction(0)
    return {value: numbers.get(value, share) for value in possible}


def _applies_to(program: Program, atom: Probability, label: str, selected: SelectionAtom) -> bool:
    """Whether a pr-atom applies to a selection: it has no label, or the label of the selection."""
    if atom.label is None:
        return True
    selection = _get_selection(program, selected)
    if selection.label is None or selection.label.name != atom.label.name:
        return False
    return not atom.label.arguments or label == selected.label


def _evaluate_number(atom: Probability, instance: tuple[str, ...], values: Mapping[str, str]) -> Fraction:
    try:
        number = evaluate_number(atom.number, dict(zip(list_variables(atom), instance, strict=True)))
    except SourceIssue as issue:
        raise ProgramError(f"{issue}, in the world {format_world(values)}") from None
    if not 0 <= number <= 1:
        raise ProgramError(
            f"{atom.number.at}: the probability {number} is not between 0 and 1,"
            f" in the world {format_world(values)}"
        )
    return number

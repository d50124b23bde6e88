"""From answer sets to possible worlds with measures, under the conditions of the language.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2: Conditions 1 to 3, the probability of an
atom with and without a pr-atom (equations 3 to 5), the measure of a world (6), unitarity (section 5.1).
Condition 1 of 2018: Balai, Gelfond and Zhang, 2019, section 3.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from types import MappingProxyType

from lcorpp.errors import ProgramError
from lcorpp.reasoning.enumeration.answer_set import AnswerSet, Assigned, Selected
from lcorpp.reasoning.language.arithmetic import canonical_text, compare, evaluate_number
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Literal, Probability, Selection
from lcorpp.reasoning.language.traversal import as_selection, list_pr_variables


def measure_worlds(
    program: Program, answer_sets: Iterable[AnswerSet]
) -> Iterator[tuple[Mapping[str, str], Fraction]]:
    """The possible worlds of a program with their measures, not normalised.

    Args:
        answer_sets: those of its logical part.

    Raises:
        ProgramError: a world breaks a condition of the language.
    """
    choices: dict[tuple[object, ...], Mapping[str, Fraction]] = {}
    for answer_set in answer_sets:
        measure = Fraction(1)
        assigned: dict[str, list[Assigned]] = {}
        for atom in answer_set.assigned:
            assigned.setdefault(atom[3], []).append(atom)
        applied: dict[str, Selected] = {}
        _check_derived(program, answer_set)
        for selected in answer_set.selections:
            if not _is_first(program, applied, selected, answer_set.values):
                continue
            term = selected[3]
            possible = _possible(program, selected, answer_set)
            atoms = tuple(assigned.get(term, ()))
            key = (selected, possible, atoms)
            if key not in choices:  # most worlds meet the choices of others
                choices[key] = _choice(program, selected, possible, atoms, answer_set.values)
            measure *= choices[key][answer_set.values[term]]
        yield MappingProxyType(dict(answer_set.values)), measure


def holds(literal: Literal, values: Mapping[str, str]) -> bool:
    """Whether a ground literal is true in a world; a term without value makes only `not` true."""
    value = values.get(canonical_text(literal.term))
    return literal.negated != (
        value is not None and compare(value, literal.relation, canonical_text(literal.value))
    )


def shown(values: Mapping[str, str]) -> str:
    """A world as it stands in a message."""
    return f"{{{', '.join(f'{term}={value}' for term, value in values.items())}}}"


def _possible(program: Program, selected: Selected, answer_set: AnswerSet) -> tuple[str, ...]:
    """The dynamic range of a selection in a world, in the order of the declaration."""
    index, _, instance, term = selected
    selection = _selection(program, selected)
    values = program.attributes[selection.term.name].values
    if selection.range is None:
        return values
    return tuple(value for value in values if (index, instance, term, value) in answer_set.possible)


def _is_first(
    program: Program, applied: dict[str, Selected], selected: Selected, values: Mapping[str, str]
) -> bool:
    """Whether no selection of the term has been met in this world; another one breaks Condition 1.

    2018: random(label, term, range) is an atom, so that rules which give the same one are one selection.
    """
    other = applied.setdefault(selected[3], selected)
    if other is selected:
        return True
    first, second = _selection(program, other), _selection(program, selected)
    if program.semantics == "2018" and other[1:] == selected[1:]:
        name, other_name = (s.label.name if s.label else "" for s in (first, second))
        if name == other_name and first.range == second.range:
            return False
    again = " with other values of its variables" if first.at == second.at else ""
    raise ProgramError(
        f"{second.at}: Condition 1: {selected[3]} is also selected at random by the rule at {first.at}"
        f"{again}, in the world {shown(values)}"
    )


def _check_derived(program: Program, answer_set: AnswerSet) -> None:
    """2018: no rule gives a value to a term that is selected at random."""
    for index, term in answer_set.derived:
        at = program.statements[index].at
        chosen = next(selected for selected in answer_set.selections if selected[3] == term)
        raise ProgramError(
            f"{at}: Condition 1: {term} has a value by this rule and is selected at random by the rule at"
            f" {_selection(program, chosen).at}, in the world {shown(answer_set.values)}"
        )


def _selection(program: Program, selected: Selected) -> Selection:
    selection = as_selection(program.statements[selected[0]])
    assert selection is not None
    return selection


def _choice(
    program: Program,
    selected: Selected,
    possible: tuple[str, ...],
    atoms: Iterable[Assigned],
    values: Mapping[str, str],
) -> Mapping[str, Fraction]:
    """The probability of each possible value of one selected term in a world."""
    numbers: dict[str, Fraction] = {}
    spoken: dict[str, Probability] = {}
    for index, label, instance, term, value in atoms:
        atom = program.statements[index]
        assert isinstance(atom, Probability)
        if not _is_about(program, atom, label, selected):
            continue
        if value in spoken:
            raise ProgramError(
                f"{atom.at}: Condition 2: {term}={value} also has a pr-atom at {spoken[value].at}"
                f"{' with other values of its variables' if atom is spoken[value] else ''},"
                f" in the world {shown(values)}"
            )
        if value not in possible:
            raise ProgramError(
                f"{atom.at}: Condition 3: {term}={value} has a pr-atom outside of its dynamic range"
                f" {{{', '.join(possible)}}}, in the world {shown(values)}"
            )
        spoken[value], numbers[value] = atom, _number(atom, instance, values)
    total = sum(numbers.values(), Fraction(0))
    rest = [value for value in possible if value not in numbers]
    if total > 1 or (total != 1 and not rest):
        first = min((atom.at for atom in spoken.values()), key=lambda at: (at.line, at.column))
        raise ProgramError(
            f"{first}: not unitary: the probabilities of {selected[3]} sum to {total}, not"
            f" {'at most ' if rest else ''}1, in the world {shown(values)}"
        )
    share = (1 - total) / len(rest) if rest else Fraction(0)
    return {value: numbers.get(value, share) for value in possible}


def _is_about(program: Program, atom: Probability, label: str, selected: Selected) -> bool:
    """Whether a pr-atom speaks of this selection: it has no label, or the label of the selection."""
    if atom.label is None:
        return True
    selection = _selection(program, selected)
    if selection.label is None or selection.label.name != atom.label.name:
        return False
    return not atom.label.arguments or label == selected[1]


def _number(atom: Probability, instance: tuple[str, ...], values: Mapping[str, str]) -> Fraction:
    try:
        number = evaluate_number(atom.number, dict(zip(list_pr_variables(atom), instance, strict=True)))
    except SourceIssue as issue:
        raise ProgramError(f"{issue}, in the world {shown(values)}") from None
    if not 0 <= number <= 1:
        raise ProgramError(
            f"{atom.number.at}: the probability {number} is not between 0 and 1, in the world {shown(values)}"
        )
    return number

"""The probabilities of a term that is selected at random, and the conditions of P-log, all checked here.

A pr-atom assigns its number to a value; the values without a pr-atom share the rest evenly. The compiler
(`transitions`) and the enumeration share this module; which clauses are true in a world each finds out in its
own way.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2, equations 3 to 5, Conditions 1 to 3; section
5.1 for unitarity. Condition 1 of 2018: Balai, Gelfond and Zhang, 2019, section 3.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from lcorpp.reasoning.grounding.ground_program import ASSIGN, DERIVE, RANGE, Clause
from lcorpp.reasoning.language.arithmetic import absorb_rounding
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Probability, Selection, Statement

MAX_PLACES = 5
"""Maximum number of statements that a message names beside the first."""


class ConditionViolation(Exception):
    """A world breaks a condition of P-log; who found the world adds it to the message.

    Args:
        statement: the index of the statement that breaks the condition.
        message: with "{term}" for the name of the term, as terms with the same rules share violations.

    term_index: the index of the term in its component.
    """

    def __init__(self, statement: int, message: str) -> None:
        super().__init__(statement, message)
        self.statement, self.message, self.term_index = statement, message, 0

    def format(self, statements: Sequence[Statement], names: Sequence[str]) -> str:
        """Return the message; `names` are the terms of the component."""
        return f"{statements[self.statement].at}: {self.message.replace('{term}', names[self.term_index])}"


def has_dynamic_range(program: Program, statement: int) -> bool:
    """Whether the selection at this index of the program has a dynamic range."""
    selection = program.statements[statement] if statement >= 0 else None
    return isinstance(selection, Selection) and selection.range is not None


def list_dynamic_range(
    program: Program, values: Sequence[str], selections: Sequence[Clause], clauses: Iterable[Clause]
) -> list[int]:
    """List the dynamic range in the order of the declaration; of several selections, the intersection.

    Args:
        values: all values of the term.
        selections: its selections whose bodies are true.
        clauses: all clauses about the term whose bodies are true.
    """
    dynamic = [own for own in selections if has_dynamic_range(program, own.statement)]
    members = {(c.statement, c.instance, c.value) for c in clauses if dynamic and c.kind is RANGE}
    return [
        value
        for value in range(len(values))
        if all((own.statement, own.instance, value) in members for own in dynamic)
    ]


def list_applicable(
    program: Program, selections: Sequence[Clause], clauses: Iterable[Clause]
) -> list[Clause]:
    """List the pr-atoms that apply to the selection of a term, after checking that there is only one.

    Args:
        selections: the selections of the term whose bodies are true, at least one.
        clauses: all clauses about the term whose bodies are true.

    Raises:
        ConditionViolation: Condition 1 is broken.
    """
    atoms = [clause for clause in clauses if clause.kind is ASSIGN]
    derived = any(clause.kind is DERIVE for clause in clauses)
    if not atoms and not derived and len(selections) == 1:
        return []
    first = selections[0]
    here = program.statements[first.statement]
    assert isinstance(here, Selection)
    is_2018 = program.semantics == "2018"
    for other in selections[1:]:
        there = program.statements[other.statement]
        assert isinstance(there, Selection)
        # 2018: random(label, term, range) is an atom, so rules with the same atom are one selection
        is_same = here is there or (is_2018 and _name(here) == _name(there) and here.range == there.range)
        if not is_same or (first.instance, first.label) != (other.instance, other.label):
            after = " with other values of its variables" if here is there else ""
            raise ConditionViolation(
                other.statement,
                f"Condition 1: {{term}} is also selected at random by the rule at {here.at}{after}",
            )
    if is_2018 and derived:
        raise ConditionViolation(
            first.statement, "Condition 1: {term} is selected at random while a rule derives it"
        )
    applicable = []
    for atom in atoms:
        statement = program.statements[atom.statement]
        assert isinstance(statement, Probability)
        label = statement.label
        if not label or (label.name == _name(here) and (not label.arguments or atom.label == first.label)):
            applicable.append(atom)
    return applicable


def _name(selection: Selection) -> str:
    return selection.label.name if selection.label else ""


def compute_probabilities(
    program: Program, values: Sequence[str], possible: Sequence[int], atoms: Sequence[Clause]
) -> list[Fraction]:
    """Compute the probability of each value of the dynamic range of a selection.

    Args:
        values: all values of the term.
        possible: the dynamic range, indexes of values.
        atoms: the pr-atoms that apply to the selection.

    A sum that rounding explains is made 1, with a warning.

    Raises:
        ConditionViolation: Condition 2 or 3 is broken, or the probabilities are not unitary.
    """
    atom_of: dict[int, Clause] = {}
    numbers: dict[int, Fraction] = {}
    for atom in atoms:
        value, number = atom.value, atom.number
        assert number is not None
        if not 0 <= number <= 1:
            raise ConditionViolation(atom.statement, f"the probability {number} is not between 0 and 1")
        if value in atom_of:
            other = atom_of[value].statement
            raise ConditionViolation(
                atom.statement,
                f"Condition 2: {{term}}={values[value]} also has a pr-atom at {program.statements[other].at}"
                f"{' with other values of its variables' if other == atom.statement else ''}",
            )
        if value not in possible:
            members = ", ".join([values[v] for v in possible])
            message = f"{{term}}={values[value]} has a pr-atom outside of its dynamic range {{{members}}}"
            raise ConditionViolation(atom.statement, f"Condition 3: {message}")
        atom_of[value], numbers[value] = atom, number
    total = sum(numbers.values(), Fraction(0))
    n_unassigned = len(possible) - len(numbers)
    if total > 1 or (total != 1 and not n_unassigned):
        first = min([atom.statement for atom in atom_of.values()], default=-1)
        statement = program.statements[first]
        if isinstance(statement, Probability) and absorb_rounding(total, statement.term.name, statement.at):
            return [numbers.get(value, Fraction(0)) / total for value in possible]
        bound = "at most " if n_unassigned else ""
        others = sorted({atom.statement for atom in atom_of.values()} - {first})
        places = ", ".join(str(program.statements[other].at) for other in others[:MAX_PLACES])
        also = f", with the pr-atom{'s' * (len(others) > 1)} at {places}" if others else ""
        raise ConditionViolation(
            first, f"not unitary: the probabilities of {{term}} sum to {total}, not {bound}1{also}"
        )
    share = (1 - total) / n_unassigned if n_unassigned else Fraction(0)
    return [numbers.get(value, share) for value in possible]

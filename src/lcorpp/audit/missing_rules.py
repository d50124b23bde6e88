"""Pr-atoms for attributes without rules, as numbers to audit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from fractions import Fraction

from lcorpp.fitting.faults import build_valid_reasoner
from lcorpp.reasoning import Program
from lcorpp.reasoning.language.parser import parse_term
from lcorpp.reasoning.language.syntax import Literal, Number, Probability, Selection, Statement, Term


def add_missing_rules(program: Program, used: Sequence[str], senses: Collection[str]) -> Program:
    """Add pr-atoms to the used attributes of which only a random selection is stated.

    All values of such an attribute are equally probable, whatever else is true; so are they with the pr-atoms
    that are added, but these have numbers that data can refute. The condition is the term on which most
    pr-atoms depend, such as ``identity``.

    Args:
        used: the attributes that are observed or inferred.
        senses: the attributes of senses, whose pr-atoms are not counted.

    Returns:
        The program with new statements at its end; its probabilities are the same.
    """
    for name in used:
        if _has_no_rules(program, name, senses):
            for condition in _list_conditions(program, senses):
                added = _write_rules(program, name, condition)
                changed = program.with_statements((*program.statements, *added))
                if build_valid_reasoner(changed, used) is not None:
                    program = changed
                    break
    return program


def _has_no_rules(program: Program, name: str, senses: Collection[str]) -> bool:
    """Whether a random selection among all values is the only statement with the attribute."""
    named = list[Statement]()
    for statement in program.statements:
        literals = [*getattr(statement, "body", ()), getattr(statement, "head", None)]
        is_sense = isinstance(statement, Probability) and statement.term.name in senses
        if not is_sense and any(isinstance(x, Literal) and x.term.name == name for x in literals):
            named.append(statement)
    selection = named[0] if len(named) == 1 else None
    if not isinstance(selection, Selection):
        return False
    return not (selection.range or selection.body or selection.term.arguments)


def _list_conditions(program: Program, senses: Collection[str]) -> list[Term]:
    """Return the ground terms without arguments in conditions of pr-atoms, the most frequent first."""
    terms = [
        literal.term
        for s in program.statements
        if isinstance(s, Probability) and s.term.name not in senses
        for literal in s.body
        if isinstance(literal, Literal) and not literal.term.arguments
    ]
    return [term for term, _ in Counter(terms).most_common()]


def _write_rules(program: Program, name: str, condition: Term) -> list[Probability]:
    """Write pr-atoms of equal probabilities, for all values but the last."""
    values = program.attributes[name].values
    number = Number(Fraction(1, len(values)))
    return [
        Probability(Term(name), parse_term(value, "<value>"), number, (Literal(condition, "=", cause),))
        for cause in (parse_term(text, "<value>") for text in program.attributes[condition.name].values)
        for value in values[:-1]
    ]

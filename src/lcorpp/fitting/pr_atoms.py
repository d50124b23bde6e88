"""The pr-atoms of one attribute of a program: listed, read and changed."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from lcorpp.reasoning import Program
from lcorpp.reasoning.language.arithmetic import iter_variables
from lcorpp.reasoning.language.syntax import Expression, Literal, Number, Probability


def list_pr_atoms(program: Program, name: str) -> list[Probability]:
    """List the pr-atoms of an attribute."""
    return [s for s in program.statements if isinstance(s, Probability) and s.term.name == name]


def map_pr_atoms(program: Program, name: str, change: Callable[[Probability], Probability | None]) -> Program:
    """Return the program with the pr-atoms of an attribute changed, or removed for None."""
    statements = [
        change(s) if isinstance(s, Probability) and s.term.name == name else s for s in program.statements
    ]
    return program.with_statements(tuple(s for s in statements if s is not None))


def find_number(atom: Probability) -> Fraction | None:
    """Return the number of a pr-atom; None if it is an expression with variables."""
    return atom.number.value if isinstance(atom.number, Number) else None


def is_ground(atom: Probability) -> bool:
    """Whether a pr-atom has no variables."""
    expressions: list[Expression] = [atom.term, atom.value]
    for literal in atom.body:
        expressions += (
            [literal.term, literal.value] if isinstance(literal, Literal) else [literal.left, literal.right]
        )
    return not any(True for expression in expressions for _ in iter_variables(expression))

"""Records and patterns: matching records with variables against values, and the variables that this binds."""

from __future__ import annotations

from lcorpp.reasoning.language.arithmetic import Value, as_value, canonical_text, find_variables
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Literal, Term, Variable


def split_record(value: str) -> tuple[str, tuple[str, ...]]:
    """Split a record into name and arguments: ``f(1,g(a))`` gives ``("f", ("1", "g(a)"))``."""
    name, bracket, rest = value.partition("(")
    if not bracket:
        return value, ()
    arguments, depth, begin = [], 0, 0
    for end, letter in enumerate(rest):
        if letter == "(":
            depth += 1
        elif letter == ")" and depth:
            depth -= 1
        elif letter in ",)" and not depth:
            arguments.append(rest[begin:end])
            begin = end + 1
    return name, tuple(arguments)


def match(pattern: Expression, value: Value, bindings: dict[str, Value]) -> bool:
    """Match a value with a record that contains variables, and add the variables' values to `bindings`.

    Arithmetic in the pattern matches every value; the caller tests it once its variables are bound.
    """
    if isinstance(pattern, Variable):
        return bindings.setdefault(pattern.name, value) == value
    if isinstance(pattern, Term) and pattern.arguments:
        if isinstance(value, int):
            return False
        name, arguments = split_record(value)
        if name != pattern.name or len(arguments) != len(pattern.arguments):
            return False
        pairs = zip(pattern.arguments, map(as_value, arguments), strict=True)
        return all(match(argument, part, bindings) for argument, part in pairs)
    return isinstance(pattern, Arithmetic) or as_value(canonical_text(pattern)) == value


def find_bare_variables(literal: Literal) -> set[str]:
    """Return the arguments and the value that are plain variables: matching a fact binds them."""
    return {part.name for part in (*literal.term.arguments, literal.value) if isinstance(part, Variable)}


def find_inner_variables(literal: Literal) -> set[str]:
    """Return the variables in arithmetic and records: matching a fact does not bind them."""
    parts = (*literal.term.arguments, literal.value)
    return find_variables(*(part for part in parts if not isinstance(part, Variable)))


def find_record_variables(record: Term, in_arithmetic: bool) -> set[str]:
    """Return the variables in arithmetic in a record, or those outside, which matching the record binds."""
    names: set[str] = set()
    for part in record.arguments:
        if isinstance(part, Term):
            names |= find_record_variables(part, in_arithmetic)
        elif isinstance(part, Arithmetic) == in_arithmetic:
            names |= find_variables(part)
    return names

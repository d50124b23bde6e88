"""Builtin predicates of ProbLog that do not depend on chance: arithmetic, comparisons of terms, types."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.translation.prolog_arithmetic import COMPARISONS, compute, make_number
from lcorpp.reasoning.language.translation.prolog_terms import (
    EMPTY_LIST,
    Compound,
    PrologTerm,
    PrologVariable,
    Real,
    is_ground,
    make_list,
    unify,
)

MAX_RANGE = 100_000
"""`between` enumerates at most this many integers."""

Arguments: TypeAlias = Sequence[PrologTerm]
Solutions: TypeAlias = list[tuple[PrologTerm, PrologTerm]]
"""Pairs of terms; each pair that can be unified is a solution of a goal."""

_YES: Solutions = [(EMPTY_LIST, EMPTY_LIST)]

_NO: Solutions = []


def _test(condition: bool) -> Solutions:
    return _YES if condition else _NO


def _can_unify(left: PrologTerm, right: PrologTerm) -> bool:
    return unify(left, right, {}, quoted=False)


def _compare(relation: Callable[[Any, Any], bool], arguments: Arguments, at: Place) -> Solutions:
    return _test(relation(compute(arguments[0], at), compute(arguments[1], at)))


def _test_type(has_type: Callable[[PrologTerm], bool], arguments: Arguments, at: Place) -> Solutions:
    return _test(has_type(arguments[0]))


def _compute_is(arguments: Arguments, at: Place) -> Solutions:
    return [(arguments[0], make_number(compute(arguments[1], at)))]


def _enumerate_between(arguments: Arguments, at: Place) -> Solutions:
    low, high, value = arguments
    low, high = _require_integer(low, at), _require_integer(high, at)
    if not isinstance(value, PrologVariable):
        return _test(low <= _require_integer(value, at) <= high)
    if high - low >= MAX_RANGE:
        raise SourceIssue(at, f"between/3 over {high - low + 1} integers; expected at most {MAX_RANGE}")
    return [(value, number) for number in range(low, high + 1)]


def _compute_successor(arguments: Arguments, at: Place) -> Solutions:
    before, after = arguments
    if isinstance(before, PrologVariable):
        number = _require_integer(after, at)
        if number <= 0:
            raise SourceIssue(at, f"succ/2 expects a positive integer, not {number}")
        return [(before, number - 1)]
    number = _require_integer(before, at)
    if number < 0:
        raise SourceIssue(at, f"succ/2 expects an integer of at least 0, not {number}")
    return [(after, number + 1)]


def _compute_plus(arguments: Arguments, at: Place) -> Solutions:
    left, right, total = arguments
    if isinstance(left, PrologVariable):
        return [(left, _require_integer(total, at) - _require_integer(right, at))]
    if isinstance(right, PrologVariable):
        return [(right, _require_integer(total, at) - _require_integer(left, at))]
    return [(total, _require_integer(left, at) + _require_integer(right, at))]


def _require_integer(term: PrologTerm, at: Place) -> int:
    if not isinstance(term, int):
        raise SourceIssue(at, f"expected an integer, not {term}")
    return term


def _measure_length(arguments: Arguments, at: Place) -> Solutions:
    items = _list_items(arguments[0])
    if items is None:
        raise SourceIssue(
            at, f"length/2 of {arguments[0]}, which is not a list of known length, is not translated"
        )
    return [(arguments[1], len(items))]


def _list_items(term: PrologTerm) -> list[PrologTerm] | None:
    """List the elements of a list; None if the term is not a list."""
    items = []
    while isinstance(term, Compound) and term.key == (".", 2):
        items.append(term.arguments[0])
        term = term.arguments[1]
    return items if term == EMPTY_LIST else None


def _split(arguments: Arguments, at: Place) -> Solutions:
    """Solve `term =.. list` for a known term."""
    term, found = arguments
    if isinstance(term, PrologVariable):
        raise SourceIssue(at, "=.. with a variable on the left is not translated")
    if not isinstance(term, Compound):
        return [(found, make_list([term]))]
    return [(found, make_list([Compound(term.name), *term.arguments]))]


def _is_text(term: PrologTerm) -> bool:
    return isinstance(term, Compound) and not term.arguments and term.name[0] == '"'


def _is_atom(term: PrologTerm) -> bool:
    return isinstance(term, Compound) and not term.arguments and not _is_text(term)


def _is_number(term: PrologTerm) -> bool:
    return isinstance(term, int | Real)


def _is_compound(term: PrologTerm) -> bool:
    return isinstance(term, Compound) and bool(term.arguments)


_TYPES: dict[str, Callable[[PrologTerm], bool]] = {
    "var": lambda term: isinstance(term, PrologVariable),
    "nonvar": lambda term: not isinstance(term, PrologVariable),
    "atom": _is_atom,
    "number": _is_number,
    "integer": lambda term: isinstance(term, int),
    "float": lambda term: isinstance(term, Real),
    "atomic": lambda term: _is_number(term) or _is_atom(term),  # false for a string, as in ProbLog
    "compound": _is_compound,
    "callable": lambda term: _is_atom(term) or _is_compound(term),
    "ground": is_ground,
    "is_list": lambda term: _list_items(term) is not None,
}

BUILTINS: dict[tuple[str, int], Callable[[Arguments, Place], Solutions]] = {
    ("=", 2): lambda arguments, at: [(arguments[0], arguments[1])],
    ("\\=", 2): lambda arguments, at: _test(not _can_unify(*arguments)),
    ("==", 2): lambda arguments, at: _test(arguments[0] == arguments[1]),
    ("\\==", 2): lambda arguments, at: _test(arguments[0] != arguments[1]),
    ("is", 2): _compute_is,
    ("between", 3): _enumerate_between,
    ("succ", 2): _compute_successor,
    ("plus", 3): _compute_plus,
    ("length", 2): _measure_length,
    ("=..", 2): _split,
    **{(sign, 2): partial(_compare, relation) for sign, relation in COMPARISONS.items()},
    **{(name, 1): partial(_test_type, has_type) for name, has_type in _TYPES.items()},
}
"""Name and number of arguments of a predicate -> its solutions, given the arguments."""

MODAL = {("\\=", 2), ("==", 2), ("\\==", 2), *((name, 1) for name in _TYPES)}
"""Builtins that have other solutions after a variable in their arguments has a value."""

"""Terms of Prolog: numbers, variables and compound terms, with unification.

An integer is an `int`, a floating-point number a `Real`. A constant is a compound term without arguments; a
quoted atom keeps its quotes, as ProbLog distinguishes `'a'` from `a`, and so does a string. ProbLog also
distinguishes `+(1,2)` from `1+2`, so the name of an operator before brackets has quotes, too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from lcorpp.reasoning.language.issues import SYNTHETIC_PLACE, Place, SourceIssue

MAX_TERM_DEPTH = 200
"""Maximal nesting depth of a term, so that recursive functions are safe; a list has a level per element."""

MAX_SHOWN = 80
"""Maximal length of a term in a message."""

DIGITS = 15
"""Decimal places to which ProbLog rounds the floating-point numbers in terms."""


class Real(float):
    """A floating-point number; it differs as a term from the integer of the same value, and 0.0 from -0.0.

    exact: the number as it is written, a decimal fraction.
    """

    exact: Fraction | None

    def __new__(cls, value: float, exact: Fraction | None = None) -> Real:
        real = super().__new__(cls, round(value, DIGITS))
        real.exact = exact
        return real

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Real) and repr(self) == repr(other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(repr(self))


@dataclass(frozen=True)
class PrologVariable:
    """A variable; the parser gives each `_` of a clause a name of its own."""

    name: str

    def __str__(self) -> str:
        return self.name.partition("'")[0]


def is_ground(term: PrologTerm) -> bool:
    """Whether a term has no variables."""
    return term.is_ground if isinstance(term, Compound) else not isinstance(term, PrologVariable)


class Compound:
    """`name(arguments)`; a constant has no arguments, a list is `.(first, rest)` or `[]`.

    at: its place, which equality ignores.
    is_ground: whether it has no variables.
    """

    __slots__ = ("_hash", "arguments", "at", "depth", "is_ground", "name")

    is_ground: bool
    depth: int

    def __init__(
        self, name: str, arguments: tuple[PrologTerm, ...] = (), at: Place = SYNTHETIC_PLACE
    ) -> None:
        self.name, self.arguments, self.at = name, arguments, at
        self._hash = hash((name, arguments))
        self.is_ground = all(map(is_ground, arguments))
        self.depth = 1 + max((x.depth for x in arguments if isinstance(x, Compound)), default=0)
        if self.depth > MAX_TERM_DEPTH and name not in (",", ";"):
            raise SourceIssue(at, f"a term nested deeper than {MAX_TERM_DEPTH} levels")

    @property
    def key(self) -> tuple[str, int]:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, Compound)
            and self._hash == other._hash
            and self.name == other.name
            and self.arguments == other.arguments
        )

    def __hash__(self) -> int:
        return self._hash

    def __str__(self) -> str:
        return format_term(self)


PrologTerm: TypeAlias = int | Real | PrologVariable | Compound
Bindings: TypeAlias = Mapping[PrologVariable, PrologTerm]

EMPTY_LIST = Compound("[]")

_INFIX = {
    ",", ";", "->", ":-", "::", "=", "\\=", "==", "\\==", "is", "=:=", "=\\=", "<", ">", "=<", ">=", "+", "-",
    "*", "/", "//", "mod", "rem", "div", "**", "^", "xor", "<<", ">>", "/\\", "\\/", "@<", "@>", "@=<", "@>=",
    "=..", "\\", ":",
}  # fmt: skip


_PLAIN = re.compile(r"(?![A-Z])[^\W\d_]\w*")


def unquote(name: str) -> str:
    """Return a name without its quotes."""
    return name[1:-1] if name[0] == "'" and len(name) > 2 else name


def quote(name: str) -> str:
    """Return a name with quotes if Prolog needs them."""
    return name if _PLAIN.fullmatch(name) or name in _INFIX else f"'{name}'"


def format_atom(atom: Compound) -> str:
    """Return the text of an atom, whose predicate has no quotes."""
    return format_term(Compound(quote(atom.name), atom.arguments))


def format_term(term: PrologTerm) -> str:
    """Return the text of a term as one writes it in Prolog."""
    if not isinstance(term, Compound):
        return str(term)
    name, arguments = term.name, term.arguments
    if name == "." and len(arguments) == 2:
        return _format_list(term)
    if len(arguments) == 2 and name in _INFIX:
        left, right = map(_format_operand, arguments)
        space = " " if name[0].isalpha() or name in (",", ";", ":-", "->") else ""
        return f"{left}{'' if name == ',' else space}{name}{space}{right}"
    if len(arguments) == 1 and name in ("\\+", "-", "+", "\\"):
        return f"{name}{_format_operand(arguments[0])}"
    if not arguments:
        return name
    shown = unquote(name) if unquote(name) in _INFIX else name
    return f"{shown}({','.join(map(_format_argument, arguments))})"


def abbreviate(term: PrologTerm) -> str:
    """Return the text of a term for a message, at most `MAX_SHOWN` characters."""
    text = format_term(term)
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


def _format_operand(term: PrologTerm) -> str:
    text = format_term(term)
    is_operation = isinstance(term, Compound) and len(term.arguments) in (1, 2) and term.name in _INFIX
    return f"({text})" if is_operation else text


def _format_argument(term: PrologTerm) -> str:
    is_comma = isinstance(term, Compound) and term.name in (",", ";", ":-", "->") and term.arguments
    return f"({format_term(term)})" if is_comma else format_term(term)


def _format_list(term: PrologTerm) -> str:
    parts: list[str] = []
    while isinstance(term, Compound) and term.key == (".", 2):
        parts.append(_format_argument(term.arguments[0]))
        term = term.arguments[1]
    tail = "" if term == EMPTY_LIST else f"|{_format_argument(term)}"
    return f"[{','.join(parts)}{tail}]"


def make_list(
    items: list[PrologTerm], tail: PrologTerm = EMPTY_LIST, at: Place = SYNTHETIC_PLACE
) -> PrologTerm:
    """Make the list of some items."""
    for item in reversed(items):
        tail = Compound(".", (item, tail), at)
    return tail


def iter_term_variables(term: PrologTerm) -> Iterator[PrologVariable]:
    """Iterate over the variables of a term from left to right, with repetitions."""
    if isinstance(term, PrologVariable):
        yield term
    elif isinstance(term, Compound) and not term.is_ground:
        for argument in term.arguments:
            yield from iter_term_variables(argument)


# unification


def dereference(term: PrologTerm, bindings: Bindings) -> PrologTerm:
    """Follow the bindings of a variable."""
    while isinstance(term, PrologVariable) and term in bindings:
        term = bindings[term]
    return term


def substitute(term: PrologTerm, bindings: Bindings) -> PrologTerm:
    """Replace the bound variables of a term."""
    term = dereference(term, bindings)
    if not isinstance(term, Compound) or term.is_ground:
        return term
    return Compound(term.name, tuple([substitute(x, bindings) for x in term.arguments]), term.at)


def unify(
    left: PrologTerm, right: PrologTerm, bindings: dict[PrologVariable, PrologTerm], quoted: bool = True
) -> bool:
    """Make two terms equal by adding bindings; return whether that is possible.

    A variable is not bound to a term that contains it, as such a term has no finite value.

    quoted: whether `'a'` differs from `a`, as it does in ProbLog but for `=`.
    """
    left, right = dereference(left, bindings), dereference(right, bindings)
    if left is right:
        return True
    if isinstance(left, PrologVariable) or isinstance(right, PrologVariable):
        if left == right:
            return True
        name, value = (left, right) if isinstance(left, PrologVariable) else (right, left)
        assert isinstance(name, PrologVariable)
        if not is_ground(value) and name in iter_term_variables(substitute(value, bindings)):
            return False
        bindings[name] = value
        return True
    if not (isinstance(left, Compound) and isinstance(right, Compound)):
        return left == right
    if left == right:
        return True
    if quoted and left.is_ground and right.is_ground:
        return False
    names = (left.name, right.name) if quoted else (unquote(left.name), unquote(right.name))
    return (
        names[0] == names[1]
        and len(left.arguments) == len(right.arguments)
        and all(
            unify(one, other, bindings, quoted)
            for one, other in zip(left.arguments, right.arguments, strict=True)
        )
    )


def rename(term: PrologTerm, names: dict[PrologVariable, PrologVariable], prefix: str) -> PrologTerm:
    """Rename the variables of a term in the order of their occurrence; extends the renaming."""
    if isinstance(term, PrologVariable):
        return names.setdefault(term, PrologVariable(f"{prefix}{len(names)}"))
    if not isinstance(term, Compound) or term.is_ground:
        return term
    return Compound(term.name, tuple([rename(x, names, prefix) for x in term.arguments]), term.at)

"""Names of P-log for predicates and terms of Prolog; what is not a name there gets one with an apostrophe."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from typing import NamedTuple

from lcorpp.reasoning.language.arithmetic import MAX_INTEGER
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.syntax import Expression, Number, Statement, Term
from lcorpp.reasoning.language.translation.prolog_terms import Compound, PrologTerm, format_term, quote

_RESERVED = {
    "attributes", "boolean", "do", "false", "mod", "not", "obs", "pr", "random", "sorts", "statements", "true"
}  # fmt: skip
"""Names that P-log reserves."""

_NAME = re.compile(r"[a-z][A-Za-z0-9_]*")

CHOICE = "choice'"
"""Begins the names of the attributes that are choices of clauses."""

_MADE_NAME = re.compile(r"[A-Za-z]\w*'\w*")

_CASE = re.compile(r"case'[0-9_]+")


class Translation(NamedTuple):
    """A translated program.

    statements: in P-log.
    names: the names with an apostrophe, and what they are in the source. Attributes without counterpart, such
        as a choice between heads, have a description in square brackets.
    """

    statements: tuple[Statement, ...]
    names: Mapping[str, str]


def restore_names(text: str, names: Mapping[str, str]) -> str:
    """Replace the names of a translation in a text by those of the source."""
    return _MADE_NAME.sub(lambda found: names.get(found[0], found[0]), text) if names else text


def is_auxiliary(term: str, names: Mapping[str, str]) -> bool:
    """Return whether a term of a translation has no counterpart in the source."""
    return names.get(term.partition("(")[0], "").startswith("[")


def has_plain_letters(name: str) -> bool:
    """Whether a name has the letters of a name of P-log; it may be reserved."""
    return _NAME.fullmatch(name) is not None


def is_plain_name(name: str) -> bool:
    """Whether a name of Prolog is one of P-log, too."""
    return has_plain_letters(name) and name not in _RESERVED


def make_choice_name(at: Place) -> str:
    """Make the name of the attribute that is the choice of the clause at a place."""
    return f"{CHOICE}{at.line}_{at.column}"


def describe_choice(at: Place) -> str:
    """Describe the attribute that is the choice of the clause at a place."""
    return f"[choice {at.line}:{at.column}]"


def make_case_name(at: Place, number: int) -> str:
    """Make the name of the predicate that is the n-th negated conjunction at a place."""
    return f"case'{at.line}_{at.column}{f'_{number}' if number > 1 else ''}"


def is_made_name(name: str) -> bool:
    """Whether a predicate is not one of the program but a negated conjunction."""
    return _CASE.fullmatch(name) is not None


class NameTable:
    """Names of predicates and values, different for different ones."""

    def __init__(self) -> None:
        self._names: dict[PrologTerm | str, str] = {}  # of terms and predicates
        self._owners: dict[str, PrologTerm | str] = {}

    def name_predicate(self, name: str) -> str:
        """Name a predicate."""
        return name if is_plain_name(name) or is_made_name(name) else self._find_name(name, name)

    def name_value(self, term: PrologTerm, at: Place) -> Expression:
        """Name an argument."""
        if isinstance(term, int) and abs(term) <= MAX_INTEGER:
            return Number(Fraction(term), at=at)
        if isinstance(term, Compound) and not term.arguments and is_plain_name(term.name):
            return Term(term.name, at=at)
        return Term(self._find_name(term, format_term(term)), at=at)

    def _find_name(self, owner: PrologTerm | str, text: str) -> str:
        if owner not in self._names:
            words = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:40] or "value"
            base = f"{words[0].lower()}{words[1:]}'" if words[0].isalpha() else f"n{words}'"
            name, number = base, 1
            while self._owners.setdefault(name, owner) != owner:
                number += 1
                name = f"{base}{number}"
            self._names[owner] = name
        return self._names[owner]

    def list_names(self) -> dict[str, str]:
        """List the names with an apostrophe, and what they are in the source."""
        return {
            name: _describe(owner) if isinstance(owner, str) else format_term(owner)
            for owner, name in self._names.items()
        }


def describe_case(name: str) -> str:
    """Describe a negated conjunction, given its name."""
    place = name.partition("'")[2].replace("_", ":", 1)
    return f"[negation {place}]"


def _describe(predicate: str) -> str:
    """Describe a predicate; one with an apostrophe and a number has the answers of another call."""
    name, apostrophe, number = predicate.rpartition("'")
    return f"[{name}, call {number}]" if apostrophe and number.isdigit() else quote(predicate)

"""Facts of integers and names in a compact form, as a program may have hundreds of thousands."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.lexer import INTEGER, NAME, Cursor
from lcorpp.reasoning.language.syntax import Literal, Number, Rule, Term


class Fact(Rule):
    """A fact; it equals the rule with its head, which is made when it is read.

    name: the attribute.
    values: the arguments and the value.
    offsets: the columns where they begin, counted from that of the fact.
    """

    __slots__ = ("at", "name", "offsets", "values")

    name: str
    values: tuple[int | str, ...]
    offsets: tuple[int, ...]

    def __init__(self, name: str, values: tuple[int | str, ...], offsets: tuple[int, ...], at: Place) -> None:
        self.name, self.values, self.offsets, self.at = name, values, offsets, at  # type: ignore[misc]

    @property
    def head(self) -> Literal:
        """The head as a literal."""
        places = [self.at._replace(column=self.at.column + offset) for offset in self.offsets]
        *arguments, value = [
            Term(value, at=at) if isinstance(value, str) else Number(Fraction(value), at=at)
            for value, at in zip(self.values, places, strict=True)
        ]
        return Literal(Term(self.name, tuple(arguments), at=self.at), "=", value, at=self.at)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Rule) and self._list_values() == other._list_values()

    __hash__ = Rule.__hash__

    def __reduce__(self) -> tuple[Any, ...]:
        return Fact, (self.name, self.values, self.offsets, self.at)


def parse_fact(cursor: Cursor) -> Fact | None:
    """Parse a fact of names and integers on one line; None, and nothing consumed, if there is none."""
    kinds, texts, starts, first = cursor.kinds, cursor.texts, cursor.starts, cursor.index
    if kinds[first] != NAME or kinds[first + 1] != "(":
        return None
    values: list[int | str] = []
    offsets: list[int] = []
    index, sign = first + 2, "("
    while sign != ".":
        kind, word = kinds[index], texts[index]
        if kind == NAME and word not in cursor.constants:
            values.append(word)
        elif kind == INTEGER and len(word) < 10:
            values.append(int(word))
        else:
            return None
        offsets.append(starts[index] - starts[first])
        before, sign = sign, kinds[index + 1]
        index += 2
        if sign == ")" and before != "=":
            sign = kinds[index]
            index += 1
            if sign == ".":
                values.append("true")
                offsets.append(0)
            elif sign != "=":
                return None
        elif sign != ("." if before == "=" else ","):
            return None
    if not cursor.is_on_one_line(first, index - 1):
        return None
    at = cursor.at
    cursor.skip_to(index)
    return Fact(texts[first], tuple(values), tuple(offsets), at)

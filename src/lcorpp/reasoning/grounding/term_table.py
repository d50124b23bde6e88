"""The table of ground terms, and the numbers of terms, values and literals in the bindings of a statement.

A part of a clause is a number if it has no variables, otherwise a column: its number in each binding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import chain
from typing import Any

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.grounding.binding_table import BindingTable, Part
from lcorpp.reasoning.grounding.ground_program import GroundLiteral, GroundProgram, make_full_mask
from lcorpp.reasoning.language.arithmetic import Value, as_value, canonical_text, compare_values
from lcorpp.reasoning.language.syntax import Expression, Literal, Term

Key = Value | tuple[Value, ...]
"""The arguments of a term. A single argument is not wrapped in a tuple; no value is a tuple."""

MAX_MASK_BITS = 2**31
"""The masks of all conditions of a program have at most this many bits, one for each value of a term."""


class TermTable:
    """The terms of a ground program, numbered in the order in which clauses name them."""

    def __init__(self, program: GroundProgram) -> None:
        self.program, self.signature = program, program.source.signature
        self._numbers: dict[str, dict[Key, int]] = {name: {} for name in self.signature.attributes}
        self._masks: dict[tuple[str, str, bool], dict[Value, int]] = {}
        self._value_indexes: dict[str, dict[Value, int]] = {}
        self._mask_bits = 0

    def number_term(self, attribute: str, key: Key) -> int:
        """Return the number of a term; a new term gets the next number."""
        numbers = self._numbers[attribute]
        if key not in numbers:
            numbers[key] = self._make_adder(attribute)(key)
        return numbers[key]

    def number_fact(self, attribute: str, values: tuple[Value, ...]) -> tuple[int, int]:
        """Return the number of the term in a fact and the index of its value, the last of `values`."""
        return self.number_term(attribute, make_key(values[:-1])), self._index_values(attribute)[values[-1]]

    def _make_adder(self, attribute: str) -> Callable[[Key], int]:
        """Return a function that adds a term of an attribute and returns its number."""
        names, ranges = self.program.names, self.program.values
        values = self.signature.attributes[attribute].values

        def add(key: Key) -> int:
            inner = ",".join(map(str, key)) if isinstance(key, tuple) else key
            names.append(attribute if key == () else f"{attribute}({inner})")
            ranges.append(values)
            return len(names) - 1

        return add

    def translate_ground_literal(self, literal: Literal) -> GroundLiteral:
        """Translate a literal without variables."""
        arguments = [as_value(canonical_text(argument)) for argument in literal.term.arguments]
        term = self.number_term(literal.term.name, make_key(arguments))
        return term, self._make_mask(literal, as_value(canonical_text(literal.value))), literal.negated

    # parts of clauses

    def number_terms(self, table: BindingTable, terms: Iterable[Term]) -> list[Part[int]]:
        """Return the number of each term in each binding; new terms are numbered binding by binding."""
        result: list[Part[int]] = []
        columns: list[tuple[int, str, list[Key]]] = []  # (index in the result, attribute, arguments)
        for i, term in enumerate(terms):
            parts = [table.evaluate(argument) for argument in term.arguments]
            if any(isinstance(part, list) for part in parts):
                keys: Any = parts[0] if len(parts) == 1 else table.list_rows(parts)
                columns.append((i, term.name, keys))
                result.append([])
            else:
                result.append(self.number_term(term.name, make_key(parts)))  # type: ignore[arg-type]
        new = [
            (name, keys) for _, name, keys in columns if not all(map(self._numbers[name].__contains__, keys))
        ]
        rows = zip(*(keys for _, keys in new), strict=True)
        if len({name for name, _ in new}) == 1:  # the same order as below, faster
            name, numbers = new[0][0], self._numbers[new[0][0]]
            add = self._make_adder(name)
            for key in dict.fromkeys(chain.from_iterable(rows)):
                if key not in numbers:
                    numbers[key] = add(key)
        else:
            for row in rows:
                for (name, _), key in zip(new, row, strict=True):
                    self.number_term(name, key)
        for i, name, keys in columns:
            result[i] = list(map(self._numbers[name].__getitem__, keys))
        return result

    def index_value(self, table: BindingTable, term: Term, value: Expression) -> Part[int]:
        """Return the index of a value of a term in each binding."""
        indexes, part = self._index_values(term.name), table.evaluate(value)
        return list(map(indexes.__getitem__, part)) if isinstance(part, list) else indexes[part]

    def format_label(self, table: BindingTable, label: Term | None) -> Part[str]:
        """Format the arguments of a label in each binding."""
        parts = [table.evaluate(argument) for argument in label.arguments] if label else []
        if not any(isinstance(part, list) for part in parts):
            return ",".join(map(str, parts))
        texts = [list(map(str, table.iterate(part))) for part in parts]
        return texts[0] if len(texts) == 1 else list(map(",".join, zip(*texts, strict=True)))

    def make_mask(self, table: BindingTable, literal: Literal) -> Part[int]:
        """Return the mask of the outcomes that satisfy a literal in each binding."""
        masks = self._masks.setdefault((literal.term.name, literal.relation, literal.negated), {})
        return table.look_up(masks, table.evaluate(literal.value), partial(self._make_mask, literal))

    def _index_values(self, attribute: str) -> dict[Value, int]:
        if attribute not in self._value_indexes:
            values = self.signature.attributes[attribute].values
            self._value_indexes[attribute] = {as_value(value): i for i, value in enumerate(values)}
        return self._value_indexes[attribute]

    def _make_mask(self, literal: Literal, value: Value) -> int:
        """Make the mask of the outcomes that satisfy a literal with this value on its right-hand side.

        Raises:
            TooLargeError: all masks made so far have more than `MAX_MASK_BITS`.
        """
        indexes, relation = self._index_values(literal.term.name), literal.relation
        self._mask_bits += len(indexes)
        if self._mask_bits > MAX_MASK_BITS:
            raise TooLargeError(
                f"{literal.at}: too many conditions on attributes with many values, here {len(indexes)}"
            )
        mask = 0
        if relation == "=":
            mask = 1 << indexes[value] if value in indexes else 0
        else:
            for candidate, i in indexes.items():
                if compare_values(candidate, relation, value):
                    mask |= 1 << i
        return make_full_mask(len(indexes)) & ~mask if literal.negated else mask


def make_key(arguments: Sequence[Value]) -> Key:
    """Return the key of a term with these arguments."""
    return arguments[0] if len(arguments) == 1 else tuple(arguments)

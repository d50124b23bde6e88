"""The table of ground terms, and the translation of terms, values and literals into parts of generated code.

A statement's instantiator (`rule_instantiator`) is generated Python; for each part of a clause, `TermTable`
returns its number if the part has no variables, otherwise the source that computes the number at run time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.grounding.generated_function import GeneratedFunction, Part, Source
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

    # parts of clauses with variables: numbers, or source that computes them

    def translate_term(self, code: GeneratedFunction, term: Term) -> Part:
        """Translate a term to its number."""
        parts = [code.translate(argument) for argument in term.arguments]
        if not any(isinstance(part, Source) for part in parts):
            return self.number_term(term.name, make_key(parts))
        inner = ", ".join(map(code.quote, parts))
        key = inner if len(parts) == 1 else f"({inner})"
        return code.add_lookup(self._numbers[term.name], key, self._make_adder(term.name))

    def translate_value(self, code: GeneratedFunction, term: Term, value: Expression) -> Part:
        """Translate a value of a term to its index."""
        indexes, part = self._index_values(term.name), code.translate(value)
        return Source(f"{code.name_constant(indexes)}[{part}]") if isinstance(part, Source) else indexes[part]

    def translate_label(self, code: GeneratedFunction, label: Term | None) -> Part:
        """Translate the arguments of a label to text."""
        parts = [code.translate(argument) for argument in label.arguments] if label else []
        if not any(isinstance(part, Source) for part in parts):
            return ",".join(map(str, parts))
        return Source(" + ',' + ".join(f"str({code.quote(part)})" for part in parts))

    def translate_literal(self, code: GeneratedFunction, literal: Literal) -> tuple[Part, Part, bool]:
        """Translate a literal to its term, the mask of the satisfying outcomes and whether it is negated."""
        value, term = code.translate(literal.value), self.translate_term(code, literal.term)
        if not isinstance(value, Source):
            return term, self._make_mask(literal, value), literal.negated
        masks = self._masks.setdefault((literal.term.name, literal.relation, literal.negated), {})
        return term, code.add_lookup(masks, value, partial(self._make_mask, literal)), literal.negated

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

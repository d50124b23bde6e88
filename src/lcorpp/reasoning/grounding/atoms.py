"""The table of ground terms, and the translation of terms, values and literals into parts of generated code.

A statement's instantiator (`rule_instantiator`) is generated Python; for each part of a clause, `AtomTable`
returns its number if the part has no variables, otherwise the source that computes the number at run time.
"""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.grounding.generated_function import GeneratedFunction, Part, Source
from lcorpp.reasoning.grounding.ground_program import GroundLiteral, GroundProgram
from lcorpp.reasoning.grounding.values import Value, compare_values, parse_value
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.syntax import Expression, Literal, Term

Key = Value | tuple[Value, ...]
"""The arguments of a term; a single argument is not wrapped in a tuple."""

MAX_MASK_BITS = 2**31
"""The masks of all conditions of a program have at most this many bits, one for each value of a term."""


class AtomTable:
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
        number = numbers.get(key)
        if number is None:
            number = numbers[key] = len(self.program.values)
            inner = ",".join(map(str, key)) if isinstance(key, tuple) else key
            text = attribute if key == () else f"{attribute}({inner})"
            self.program.names.append(text)
            self.program.values.append(self.signature.attributes[attribute].values)
        return number

    def translate_ground_literal(self, literal: Literal) -> GroundLiteral:
        """Translate a literal without variables."""
        arguments = [parse_value(canonical_text(argument)) for argument in literal.term.arguments]
        term = self.number_term(literal.term.name, make_key(arguments))
        return (
            term,
            self._compute_outcome_mask(literal, parse_value(canonical_text(literal.value))),
            literal.negated,
        )

    # parts of clauses with variables: numbers, or source that computes them

    def translate_term(self, rule: GeneratedFunction, term: Term) -> Part:
        """Translate a term to its number."""
        parts = [rule.translate(argument) for argument in term.arguments]
        if not any(isinstance(part, Source) for part in parts):
            return self.number_term(term.name, make_key(parts))
        inner = ", ".join(map(rule.quote, parts))
        name = rule.name_constant(None)
        key = inner if len(parts) == 1 else f"({inner})"
        rule.add_line(f"{name} = {rule.name_constant(self._numbers[term.name].get)}(k := {key})")
        rule.add_line(f"if {name} is None: {name} = {rule.name_constant(self.number_term)}({term.name!r}, k)")
        return name

    def translate_value(self, rule: GeneratedFunction, term: Term, value: Expression) -> Part:
        """Translate a value of a term to its index."""
        indexes, part = self._index_values(term.name), rule.translate(value)
        return Source(f"{rule.name_constant(indexes)}[{part}]") if isinstance(part, Source) else indexes[part]

    def translate_label(self, rule: GeneratedFunction, arguments: Sequence[Expression]) -> Part:
        """Translate the arguments of a rule's label to text."""
        parts = [rule.translate(argument) for argument in arguments]
        if not any(isinstance(part, Source) for part in parts):
            return ",".join(map(str, parts))
        return Source(" + ',' + ".join(f"str({rule.quote(part)})" for part in parts))

    def translate_literal(self, rule: GeneratedFunction, literal: Literal) -> tuple[Part, Part, bool]:
        """Translate a literal to its term, the mask of the satisfying outcomes and whether it is negated."""
        value = rule.translate(literal.value)
        if not isinstance(value, Source):
            term = self.translate_term(rule, literal.term)
            return term, self._compute_outcome_mask(literal, value), literal.negated
        known = self._masks.setdefault((literal.term.name, literal.relation, literal.negated), {})

        def compute_mask(value: Value) -> int:
            mask = known[value] = self._compute_outcome_mask(literal, value)
            return mask

        term, mask = self.translate_term(rule, literal.term), rule.name_constant(None)
        rule.add_line(f"{mask} = {rule.name_constant(known.get)}(k := {value})")
        rule.add_line(f"if {mask} is None: {mask} = {rule.name_constant(compute_mask)}(k)")
        return term, mask, literal.negated

    def _index_values(self, attribute: str) -> dict[Value, int]:
        if attribute not in self._value_indexes:
            values = self.signature.attributes[attribute].values
            self._value_indexes[attribute] = {parse_value(value): i for i, value in enumerate(values)}
        return self._value_indexes[attribute]

    def _compute_outcome_mask(self, literal: Literal, value: Value) -> int:
        """The mask of the outcomes that satisfy a literal with this value on its right-hand side."""
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
        return ((1 << len(indexes) + 1) - 1) & ~mask if literal.negated else mask


def make_key(arguments: Sequence[Value]) -> Key:
    """Return the key of a term with these arguments."""
    return arguments[0] if len(arguments) == 1 else tuple(arguments)

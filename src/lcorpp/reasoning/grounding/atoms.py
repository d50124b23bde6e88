"""Terms, values and outcomes in ground clauses, as numbers or as the source that finds them."""

from __future__ import annotations

from collections.abc import Sequence

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.grounding.ground_program import GroundProgram, Literal as GroundLiteral
from lcorpp.reasoning.grounding.rule_instantiator import Part, RuleInstantiator, Source
from lcorpp.reasoning.grounding.values import Value, holds, value_of
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.syntax import Expression, Literal, Term

Key = Value | tuple[Value, ...]
"""The arguments of a term; one alone stands for itself."""

MOST_BITS = 2**31
"""How many bits the conditions of a program may take, one for each value that one may have."""


class AtomTable:
    """The parts of the clauses of a ground program, which learns of the terms as they are met."""

    def __init__(self, program: GroundProgram) -> None:
        self.ground, self.signature = program, program.program.signature
        self._ids: dict[str, dict[Key, int]] = {name: {} for name in self.signature.attributes}
        self._masks: dict[tuple[str, str, bool], dict[Value, int]] = {}
        self._indexes: dict[str, dict[Value, int]] = {}
        self._bits = 0

    def number(self, attribute: str, key: Key) -> int:
        """The number of a term, a new one if it was not met before."""
        ids = self._ids[attribute]
        found = ids.get(key)
        if found is None:
            found = ids[key] = len(self.ground.values)
            inner = ",".join(map(str, key)) if isinstance(key, tuple) else key
            text = attribute if key == () else f"{attribute}({inner})"
            self.ground.names.append(text)
            self.ground.values.append(self.signature.attributes[attribute].values)
        return found

    def ground_literal(self, literal: Literal) -> GroundLiteral:
        """The same for a literal without variables."""
        term = self.number(
            literal.term.name, key_of([value_of(canonical_text(a)) for a in literal.term.arguments])
        )
        return term, self._allowed(literal, value_of(canonical_text(literal.value))), literal.negated

    def term(self, join: RuleInstantiator, term: Term) -> Part:
        """A term."""
        parts = [join.part(argument) for argument in term.arguments]
        if not any(isinstance(part, Source) for part in parts):
            return self.number(term.name, key_of(parts))
        inner = ", ".join(map(join.written, parts))
        found = join.name(None)
        key = inner if len(parts) == 1 else f"({inner})"
        join.add(f"{found} = {join.name(self._ids[term.name].get)}(k := {key})")
        join.add(f"if {found} is None: {found} = {join.name(self.number)}({term.name!r}, k)")
        return found

    def value(self, join: RuleInstantiator, term: Term, value: Expression) -> Part:
        """The number of a value of a term."""
        numbers, part = self._numbers(term.name), join.part(value)
        return Source(f"{join.name(numbers)}[{part}]") if isinstance(part, Source) else numbers[part]

    def label(self, join: RuleInstantiator, arguments: Sequence[Expression]) -> Part:
        """The arguments of a label as text."""
        parts = [join.part(argument) for argument in arguments]
        if not any(isinstance(part, Source) for part in parts):
            return ",".join(map(str, parts))
        return Source(" + ',' + ".join(f"str({join.written(part)})" for part in parts))

    def literal(self, join: RuleInstantiator, literal: Literal) -> tuple[Part, Part, bool]:
        """A literal: its term, the outcomes that make it true, whether it stands under `not`."""
        value = join.part(literal.value)
        if not isinstance(value, Source):
            return self.term(join, literal.term), self._allowed(literal, value), literal.negated
        known = self._masks.setdefault((literal.term.name, literal.relation, literal.negated), {})

        def make(value: Value) -> int:
            allowed = known[value] = self._allowed(literal, value)
            return allowed

        term, allowed = self.term(join, literal.term), join.name(None)
        join.add(f"{allowed} = {join.name(known.get)}(k := {value})")
        join.add(f"if {allowed} is None: {allowed} = {join.name(make)}(k)")
        return term, allowed, literal.negated

    def _numbers(self, attribute: str) -> dict[Value, int]:
        if attribute not in self._indexes:
            values = self.signature.attributes[attribute].values
            self._indexes[attribute] = {value_of(value): i for i, value in enumerate(values)}
        return self._indexes[attribute]

    def _allowed(self, literal: Literal, value: Value) -> int:
        numbers, relation = self._numbers(literal.term.name), literal.relation
        self._bits += len(numbers)
        if self._bits > MOST_BITS:
            raise TooLargeError(
                f"{literal.at}: too many conditions on attributes with many values, here {len(numbers)}"
            )
        allowed = 0
        if relation == "=":
            allowed = 1 << numbers[value] if value in numbers else 0
        else:
            for has, i in numbers.items():
                if holds(has, relation, value):
                    allowed |= 1 << i
        return ((1 << len(numbers) + 1) - 1) & ~allowed if literal.negated else allowed


def key_of(arguments: Sequence[Value]) -> Key:
    """The key of a term with these arguments."""
    return arguments[0] if len(arguments) == 1 else tuple(arguments)

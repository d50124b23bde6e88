"""The table of ground terms, and the numbers of terms, values and literals in the bindings of a statement.

A part of a clause is one item if it has no variables, otherwise a column: its item in each binding.
"""

from __future__ import annotations

from functools import partial

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.grounding.binding_table import BindingTable, Key, Memo, Part
from lcorpp.reasoning.grounding.ground_program import GroundLiteral, GroundProgram, make_full_mask
from lcorpp.reasoning.language.arithmetic import Value, as_value, compare_values
from lcorpp.reasoning.language.syntax import Expression, Literal, Term

MAX_MASK_BITS = 2**31
"""The masks of all conditions of a program have at most this many bits, one for each value of a term."""


class TermTable:
    """The terms of a ground program, numbered in the order in which clauses name them.

    numbers: attribute -> key of the arguments -> number; a new term gets the next number.
    indexes: attribute -> value -> its index in the range.
    """

    def __init__(self, program: GroundProgram) -> None:
        self._names, self._values = program.names, program.values  # so that no cycle contains the clauses
        self._attributes = program.source.signature.attributes
        self.numbers: Memo[str, Memo[Key, int]] = Memo(lambda name: Memo(partial(self._add, name)))
        self.indexes: Memo[str, dict[Value, int]] = Memo(
            lambda name: {as_value(value): i for i, value in enumerate(self._attributes[name].values)}
        )
        self._masks: dict[tuple[str, str, bool], Memo[Value, int]] = {}
        self._literals: dict[GroundLiteral, GroundLiteral] = {}
        self._mask_bits = 0

    def _add(self, attribute: str, key: Key) -> int:
        inner = ",".join(map(str, key)) if isinstance(key, tuple) else key
        self._names.append(f"{attribute}({inner})" if key != () else attribute)
        self._values.append(self._attributes[attribute].values)
        return len(self._names) - 1

    def number_term(self, attribute: str, arguments: tuple[Value, ...]) -> int:
        """Return the number of one term."""
        return self.numbers[attribute][arguments[0] if len(arguments) == 1 else arguments]

    def number_terms(self, table: BindingTable, term: Term) -> Part[int]:
        """Return the number of a term in each binding."""
        return table.look_up(self.numbers[term.name], *map(table.evaluate, term.arguments))

    def index_values(self, table: BindingTable, term: Term, value: Expression) -> Part[int]:
        """Return the index of a value of a term in each binding."""
        return table.look_up(self.indexes[term.name], table.evaluate(value))

    def translate(self, table: BindingTable, literal: Literal) -> Part[GroundLiteral]:
        """Return the ground literal in each binding; equal ones are one object."""
        kind = literal.term.name, literal.relation, literal.negated
        masks = self._masks.setdefault(kind, Memo(partial(self._make_mask, literal)))
        numbers = self.number_terms(table, literal.term)
        mask = table.look_up(masks, table.evaluate(literal.value))
        literals = table.zip([numbers, mask, literal.negated])
        known = self._literals.setdefault
        return list(map(known, literals, literals)) if isinstance(literals, list) else literals

    def _make_mask(self, literal: Literal, value: Value) -> int:
        """Make the mask of the outcomes that satisfy a literal with this value on its right-hand side.

        Raises:
            TooLargeError: all masks made so far have more than `MAX_MASK_BITS`.
        """
        indexes, relation = self.indexes[literal.term.name], literal.relation
        self._mask_bits += len(indexes)
        if self._mask_bits > MAX_MASK_BITS:
            raise TooLargeError(
                f"{literal.at}: too many conditions on attributes with many values, here {len(indexes)}"
            )
        if relation == "=":
            mask = 1 << indexes[value] if value in indexes else 0
        else:
            mask = sum(1 << i for other, i in indexes.items() if compare_values(other, relation, value))
        return make_full_mask(len(indexes)) & ~mask if literal.negated else mask

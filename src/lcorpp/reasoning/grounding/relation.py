"""Relations, which a join reads: the members of a sort, the terms of an attribute, or its facts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

from lcorpp.reasoning.grounding.binding_table import Key, Memo
from lcorpp.reasoning.language.arithmetic import Value, as_value, canonical_text, split_record
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Term, Variable


class Relation:
    """A set of rows of values.

    columns: position -> its value in each row.
    count: the number of rows.
    indexes: positions -> the values there, as key -> the numbers of their rows.
    """

    def __init__(self, columns: Sequence[Sequence[Value]], count: int) -> None:
        self.columns, self.count = columns, count
        self.indexes: Memo[tuple[int, ...], Mapping[Key, Sequence[int]]] = Memo(self._index)

    @classmethod
    def from_rows(cls, rows: Iterable[tuple[Value, ...]], width: int) -> Relation:
        """Make a relation of the distinct rows."""
        distinct = dict.fromkeys(rows)
        return cls([[row[i] for row in distinct] for i in range(width)], len(distinct))

    @cached_property
    def rows(self) -> frozenset[Key]:
        """The rows as keys."""
        return frozenset(self._list_keys(range(len(self.columns))))

    def _list_keys(self, positions: Sequence[int]) -> Sequence[Key]:
        if not positions:
            return [()] * self.count
        columns = [self.columns[i] for i in positions]
        return columns[0] if len(columns) == 1 else list(zip(*columns, strict=True))

    def _index(self, positions: tuple[int, ...]) -> Mapping[Key, Sequence[int]]:
        if not positions:
            return {(): range(self.count)}
        index: dict[Key, list[int]] = {}
        for row, key in enumerate(self._list_keys(positions)):
            index.setdefault(key, []).append(row)
        return index

    def match(self, patterns: Sequence[Expression]) -> tuple[list[Variable], Relation]:
        """Match the rows with patterns: return the variables outside of arithmetic, and their values.

        Arithmetic in a pattern matches every value; the caller tests it once its variables are bound.
        """
        names = list_matched_variables(patterns)
        matches = []
        for row in zip(*self.columns, strict=True):
            values: dict[str, Value] = {}
            if all(map(_match, patterns, row, [values] * len(patterns))):
                matches.append(tuple([values[name] for name in names]))
        return list(map(Variable, names)), Relation.from_rows(matches, len(names))


def list_matched_variables(patterns: Iterable[Expression]) -> list[str]:
    """List the variables outside of arithmetic, which a match with values binds."""
    names: dict[str, None] = {}
    for pattern in patterns:
        if isinstance(pattern, Variable):
            names[pattern.name] = None
        elif isinstance(pattern, Term):
            names.update(dict.fromkeys(list_matched_variables(pattern.arguments)))
    return list(names)


def _match(pattern: Expression, value: Value, values: dict[str, Value]) -> bool:
    """Match a value with a pattern, and add the values of its variables."""
    if isinstance(pattern, Variable):
        return values.setdefault(pattern.name, value) == value
    if isinstance(pattern, Term) and pattern.arguments:
        if isinstance(value, int):
            return False
        name, arguments = split_record(value)
        return (
            name == pattern.name
            and len(arguments) == len(pattern.arguments)
            and all(map(_match, pattern.arguments, map(as_value, arguments), [values] * len(arguments)))
        )
    return isinstance(pattern, Arithmetic) or as_value(canonical_text(pattern)) == value

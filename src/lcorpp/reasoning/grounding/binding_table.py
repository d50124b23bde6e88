"""Tables of bindings: for each variable of a statement a column with its value in each binding.

An operation works on whole columns: a join lengthens them, a test shortens them, and an expression is
evaluated for all bindings at once. The bindings are in the order of nested loops.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, compress, repeat
from operator import add, mul, sub
from typing import Any, Generic, TypeAlias, TypeVar

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.language.arithmetic import Value, as_value, canonical_text, divide, iter_variables
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.syntax import Expression, Number, Term, Variable

_Key = TypeVar("_Key")
_Item = TypeVar("_Item")

MAX_BINDINGS = 4_000_000
"""Maximal number of bindings of a statement."""

Part: TypeAlias = _Item | list[_Item]
"""A value that all bindings share, or a column."""

Key = Value | tuple[Value, ...]
"""Several values. A single value is not wrapped in a tuple; no value is a tuple."""

_OPERATIONS = {"+": add, "-": sub, "*": mul}


class Memo(dict[_Key, _Item], Generic[_Key, _Item]):
    """A dictionary that computes missing items."""

    def __init__(self, compute: Callable[[_Key], _Item]) -> None:
        super().__init__()
        self._compute = compute

    def __missing__(self, key: _Key) -> _Item:
        item = self[key] = self._compute(key)
        return item


class BindingTable:
    """The bindings of variables; at first there is one, the empty binding.

    at: the place of the statement.
    count: the number of bindings.
    columns: variable -> its value in each binding.
    """

    def __init__(self, at: Place) -> None:
        self.at, self.count = at, 1
        self.columns: dict[str, list[Value]] = {}

    def iterate(self, part: Any) -> Iterable[Any]:
        """Iterate over the values of a part in all bindings."""
        return part if isinstance(part, list) else repeat(part, self.count)

    def iter_rows(self, parts: Sequence[Any]) -> Iterable[tuple[Any, ...]]:
        """Iterate over the values of parts in all bindings. No row is kept, so few are allocated."""
        return zip(*map(self.iterate, parts), strict=True) if parts else repeat((), self.count)

    def zip(self, parts: Sequence[Any]) -> Any:
        """Combine parts to one: the tuples of their values."""
        return list(self.iter_rows(parts)) if any(isinstance(part, list) for part in parts) else tuple(parts)

    def iter_keys(self, parts: Sequence[Any]) -> Iterable[Any]:
        """Iterate over the keys of parts in all bindings."""
        return self.iterate(parts[0]) if len(parts) == 1 else self.iter_rows(parts)

    def look_up(self, items: Mapping[Any, _Item], *parts: Any) -> Part[_Item]:
        """Look up the items of the keys of parts."""
        if any(isinstance(part, list) for part in parts):
            return list(map(items.__getitem__, self.iter_keys(parts)))
        return items[parts[0] if len(parts) == 1 else parts]

    def evaluate(self, expression: Expression) -> Part[Value]:
        """Evaluate an expression whose variables are bound.

        Raises:
            SourceIssue: a division by zero.
        """
        if isinstance(expression, Variable):
            return self.columns[expression.name]
        if isinstance(expression, Number) or not any(iter_variables(expression)):
            return as_value(canonical_text(expression))
        if isinstance(expression, Term):
            rows = self.iter_rows(list(map(self.evaluate, expression.arguments)))
            return [f"{expression.name}({','.join(map(str, row))})" for row in rows]
        left, right = (self.iterate(self.evaluate(side)) for side in (expression.left, expression.right))
        if expression.operator in ("/", "mod"):
            return list(map(_divide, left, right, repeat(expression.operator), repeat(expression.at)))
        return list(map(_OPERATIONS[expression.operator], left, right))

    def evaluate_all(self, expressions: Sequence[Expression]) -> Any:
        """Evaluate several expressions, and combine the parts to one: their keys."""
        parts = list(map(self.evaluate, expressions))
        return parts[0] if len(parts) == 1 else self.zip(parts)

    def join(
        self, keys: Iterable[Key], index: Mapping[Key, Sequence[int]], columns: Mapping[str, Sequence[Value]]
    ) -> None:
        """Combine each binding with the rows that an index has for its key.

        Args:
            columns: variable -> its value in each row.

        Raises:
            TooLargeError: there are more than `MAX_BINDINGS`.
        """
        matches = list(map(index.get, keys, repeat(())))
        counts = list(map(len, matches))
        self.count = sum(counts)
        self.check_count(self.count, f"bindings of {len(self.columns) + len(columns)} variables")
        for name, column in self.columns.items():
            self.columns[name] = list(chain.from_iterable(map(repeat, column, counts)))
        rows = list(chain.from_iterable(matches))
        for name, values in columns.items():
            self.columns[name] = list(map(values.__getitem__, rows))

    def check_count(self, count: int, kind: str) -> None:
        """Check that a statement does not become too large; raise TooLargeError."""
        if count > MAX_BINDINGS:
            raise TooLargeError(f"{self.at}: {count} {kind}; expected at most {MAX_BINDINGS}")

    def filter(self, kept: Iterable[bool]) -> None:
        """Keep the bindings for which a test is true."""
        selectors = list(kept)
        if not all(selectors):
            for name, column in self.columns.items():
                self.columns[name] = list(compress(column, selectors))
            self.count = sum(selectors)


def _divide(dividend: int, divisor: int, operator: str, at: Place) -> int:
    if divisor == 0:
        raise SourceIssue(at, "cannot be grounded: division by zero")
    return divide(dividend, divisor, operator)

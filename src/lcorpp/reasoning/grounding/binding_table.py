"""Tables of bindings: for each variable of a statement a column with its value in each binding.

An operation works on whole columns: a join with a sort or an index lengthens them, a test shortens them, and
an expression is evaluated for all bindings at once. The bindings are in the order of nested loops.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, compress, repeat
from operator import add, mul, sub
from typing import Any, TypeAlias, TypeVar

from lcorpp.errors import TooLargeError
from lcorpp.reasoning.language.arithmetic import Value, as_value, canonical_text, divide, iter_variables
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.syntax import Expression, Number, Term, Variable

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

MAX_BINDINGS = 4_000_000
"""Maximal number of bindings of a statement before all conditions are tested."""

Part: TypeAlias = _Item | list[_Item]
"""A value that all bindings share, or a column."""

Index = Mapping[tuple[Value, ...], Sequence[tuple[Value, ...]]]

_OPERATIONS = {"+": add, "-": sub, "*": mul}


class BindingTable:
    """The bindings of variables; without variables there is one, the empty binding.

    at: the place of the statement.
    count: the number of bindings.
    columns: variable -> its value in each binding.
    """

    def __init__(
        self, at: Place, variables: Sequence[str] = (), bindings: Sequence[tuple[Value, ...]] = ((),)
    ) -> None:
        self.at, self.count = at, len(bindings)
        columns = zip(*bindings, strict=True) if bindings else repeat((), len(variables))
        self.columns: dict[str, list[Value]] = dict(zip(variables, map(list, columns), strict=True))

    @property
    def is_ground(self) -> bool:
        """Whether there is one binding, of no variable."""
        return not self.columns and self.count == 1

    def list_rows(self, parts: Iterable[Any]) -> list[tuple[Any, ...]]:
        """List the values of some parts in each binding."""
        columns = [self.iterate(part) for part in parts]
        return list(zip(*columns, strict=True)) if columns else [()] * self.count

    def iterate(self, part: Any) -> Iterable[Any]:
        """Iterate over the values of a part in all bindings."""
        return part if isinstance(part, list) else repeat(part, self.count)

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
            rows = self.list_rows(map(self.evaluate, expression.arguments))
            return [f"{expression.name}({','.join(map(str, row))})" for row in rows]
        left, right = (self.iterate(self.evaluate(side)) for side in (expression.left, expression.right))
        if expression.operator in ("/", "mod"):
            return list(map(_divide, left, right, repeat(expression.operator), repeat(expression.at)))
        return list(map(_OPERATIONS[expression.operator], left, right))

    def look_up(
        self, results: dict[_Item, _Result], keys: Part[_Item], compute: Callable[[_Item], _Result]
    ) -> Part[_Result]:
        """Look up the results for keys, and compute those that are missing."""
        for key in dict.fromkeys(keys) if isinstance(keys, list) else (keys,):
            if key not in results:
                results[key] = compute(key)
        return list(map(results.__getitem__, keys)) if isinstance(keys, list) else results[keys]

    def bind(self, name: str, part: Part[Value]) -> None:
        """Bind a variable in each binding."""
        self.columns[name] = list(self.iterate(part))

    def bind_all(self, name: str, domain: Sequence[Value]) -> None:
        """Combine each binding with each value of a variable."""
        self._repeat([len(domain)] * self.count)
        self.columns[name] = [*domain] * (self.count // len(domain) if domain else 0)

    def bind_matches(self, names: Sequence[str], index: Index, keys: Iterable[tuple[Value, ...]]) -> None:
        """Combine each binding with the values of variables that an index has for the binding's key."""
        matches = list(map(index.get, keys, repeat(())))
        self._repeat(list(map(len, matches)))
        rows = list(chain.from_iterable(matches))
        columns = zip(*rows, strict=True) if rows else repeat((), len(names))
        self.columns.update(zip(names, map(list, columns), strict=True))

    def _repeat(self, counts: Sequence[int]) -> None:
        if sum(counts) > MAX_BINDINGS:
            raise TooLargeError(
                f"{self.at}: {sum(counts)} bindings of {len(self.columns) + 1} variables to test;"
                f" expected at most {MAX_BINDINGS}"
            )
        for name, column in self.columns.items():
            self.columns[name] = list(chain.from_iterable(map(repeat, column, counts)))
        self.count = sum(counts)

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

"""A Python function that is generated line by line: constants, loops, and the source of expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from lcorpp.reasoning.language.arithmetic import (
    Value,
    as_value,
    canonical_text,
    compare_values,
    divide,
    iter_variables,
)
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.syntax import Expression, Number, Term, Variable

_Key = TypeVar("_Key")
_Result = TypeVar("_Result")


class Source(str):
    """Python source of an expression."""

    __slots__ = ()


Part = Source | Value
"""A value known now, or the source that computes it for each binding."""


class GeneratedFunction:
    """Collects the lines of a function; variable ``X`` of the program is ``v_X`` in the source.

    Args:
        arguments: the variables that are arguments of the function.
    """

    def __init__(self, arguments: Sequence[str]) -> None:
        self._arguments = tuple(arguments)
        self._lines: list[str] = []
        self._depth = 1
        self._constants: dict[str, Any] = {"divide": _divide, "compare_values": compare_values}
        self._n_names = 0

    @property
    def is_ground(self) -> bool:
        """Whether the statement has exactly one instance and no condition to test."""
        return not self._lines and not self._arguments

    def add_line(self, line: str) -> None:
        """Append a line to the innermost loop: it runs once for each binding."""
        self._lines.append(" " * self._depth + line)

    def open_loop(self, targets: str, iterable: str) -> None:
        """Append the head of a loop; later lines are inside of it."""
        self.add_line(f"for {targets} in {iterable}:")
        self._depth += 1

    def add_lookup(
        self, results: dict[_Key, _Result], key: str, compute: Callable[[_Key], _Result]
    ) -> Source:
        """Append lines that look up the result for a key (Python source), and compute it if it is missing.

        Returns:
            The variable with the result.
        """
        name, table = self._make_name(), self.name_constant(results)
        self.add_line(f"{name} = {self.name_constant(results.get)}(k := {key})")
        self.add_line(f"if {name} is None: {name} = {table}[k] = {self.name_constant(compute)}(k)")
        return name

    def name_constant(self, value: object) -> Source:
        """Make a value available to the generated function; return its name."""
        name = self._make_name()
        self._constants[name] = value
        return name

    def _make_name(self) -> Source:
        self._n_names += 1
        return Source(f"k{self._n_names}")

    def translate(self, expression: Expression) -> Part:
        """Return the value of an expression, or the source that computes it from bound variables."""
        if isinstance(expression, Variable):
            return Source(f"v_{expression.name}")
        if isinstance(expression, Number) or not any(iter_variables(expression)):
            return as_value(canonical_text(expression))
        if isinstance(expression, Term):
            inner = " + ',' + ".join(
                f"str({self.write_source(argument)})" for argument in expression.arguments
            )
            return Source(f"({expression.name + '('!r} + {inner} + ')')")
        left, right = self.write_source(expression.left), self.write_source(expression.right)
        if expression.operator in ("/", "mod"):
            place = self.name_constant(expression.at)
            return Source(f"divide({left}, {right}, {expression.operator!r}, {place})")
        return Source(f"({left} {expression.operator} {right})")

    def quote(self, part: Part) -> str:
        """Return the source of a part."""
        if isinstance(part, int) and part.bit_length() > 64:  # a mask of many values
            return self.name_constant(part)
        return str(part) if isinstance(part, Source) else repr(part)

    def write_source(self, expression: Expression) -> str:
        """Write the source that computes an expression from bound variables."""
        return self.quote(self.translate(expression))

    def compile(self, **names: object) -> Callable[..., None]:
        """Compile the function.

        Args:
            names: the values of the other names in the added lines.
        """
        arguments = ", ".join(f"v_{name}" for name in self._arguments)
        text = "\n".join([f"def run({arguments}):", *self._lines, " pass"])
        namespace: dict[str, Any] = {**self._constants, **names}
        exec(compile(text, "<instantiator>", "exec"), namespace)
        return namespace["run"]  # type: ignore[no-any-return]


def _divide(dividend: int, divisor: int, operator: str, at: Place) -> int:
    if divisor == 0:
        raise SourceIssue(at, "cannot be grounded: division by zero")
    return divide(dividend, divisor, operator)

"""A Python function that is generated line by line: constants, loops, and the source of expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from lcorpp.reasoning.grounding.values import Value, compare_values, divide, parse_value
from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.syntax import Expression, Number, Term, Variable


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
        self._constants: dict[str, Any] = {"divide": divide, "compare_values": compare_values}

    @property
    def is_ground(self) -> bool:
        """Whether the statement has exactly one instance and no condition to test."""
        return not self._lines and not self._arguments

    def add_line(self, line: str) -> None:
        """Append a line to the innermost loop: it runs once for each binding."""
        self._lines.append(" " * self._depth + line)

    def name_constant(self, value: object) -> Source:
        """Make a value available to the generated function; return its name."""
        name = f"k{len(self._constants)}"
        self._constants[name] = value
        return Source(name)

    def translate(self, expression: Expression) -> Part:
        """Return the value of an expression, or the source that computes it from bound variables."""
        if isinstance(expression, Variable):
            return Source(f"v_{expression.name}")
        if isinstance(expression, Number) or not any(iter_variables(expression)):
            return parse_value(canonical_text(expression))
        if isinstance(expression, Term):
            inner = " + ',' + ".join(
                f"str({self._write_source(argument)})" for argument in expression.arguments
            )
            return Source(f"({expression.name + '('!r} + {inner} + ')')")
        left, right = self._write_source(expression.left), self._write_source(expression.right)
        if expression.operator in ("/", "mod"):
            place = self.name_constant(expression.at)
            return Source(f"divide({left}, {right}, {expression.operator!r}, {place})")
        return Source(f"({left} {expression.operator} {right})")

    def quote(self, part: Part) -> str:
        """Return the source of a part."""
        if isinstance(part, int) and part.bit_length() > 64:  # a mask of many values
            return self.name_constant(part)
        return str(part) if isinstance(part, Source) else repr(part)

    def compile(self, **names: object) -> Callable[..., None]:
        """Compile the function; its arguments are the `bound` variables.

        Args:
            names: the values of the other names in the added lines.
        """
        arguments = ", ".join(f"v_{name}" for name in self._arguments)
        text = "\n".join([f"def run({arguments}):", *self._lines, " pass"])
        namespace: dict[str, Any] = {**self._constants, **names}
        exec(compile(text, "<instantiator>", "exec"), namespace)
        return namespace["run"]  # type: ignore[no-any-return]

    def _write_source(self, expression: Expression) -> str:
        """Write the source that computes an expression from bound variables."""
        return self.quote(self.translate(expression))

    # conditions on the variables

    def _open_loop(self, targets: str, iterable: str) -> None:
        """Append the head of a loop; later lines are inside of it."""
        self.add_line(f"for {targets} in {iterable}:")
        self._depth += 1

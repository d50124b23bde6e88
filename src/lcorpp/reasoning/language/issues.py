"""Places in a program text, and the issues found there.

A `SourceIssue` is internal: `Program` converts it to ProgramError, the parser to ParseError.
"""

from __future__ import annotations

from typing import NamedTuple


class Place(NamedTuple):
    """A place in a text: file, line and column, the last two counted from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


SYNTHETIC_PLACE = Place("<made>", 1, 1)
"""The place of nodes that do not come from a text."""


class SourceIssue(Exception):
    """An error at a place of a program text."""

    def __init__(self, at: Place, message: str) -> None:
        self.at, self.message = at, message
        super().__init__(f"{at}: {message}")


class SortMismatch(SourceIssue):
    """A contradiction to a declaration: a constant outside of its sort, or a wrong number of arguments."""


class ReasoningWarning(UserWarning):
    """An answer is an estimate, or rounded numbers of the program were adjusted.

    Examples:
        >>> import warnings
        >>> from lcorpp.reasoning import Reasoner, ReasoningWarning, parse_plog
        >>> program = parse_plog("s = {u, v}. a : s. random(a). pr(a=u) = 0.33333. pr(a=v) = 0.66666.")
        >>> with warnings.catch_warnings(record=True) as issued:
        ...     warnings.simplefilter("always", ReasoningWarning)
        ...     _ = Reasoner(program).posterior("a")
        >>> print(issued[0].message)
        <text>:1:31: the probabilities of a sum to 0.99999, not 1, and are divided by their sum
    """

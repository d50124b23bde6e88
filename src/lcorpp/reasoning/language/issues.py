"""A fault found in a syntax tree, on its way to the error type of whoever reads the tree."""

from __future__ import annotations

from lcorpp.reasoning.language.syntax import Place


class SourceIssue(Exception):
    """Never leaves the room: a program turns it into ProgramError, the parser into ParseError."""

    def __init__(self, at: Place, message: str) -> None:
        self.at, self.message = at, message
        super().__init__(f"{at}: {message}")


class SortMismatch(SourceIssue):
    """What does not fit its declaration: a constant outside of its sort, a wrong number of arguments."""

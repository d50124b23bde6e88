"""Every error that lcorpp raises on purpose: one tree, so that one `except LcorppError` catches all.

Bad input is told by where it is, what is wrong and what was expected.
"""

from __future__ import annotations

from collections.abc import Sequence


class LcorppError(Exception):
    """Root of all errors of this package."""


class FileError(LcorppError):
    """A file that cannot be read or written: missing, a folder, no permission, not text."""


class ParseError(LcorppError):
    """Text that does not follow its format.

    Attributes:
        file: name of the file, or ``<text>`` when there is none.
        line, column: place of the issue, both counted from 1.
        message: what is wrong and what was expected.
        text: the offending line, shown under the message with a caret.
    """

    def __init__(self, file: str, line: int, column: int, message: str, text: str = "") -> None:
        self.file, self.line, self.column, self.message, self.text = file, line, column, message, text
        super().__init__(file, line, column, message, text)

    def __str__(self) -> str:
        message = (
            self.message if len(self.message) <= 1000 else f"{self.message[:600]} ... {self.message[-300:]}"
        )
        head = f"{self.file}:{self.line}:{self.column}: {message}"
        if not self.text.strip():
            return head
        start = max(0, self.column - 61)  # a long line is shown around the caret
        shown = self.text.rstrip("\r\n")[start : start + 120].replace("\t", " ")
        return f"{head}\n    {shown}\n    {' ' * (self.column - 1 - start)}^"


class ModelError(LcorppError):
    """A POMDP, belief or other value that breaks its own law (sums, shapes, ranges)."""


class ProgramError(LcorppError):
    """A P-log program that parses but breaks a condition of the language."""


class TooLargeError(ProgramError):
    """A P-log program with more states than can be compiled."""


class UndefinedError(LcorppError):
    """A P-log query without an answer: no possible world satisfies the evidence."""


class ObservationError(LcorppError):
    """An observation that has probability zero under the belief and the action taken."""


class PolicyError(LcorppError):
    """A policy file that is malformed or belongs to another model."""


class DataError(LcorppError):
    """Data a classifier cannot be trained on, or a stored classifier that cannot be used."""


class DomainError(LcorppError):
    """A domain folder whose files do not fit together."""


class DecisionError(LcorppError):
    """A decision that cannot be brought to its end, e.g. a policy that never reports."""


def expected(names: Sequence[str], limit: int = 12) -> str:
    """`names` as the end of a message: ``expected one of a, b, c``."""
    shown = ", ".join(str(name) for name in names[:limit])
    more = f", ... ({len(names)} in all)" if len(names) > limit else ""
    return f"expected one of {shown}{more}" if names else "none is known"

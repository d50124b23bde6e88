"""Exceptions: one tree, so that `except LcorppError` catches every error that lcorpp raises on purpose.

Messages about bad input state the place, the fault and what was expected.
"""

from __future__ import annotations

import reprlib
from collections.abc import Collection
from itertools import islice


class LcorppError(Exception):
    """Root of all exceptions of this package.

    Examples:
        >>> from lcorpp import LcorppError, parse_plog
        >>> try:
        ...     parse_plog("colours = {red, green}. colour : colors.")
        ... except LcorppError as error:
        ...     print(error)
        <text>:1:25: unknown sort 'colors'; expected one of boolean, colours
    """


class FileError(LcorppError):
    """A file that cannot be read or written: missing, a folder, no permission, not text."""


class MissingPackageError(LcorppError, ImportError):
    """An optional package that a name of lcorpp needs and that is not installed."""


class ParseError(LcorppError):
    """Text that violates its format.

    Attributes:
        file: name of the file, or ``<text>`` without one.
        line, column: place of the error, both counted from 1.
        message: the fault and what was expected.
        text: the offending line; the message shows it with a caret below.
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
        start = max(0, self.column - 61)  # a long line is cut around the caret
        shown = self.text.rstrip("\r\n")[start : start + 120]
        excerpt = "".join(character if character.isprintable() else " " for character in shown)
        return f"{head}\n    {excerpt}\n    {' ' * (self.column - 1 - start)}^"


class ModelError(LcorppError):
    """A POMDP, belief or other value that violates its invariants (sums, shapes, ranges)."""


class InfeasibleError(ModelError):
    """Limits that no policy keeps, or for which none was found in time."""


class ProgramError(LcorppError):
    """A P-log program that parses but violates a condition of the language."""


class NoValueError(ProgramError):
    """An attribute of a P-log program has no value in some possible worlds, so it has no distribution."""


class TooLargeError(ProgramError):
    """A P-log program is too large: its decision diagram would fill the memory, or it has too many worlds."""


class UndefinedError(LcorppError):
    """A P-log query without an answer: no possible world satisfies the evidence."""


class ObservationError(LcorppError):
    """An observation with probability zero under the belief and the action taken."""


class PolicyError(LcorppError):
    """A policy file that is malformed or belongs to another model."""


class DataError(LcorppError):
    """Data unfit for training, or a stored classifier that cannot be used."""


class DomainError(LcorppError):
    """A domain folder whose files do not fit together, or a request that does not fit the domain."""


class DecisionError(LcorppError):
    """A decision that cannot be completed, e.g. because a part of the robot is wrong."""


class NoReportError(DecisionError):
    """A decision in which the policy never reports a value."""


class WorldError(LcorppError):
    """An action that a world has not completed; a robot is then ordered to stop."""


class ActionFailedError(WorldError):
    """An action that was refused, aborted, or not completed within its time-out."""


class PersonLeftError(WorldError):
    """A person who left before the decision about them was made."""


class ConnectionLostError(WorldError):
    """A connection to a robot that cannot be made, or that was lost."""


class WorkerError(LcorppError):
    """Worker processes that end before their work is done, or a cluster that cannot be reached."""


def expected_one_of(names: Collection[str], limit: int = 12) -> str:
    """Return the end of a message: ``expected one of a, b, c``, with at most `limit` names."""
    listed = ", ".join(str(name) for name in islice(names, limit))
    more = f", ... ({len(names)} in all)" if len(names) > limit else ""
    return f"expected one of {listed}{more}" if names else "none is known"


def check_type(value: object, expected: type | tuple[type, ...], what: str, error: type[LcorppError]) -> None:
    """Raise `error` if an argument has another type; `what` describes the argument in the message.

    True and False are not integers here.
    """
    kinds = expected if isinstance(expected, tuple) else (expected,)
    if not isinstance(value, expected) or (isinstance(value, bool) and bool not in kinds):
        names = " or ".join(kind.__name__ for kind in kinds if kind is not type(None))
        raise error(f"{what} is {reprlib.repr(value)}; expected {names}")

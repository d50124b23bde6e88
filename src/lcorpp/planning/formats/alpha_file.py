"""A. Cassandra's alpha files: for each vector a line with its action, a line of numbers and an empty line.

Format: the .alpha files of pomdp-solve (http://pomdp.org/code/alpha-file-spec.html). They name neither their
model nor its states, so the numbers are all that can be checked.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lcorpp.errors import PolicyError
from lcorpp.files import read_text, write_atomically
from lcorpp.planning.formats.numbers import finite_numbers, first_fault, is_count
from lcorpp.planning.formats.vector_lines import vector_lines
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

_LINE_END = re.compile(r"\r\n|\r|\n")


def write_alphas(policy: Policy, path: str | Path) -> None:
    """Write the vectors with all their digits: reading them gives the same bit for bit.

    Raises:
        FileError: the file cannot be written.
        PolicyError: the policy is in pieces and would grow too large.
    """
    write_atomically(path, "".join(f"{action}\n{line}\n\n" for action, line in vector_lines(policy)))


def read_alphas(path: str | Path, pomdp: Pomdp) -> Policy:
    """Read the alpha vectors of a policy for `pomdp`.

    A vector may take several lines; an empty line ends it, and there may be none between vectors.

    Raises:
        FileError: the file cannot be read.
        PolicyError: it is malformed or belongs to another model; file, line and column are told.
    """
    reader = _Reader(str(path), pomdp)
    for number, line in enumerate(_LINE_END.split(read_text(path)), start=1):
        reader.read(line, number)
    return reader.policy()


class _Reader:
    """Takes one line after the other: an action, then numbers until there is one for each state."""

    def __init__(self, file: str, pomdp: Pomdp) -> None:
        self.file, self.pomdp = file, pomdp
        self.actions: list[int] = []
        self.vectors: list[Array] = []
        self.parts: list[Array] | None = None  # of the vector whose action has been read
        self.held = 0  # how many numbers they have
        self.begun = 0  # the line of that action

    def read(self, text: str, line: int) -> None:
        if not text.strip():
            if self.parts:
                raise self._wrong_length(self.begun)
        elif self.parts is None:
            self._action(text, line)
        else:
            self._numbers(text, line)

    def policy(self) -> Policy:
        if self.parts is not None:
            raise self._wrong_length(self.begun)
        if not self.vectors:
            raise PolicyError(f"{self.file}:1:1: there is no alpha vector in it")
        return Policy.of(self.pomdp, np.array(self.vectors), self.actions)

    def _action(self, text: str, line: int) -> None:
        word, column = text.strip(), len(text) - len(text.lstrip()) + 1
        if not is_count(word):
            raise self._error(line, column, f"expected the number of an action, found {word[:40]!r}")
        count = len(self.pomdp.actions)
        if len(word) > 9 or int(word) >= count:
            raise self._error(
                line,
                column,
                f"these vectors are for another model: action {word[:40]} is not among its {count} actions,"
                " counted from 0",
            )
        self.actions.append(int(word))
        self.parts, self.held, self.begun = [], 0, line

    def _numbers(self, text: str, line: int) -> None:
        assert self.parts is not None
        numbers = finite_numbers(text)
        if numbers is None:
            words = text.split()
            index, message = first_fault(words)
            raise self._error(line, _column(text, index), message)
        self.parts.append(numbers)
        self.held += len(numbers)
        if self.held > len(self.pomdp.states):
            raise self._wrong_length(line)
        if self.held == len(self.pomdp.states):
            self.vectors.append(np.concatenate(self.parts))
            self.parts = None

    def _wrong_length(self, line: int) -> PolicyError:
        return self._error(
            line,
            1,
            f"these vectors are for another model: the one that begins in line {self.begun} has {self.held}"
            f" numbers, the model has {len(self.pomdp.states)} states",
        )

    def _error(self, line: int, column: int, message: str) -> PolicyError:
        return PolicyError(f"{self.file}:{line}:{column}: {message}")


def _column(text: str, index: int) -> int:
    """Where a word of a line begins, counted from 1."""
    at = 0
    for word in text.split()[: index + 1]:
        at = text.index(word, at) + len(word)
    return at - len(word) + 1

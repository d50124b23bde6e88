"""A. Cassandra's .alpha files: for each vector a line with its action, a line of numbers and an empty line.

Format: the .alpha files of pomdp-solve (http://pomdp.org/code/alpha-file-spec.html). They name neither the
model nor its states, so only the numbers can be checked.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lcorpp.errors import PolicyError
from lcorpp.files import read_text, write_atomically
from lcorpp.planning.formats.numbers import find_invalid_number, is_count, parse_numbers
from lcorpp.planning.formats.vector_lines import format_vectors
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

MAX_ACTION_DIGITS = 9
"""Longest number of an action; a longer one exceeds the actions of any model that fits into memory."""

_LINE_END = re.compile(r"\r\n|\r|\n")


def write_alphas(policy: Policy, path: str | Path) -> None:
    """Write the alpha vectors with all digits: reading them back gives the same bits.

    Raises:
        FileError: the file cannot be written.
        PolicyError: the policy has several vector sets (`AlphaVectors`), each over a part of the states, and
            would become too large as vectors over all states.
    """
    write_atomically(path, "".join(f"{action}\n{line}\n\n" for action, line in format_vectors(policy)))


def read_alphas(path: str | Path, pomdp: Pomdp) -> Policy:
    """Read the alpha vectors of a policy for `pomdp`.

    A vector may span several lines; an empty line ends it but may be missing.

    Raises:
        FileError: the file cannot be read.
        PolicyError: the file is malformed or belongs to another model; the message has file, line and column.
    """
    reader = _Reader(str(path), pomdp)
    for number, line in enumerate(_LINE_END.split(read_text(path)), start=1):
        reader.read_line(line, number)
    return reader.make_policy()


class _Reader:
    """Reads line by line: an action, then numbers until there is one for each state."""

    def __init__(self, file: str, pomdp: Pomdp) -> None:
        self.file, self.pomdp = file, pomdp
        self.actions: list[int] = []
        self.vectors: list[Array] = []
        self.parts: list[Array] | None = None  # lines of the current vector; None before its action
        self.length = 0  # how many numbers `parts` contains
        self.first_line = 0  # line of the current vector's action

    def read_line(self, text: str, line: int) -> None:
        """Read one line, numbered from 1."""
        if not text.strip():
            # empty lines between an action and its first number are allowed
            if self.parts:
                raise self._make_length_error(self.first_line)
        elif self.parts is None:
            self._read_action(text, line)
        else:
            self._read_numbers(text, line)

    def make_policy(self) -> Policy:
        """Return the policy after the last line."""
        if self.parts is not None:
            raise self._make_length_error(self.first_line)
        if not self.vectors:
            raise PolicyError(f"{self.file}:1:1: the file contains no alpha vector")
        return Policy.of(self.pomdp, np.array(self.vectors), self.actions)

    def _read_action(self, text: str, line: int) -> None:
        word, column = text.strip(), len(text) - len(text.lstrip()) + 1
        if not is_count(word):
            raise self._make_error(line, column, f"expected the number of an action, found {word[:40]!r}")
        count = len(self.pomdp.actions)
        # check the length first: int() refuses more than 4300 digits
        if len(word) > MAX_ACTION_DIGITS or int(word) >= count:
            raise self._make_error(
                line,
                column,
                f"these vectors are for another model: action {word[:40]} is not among its {count} actions,"
                " counted from 0",
            )
        self.actions.append(int(word))
        self.parts, self.length, self.first_line = [], 0, line

    def _read_numbers(self, text: str, line: int) -> None:
        assert self.parts is not None
        numbers = parse_numbers(text)
        if numbers is None:
            index, message = find_invalid_number(text.split())
            raise self._make_error(line, _find_column(text, index), message)
        self.parts.append(numbers)
        self.length += len(numbers)
        if self.length > len(self.pomdp.states):
            raise self._make_length_error(line)
        if self.length == len(self.pomdp.states):
            self.vectors.append(np.concatenate(self.parts))
            self.parts = None

    def _make_length_error(self, line: int) -> PolicyError:
        return self._make_error(
            line,
            1,
            f"these vectors are for another model: the one that begins in line {self.first_line} has"
            f" {self.length} numbers, the model has {len(self.pomdp.states)} states",
        )

    def _make_error(self, line: int, column: int, message: str) -> PolicyError:
        return PolicyError(f"{self.file}:{line}:{column}: {message}")


def _find_column(text: str, index: int) -> int:
    """Return the column of the word `index` of a line, counted from 1."""
    at = 0
    for word in text.split()[: index + 1]:
        at = text.index(word, at) + len(word)
    return at - len(word) + 1

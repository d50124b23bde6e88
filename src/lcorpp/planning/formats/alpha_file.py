"""A. Cassandra's .alpha files: for each vector a line with its action, a line of numbers and an empty line.

Format: the .alpha files of pomdp-solve (http://pomdp.org/code/alpha-file-spec.html). They name neither the
model nor its states, so only the numbers can be checked.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from lcorpp.errors import PolicyError
from lcorpp.files import open_atomically, read_text
from lcorpp.planning.evaluation.claims import check_claims
from lcorpp.planning.formats.memory import report_full_memory
from lcorpp.planning.formats.numbers import find_invalid_number, is_count, parse_numbers
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

MAX_ACTION_DIGITS = 9
"""Longest number of an action; a longer one exceeds the actions of any model that fits into memory."""

MAX_FILE_BYTES = 2**32
"""Maximum size of a file that is read."""

MAX_BYTES = 200_000_000
"""Maximum estimated size of a policy with several vector sets when it is written over all states."""

NUMBER_LENGTH = 19
"""Approximate length of a number with all its digits and a space."""

_LINE_END = re.compile(r"\r\n|\r|\n")


def write_alphas(policy: Policy, path: str | Path) -> None:
    """Write the alpha vectors with all digits: reading them back gives the same bits.

    Raises:
        FileError: the file cannot be written.
        PolicyError: the policy has several vector sets (`AlphaVectors`), each over a part of the states, and
            would become too large as vectors over all states.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import Policy, write_alphas
        >>> write_alphas(Policy.of(load_domain("intention").pomdp, [[5, 4, 3, 2, 0]], [1]), "greet.alpha")
        >>> Path("greet.alpha").read_text().split()  # the action, and a value for each state
        ['1', '5.0', '4.0', '3.0', '2.0', '0.0']
    """
    with open_atomically(path) as file:  # vector by vector: the text may take more memory than the policy
        file.writelines(f"{action}\n{line}\n\n".encode() for action, line in format_vectors(policy))


def format_vectors(policy: Policy) -> Iterator[tuple[int, str]]:
    """Yield the action and the numbers of each vector, with all digits.

    States outside a vector's set get the floor of the policy. The size is limited only in that case.

    Raises:
        PolicyError: the policy has several vector sets and would become too large over all states.
    """
    size = estimate_bytes(policy)
    if not policy.covers_all_states and size > MAX_BYTES:
        raise PolicyError(
            f"this policy has {len(policy.vector_sets)} vector sets; its {len(policy)} vectors over"
            f" all {len(policy.state_names)} states take about {size / 1e6:.0f} MB;"
            f" at most {MAX_BYTES / 1e6:.0f} MB are written"
        )
    floor = repr(policy.floor)
    for part in policy.vector_sets:
        states = part.states.tolist()
        for action, vector in zip(part.actions.tolist(), map(np.ndarray.tolist, part.vectors), strict=True):
            if len(states) == len(policy.state_names):
                yield action, " ".join(map(repr, vector))
                continue
            words = [floor] * len(policy.state_names)
            for state, value in zip(states, vector, strict=True):
                words[state] = repr(value)
            yield action, " ".join(words)


def estimate_bytes(policy: Policy) -> int:
    """Return the approximate size in bytes of the policy's vectors over all states."""
    S, filler = len(policy.state_names), len(repr(policy.floor)) + 1
    return sum(
        len(part.actions) * (len(part.states) * NUMBER_LENGTH + (S - len(part.states)) * filler)
        for part in policy.vector_sets
    )


def read_alphas(path: str | Path, pomdp: Pomdp) -> Policy:
    """Read the alpha vectors of a policy for `pomdp`.

    A vector may span several lines; an empty line ends it but may be missing.

    Raises:
        FileError: the file cannot be read.
        PolicyError: the file is malformed or belongs to another model; the message has file, line and column.
            Or it promises a value that no policy has, for any number of steps.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import Policy, read_alphas, write_alphas
        >>> pomdp = load_domain("intention").pomdp
        >>> write_alphas(Policy.of(pomdp, [[5, 4, 3, 2, 0]], [1]), "greet.alpha")
        >>> read_alphas("greet.alpha", pomdp).value(pomdp.start)
        4.5
    """
    with report_full_memory(path):
        return _read_alphas(path, pomdp)


def _read_alphas(path: str | Path, pomdp: Pomdp) -> Policy:
    S, A = len(pomdp.states), len(pomdp.actions)
    actions: list[int] = []
    vectors: list[Array] = []
    parts: list[Array] = []  # the lines of the current vector
    length = 0  # how many numbers they contain
    begin = 0  # line of the current vector's action; 0 before it

    def make_error(line: int, column: int, message: str) -> PolicyError:
        return PolicyError(f"{path}:{line}:{column}: {message}")

    def make_length_error(line: int) -> PolicyError:
        message = f"the one that begins in line {begin} has {length} numbers, the model has {S} states"
        return make_error(line, 1, f"these vectors are for another model: {message}")

    for line, text in enumerate(_LINE_END.split(read_text(path, MAX_FILE_BYTES)), start=1):
        word = text.strip()
        if not word:
            # empty lines between an action and its first number are allowed
            if length:
                raise make_length_error(begin)
        elif not begin:
            if not is_count(word):
                message = f"expected the number of an action, found {word[:40]!r}"
                raise make_error(line, _find_column(text, 0), message)
            # check the length first: int() refuses more than 4300 digits
            if len(word) > MAX_ACTION_DIGITS or int(word) >= A:
                message = f"action {word[:40]} is not among its {A} actions, counted from 0"
                message = f"these vectors are for another model: {message}"
                raise make_error(line, _find_column(text, 0), message)
            actions.append(int(word))
            begin = line
        else:
            numbers = parse_numbers(text)
            if numbers is None:
                index, message = find_invalid_number(text.split())
                raise make_error(line, _find_column(text, index), message)
            parts.append(numbers)
            length += len(numbers)
            if length > S:
                raise make_length_error(line)
            if length == S:
                vectors.append(np.concatenate(parts))
                parts, length, begin = [], 0, 0
    if begin:
        raise make_length_error(begin)
    if not vectors:
        raise make_error(1, 1, "the file contains no alpha vector")
    policy = Policy.of(pomdp, np.array(vectors), actions)
    check_claims(pomdp, policy, str(path), finite=True)  # pomdp-solve writes finite horizons, too
    return policy


def _find_column(text: str, index: int) -> int:
    """Return the column of the word `index` of a line, counted from 1."""
    return next(islice(re.finditer(r"\S+", text), index, None)).start() + 1

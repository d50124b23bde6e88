"""APPL's policy XML: reads files made by APPL, and writes files that APPL's tools read.

Format: the files of APPL (https://github.com/AdaCompNUS/sarsop). A `Vector` contains S numbers, a
`SparseVector` has entries of a state's index and a value. Files written by lcorpp also have comments, which
other readers ignore: the model's fingerprint, and the number of remaining steps if the horizon is finite. A
policy with several vector sets that would become too large over all states is written set by set, as APPL
writes the policy of a factored model; another comment lists the states of each set.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcorpp.errors import PolicyError
from lcorpp.files import open_atomically, read_bytes
from lcorpp.planning.evaluation.claims import check_claims
from lcorpp.planning.formats.alpha_file import MAX_BYTES, estimate_bytes, format_vectors
from lcorpp.planning.formats.memory import report_full_memory
from lcorpp.planning.formats.numbers import find_invalid_number, is_count, parse_numbers
from lcorpp.planning.formats.xml import XmlReader
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Indices

MAX_DEPTH = 9
"""Maximum nesting of elements; APPL's files have four levels."""

_VECTORS = ("Vector", "SparseVector")
_STATE_SETS = re.compile(r"\s*lcorpp pieces ([0-9]{1,9}(?:[-, ][0-9]{1,9})*)\s*")
_HORIZON = re.compile(r"\s*lcorpp horizon ([0-9]{1,9})\s*")
_FINGERPRINT = re.compile(r"\s*lcorpp model sha256 ([0-9a-f]{64})\s*")


def write_policy(policy: Policy, path: str | Path) -> None:
    """Write a policy with all digits: reading it back gives the same bits.

    If the policy has several vector sets, each vector is written over all states, with the floor of the
    policy outside its set, as APPL's tools require. Beyond 200 MB, it is written set by set; only lcorpp
    reads that.

    Raises:
        FileError: the file cannot be written.

    Examples:
        >>> from lcorpp import load_domain, read_policy, solve, write_policy
        >>> pomdp = load_domain("intention").pomdp
        >>> solution = solve(pomdp)
        >>> write_policy(solution.policy, "intention.policy")
        >>> len(read_policy("intention.policy", pomdp)) == solution.vectors
        True
    """
    with open_atomically(path) as file:  # line by line: the whole text may take more memory than the policy
        file.writelines((line + "\n").encode("ascii", "xmlcharrefreplace") for line in _format_lines(policy))


def _format_lines(policy: Policy) -> Iterator[str]:
    # XML has no control characters, not even escaped
    model = "".join(c if c.isprintable() else "?" for c in Path(policy.model or "unknown.pomdp").name)
    yield '<?xml version="1.0" encoding="ISO-8859-1"?>'
    yield f'<Policy version="0.1" type="value" model="{escape(model)}">'
    if not policy.covers_all_states and estimate_bytes(policy) > MAX_BYTES:
        state_sets = " ".join(_format_ranges(part.states) for part in policy.vector_sets)
        yield f"<!-- lcorpp pieces {state_sets} -->"
        length, count = max(len(part.states) for part in policy.vector_sets), len(policy.vector_sets)
        vectors: Iterable[tuple[int, int, str]] = (
            (number, action, " ".join(map(repr, vector)))
            for number, part in enumerate(policy.vector_sets)
            for action, vector in zip(
                part.actions.tolist(), map(np.ndarray.tolist, part.vectors), strict=True
            )
        )
    else:
        length, count = len(policy.state_names), 1
        vectors = ((0, action, numbers) for action, numbers in format_vectors(policy))
    yield f'<AlphaVector vectorLength="{length}" numObsValue="{count}" numVectors="{len(policy)}">'
    for number, action, numbers in vectors:
        # APPL writes a space after the last number of a vector; some readers drop what follows it
        yield f'<Vector action="{action}" obsValue="{number}">{numbers} </Vector>'
    yield "</AlphaVector>"
    if policy.horizon is not None:
        yield f"<!-- lcorpp horizon {policy.horizon} -->"
    if policy.fingerprint:
        yield f"<!-- lcorpp model sha256 {policy.fingerprint} -->"
    yield "</Policy>"


def _format_ranges(states: Indices) -> str:
    """Format increasing indices as ranges: 0-3,7,9-11."""
    ends = np.flatnonzero(np.diff(states) > 1)
    firsts, lasts = states[np.append(0, ends + 1)].tolist(), states[np.append(ends, len(states) - 1)].tolist()
    return ",".join(f"{a}-{b}" if a < b else f"{a}" for a, b in zip(firsts, lasts, strict=True))


def read_policy(path: str | Path, pomdp: Pomdp, *, blocks: Sequence[npt.ArrayLike] | None = None) -> Policy:
    """Read a policy for `pomdp`.

    Args:
        blocks: for each value of the fully observed variables, the indices of its states in the order of the
            values of the hidden variables. Required to read a policy that APPL made for a factored model; the
            result has one vector set for each block.

    Raises:
        FileError: the file cannot be read.
        PolicyError: the file is malformed, contains a DTD, belongs to another model, or promises a value that
            no policy of the model has.

    Examples:
        >>> from lcorpp import Planner, load_domain, read_policy, solve, write_policy
        >>> pomdp = load_domain("intention").pomdp
        >>> write_policy(solve(pomdp).policy, "intention.policy")
        >>> Planner(read_policy("intention.policy", pomdp), pomdp).action(pomdp.start)
        'move_forward'
    """
    with report_full_memory(path):
        return _PolicyReader(str(path), pomdp, blocks).read(read_bytes(path))


class _PolicyReader(XmlReader):
    """Collects the vectors.

    state_sets: states of each vector set: a single one, unless the header announces several.
    """

    def __init__(self, file: str, pomdp: Pomdp, blocks: Sequence[npt.ArrayLike] | None) -> None:
        super().__init__(root="Policy", max_depth=MAX_DEPTH, join_text=True)
        self.file, self.pomdp = file, pomdp
        self.blocks = None if blocks is None else [np.asarray(block, dtype=np.intp) for block in blocks]
        self.has_own_sets = False  # whether the file lists the states of its vector sets
        self.state_sets: list[Indices] = [np.arange(len(pomdp.states))]
        self.vectors: dict[int, list[Array]] = {}  # of each vector set
        self.actions: dict[int, list[int]] = {}
        self.current_set = 0
        self.fingerprint = ""
        self.horizon: int | None = None
        self.announced = -1  # number of vectors in the header
        self.pieces: list[str] = []  # of the current text
        self.entries: list[tuple[int, float]] = []  # of the current sparse vector

    def read(self, data: bytes) -> Policy:
        self.parse(data)
        count = sum(map(len, self.vectors.values()))
        if not count:
            raise self.error("there is no alpha vector in it")
        if self.announced not in (-1, count):
            raise self.error(f"the header announces {self.announced} vectors, found {count}")
        if self.fingerprint and self.fingerprint != self.pomdp.fingerprint:
            raise PolicyError(
                f"{self.file}: this policy is for another model: the fingerprint of its states, actions,"
                " observations, numbers and discount is not that of"
                f" {self.pomdp.file or 'the given model'}; solve again"
            )
        sets = []
        for number, vectors in sorted(self.vectors.items()):
            order = np.argsort(self.state_sets[number])
            states, actions = self.state_sets[number][order], np.array(self.actions[number])
            sets.append(AlphaVectors(states, np.array(vectors)[:, order], actions))
        policy = replace(Policy.of_sets(self.pomdp, sets), horizon=self.horizon)
        check_claims(self.pomdp, policy, self.file)
        return policy

    def make_error(self, line: int, column: int, message: str) -> PolicyError:
        return PolicyError(f"{self.file}:{line}:{column}: {message}")

    def comment(self, text: str) -> None:
        if match := _FINGERPRINT.fullmatch(text):
            self.fingerprint = match[1]
        if match := _HORIZON.fullmatch(text):
            self.horizon = int(match[1])
        match = _STATE_SETS.fullmatch(text)
        if match and not self.vectors:
            self.blocks = [self._parse_ranges(words) for words in match[1].split()]
            self.has_own_sets = True

    def _parse_ranges(self, words: str) -> Indices:
        """Return the state indices of a vector set, given as increasing ranges."""
        ends = [word.partition("-") for word in words.split(",")]
        ranges = [(int(first), int(last or first)) for first, _, last in ends]
        numbers = [number for pair in ranges for number in pair]
        if numbers != sorted(numbers) or numbers[-1] >= len(self.pomdp.states):
            raise self.error(f"expected increasing ranges of the model's state indices, found {words[:80]!r}")
        return np.concatenate([np.arange(first, last + 1) for first, last in ranges])

    def text(self, text: str) -> None:
        self.pieces.append(text)

    def start(self, name: str, attributes: dict[str, str]) -> None:
        if name in _VECTORS and any(outer in _VECTORS for outer in self.open):
            raise self.error(f"<{name}> cannot be inside another vector")
        self.pieces.clear()
        if name == "AlphaVector":
            self._read_header(attributes)
        elif name in _VECTORS:
            self._start_vector(attributes)
            self.entries.clear()

    def _read_header(self, attributes: dict[str, str]) -> None:
        if self.vectors:
            raise self.error("a second <AlphaVector> in this policy")
        values = self._count(attributes, "numObsValue", "1")
        if values == 1:
            self._check_length(attributes, len(self.pomdp.states), "states")
        elif self.blocks is None:
            raise self.error(
                f"this policy is for a factored model with {values} values of its observed"
                " variables; only policies over one set of states are read"
            )
        elif values != len(self.blocks):
            raise self.error(
                f"this policy is for another model: its observed variables have {values} values, those of the"
                f" model {len(self.blocks)}"
            )
        else:
            self.state_sets = self.blocks
            for states in () if self.has_own_sets else self.state_sets:
                self._check_length(attributes, len(states), "values of the hidden variables")
        if "numVectors" in attributes:
            self.announced = self._count(attributes, "numVectors")

    def _check_length(self, attributes: dict[str, str], length: int, what: str) -> None:
        if self._count(attributes, "vectorLength", f"{length}") != length:
            raise self.error(
                f"this policy is for another model: its vectors have {attributes['vectorLength']} numbers,"
                f" the model has {length} {what}"
            )

    def _start_vector(self, attributes: dict[str, str]) -> None:
        action = self._count(attributes, "action")
        if action >= len(self.pomdp.actions):
            raise self.error(
                f"this policy is for another model: action {action} is not among its"
                f" {len(self.pomdp.actions)} actions, counted from 0"
            )
        if self.blocks is None and attributes.get("obsValue", "0") != "0":
            raise self.error(f"obsValue {attributes['obsValue']!r} belongs to a factored model")
        self.current_set = self._count(attributes, "obsValue", "0")
        if self.current_set >= len(self.state_sets):
            raise self.error(
                f"obsValue {self.current_set} is not among the {len(self.state_sets)} values of the observed"
                " variables, counted from 0"
            )
        self.actions.setdefault(self.current_set, []).append(action)

    def end(self, name: str) -> None:
        text = "".join(self.pieces)
        self.pieces.clear()
        length = len(self.state_sets[self.current_set])
        if name == "Vector":
            vector = self._parse_numbers(text, "vector")
            if len(vector) != length:
                raise self.error(
                    f"this policy is for another model: a vector of {len(vector)} numbers,"
                    f" the model has {length} states"
                )
        elif name == "SparseVector":
            vector = np.zeros(length)
            for state, value in self.entries:
                if state >= length:
                    raise self.error(f"state {state} is not among the {length} states, counted from 0")
                vector[state] = value
        if name in _VECTORS:
            self.vectors.setdefault(self.current_set, []).append(vector)
        elif name == "Entry":
            words = text.split()
            if len(words) != 2 or not is_count(words[0]) or len(words[0]) > 9:
                raise self.error(f"an entry is a state's number and a value, not {' '.join(words)[:80]!r}")
            self.entries.append((int(words[0]), float(self._parse_numbers(words[1], "entry")[0])))

    def _count(self, attributes: dict[str, str], name: str, default: str = "") -> int:
        """Return the value of an attribute that is a whole number."""
        text = attributes.get(name, default)
        if not (is_count(text) and len(text) < 10):
            raise self.error(f"{name} must be a whole number, not {text[:40]!r}")
        return int(text)

    def _parse_numbers(self, text: str, what: str) -> Array:
        values = parse_numbers(text)
        if values is None:
            index, message = find_invalid_number(text.split())
            raise self.error(f"{message}, number {index + 1} of this {what}")
        return values

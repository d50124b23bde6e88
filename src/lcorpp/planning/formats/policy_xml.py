"""APPL's policy XML: read from any APPL-made file, written so that APPL's tools read it.

Format: the files of APPL (https://github.com/AdaCompNUS/sarsop); a `Vector` holds S numbers, a `SparseVector`
entries of a state's number and a value. What lcorpp writes also carries the fingerprint of its model, in a
comment that other readers pass over. A policy in pieces that would grow too large over all states is written
piece by piece, as APPL writes that of a factored model, with the states of each piece in another comment.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from lcorpp.errors import PolicyError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.planning.formats.numbers import finite_numbers, first_fault, is_count
from lcorpp.planning.formats.vector_lines import MAX_TEXT, vector_lines, written_out
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

_VECTORS = ("Vector", "SparseVector")
_PIECES = re.compile(r"\s*lcorpp pieces ([0-9]{1,9}(?:[-, ][0-9]{1,9})*+)\s*")
_FINGERPRINT = re.compile(r"\s*lcorpp model sha256 ([0-9a-f]{64})\s*")


def write_policy(policy: Policy, path: str | Path) -> None:
    """Write a policy with all its digits: reading it gives the same vectors bit for bit.

    Of a policy in pieces each vector is written over all states, with the floor of the policy where its piece
    does not speak, as APPL's tools want it; beyond 200 MB it is written piece by piece, which lcorpp reads.

    Raises:
        FileError: the file cannot be written.
    """
    # control characters have no place in XML, not even escaped
    model = "".join(c if c.isprintable() else "?" for c in Path(policy.model or "unknown.pomdp").name)
    lines = [
        '<?xml version="1.0" encoding="ISO-8859-1"?>',
        f'<Policy version="0.1" type="value" model="{escape(model)}">',
    ]
    # the space after the last number of a vector is APPL's; some readers drop what follows it
    if not policy.covers_all_states and written_out(policy) > MAX_TEXT:
        lines.append(
            f"<!-- lcorpp pieces {' '.join(_ranges(piece.states) for piece in policy.vector_sets)} -->"
        )
        length = max(len(piece.states) for piece in policy.vector_sets)
        lines.append(_opening(length, len(policy.vector_sets), len(policy)))
        for number, piece in enumerate(policy.vector_sets):
            for action, vector in zip(piece.actions.tolist(), piece.vectors.tolist(), strict=True):
                words = " ".join(map(repr, vector))
                lines.append(f'<Vector action="{action}" obsValue="{number}">{words} </Vector>')
    else:
        lines.append(_opening(len(policy.state_names), 1, len(policy)))
        for action, numbers in vector_lines(policy):
            lines.append(f'<Vector action="{action}" obsValue="0">{numbers} </Vector>')
    lines.append("</AlphaVector>")
    if policy.fingerprint:
        lines.append(f"<!-- lcorpp model sha256 {policy.fingerprint} -->")
    lines.append("</Policy>")
    write_atomically(path, ("\n".join(lines) + "\n").encode("ascii", "xmlcharrefreplace"))


def _opening(length: int, values: int, count: int) -> str:
    return f'<AlphaVector vectorLength="{length}" numObsValue="{values}" numVectors="{count}">'


def _ranges(states: npt.NDArray[np.intp]) -> str:
    """Rising numbers as ranges: 0-3,7,9-11."""
    ends = np.flatnonzero(np.diff(states) > 1)
    firsts, lasts = states[np.append(0, ends + 1)].tolist(), states[np.append(ends, len(states) - 1)].tolist()
    return ",".join(f"{a}-{b}" if a < b else f"{a}" for a, b in zip(firsts, lasts, strict=True))


def read_policy(path: str | Path, pomdp: Pomdp, *, blocks: Sequence[npt.ArrayLike] | None = None) -> Policy:
    """Read a policy for `pomdp`.

    Args:
        blocks: for each value of the fully observed variables the indices of its states, in the order of the
            values of the hidden ones. With them a policy that APPL made for a factored model becomes one in
            pieces; without them it is refused.

    Raises:
        FileError: the file cannot be read.
        PolicyError: it is malformed, holds a DTD, or belongs to another model.
    """
    return _Reader(str(path), pomdp, blocks).read(read_bytes(path))


class _Reader:
    """Collects vectors while expat walks through the file; a DTD is refused, so no entity is expanded."""

    def __init__(self, file: str, pomdp: Pomdp, blocks: Sequence[npt.ArrayLike] | None) -> None:
        self.file, self.pomdp = file, pomdp
        self.given = None if blocks is None else [np.asarray(block, dtype=np.intp) for block in blocks]
        self.own: list[npt.NDArray[np.intp]] = []  # the pieces that the file itself tells of
        self.blocks = [np.arange(len(pomdp.states))]  # those of this file: one, unless its header has more
        self.vectors: dict[int, list[Array]] = {}  # by the observed value
        self.actions: dict[int, list[int]] = {}
        self.observed = 0  # the observed value of the vector that is read
        self.fingerprint = ""
        self.open: list[str] = []
        self.promised = -1  # vectors that the header announces
        self.text: list[str] = []
        self.entries: list[tuple[int, float]] = []
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self.text.append
        self.parser.CommentHandler = self._comment

    def read(self, data: bytes) -> Policy:
        try:
            self.parser.Parse(data, True)
        except expat.ExpatError as error:
            place = f"{self.file}:{error.lineno}:{error.offset + 1}"
            raise PolicyError(f"{place}: not well-formed XML: {expat.errors.messages[error.code]}") from None
        except (LookupError, ValueError) as error:  # an encoding that Python or expat does not know
            raise self._error(f"cannot be decoded: {error}") from None
        count = sum(map(len, self.vectors.values()))
        if not count:
            raise self._error("there is no alpha vector in it")
        if self.promised not in (-1, count):
            raise self._error(f"{self.promised} vectors are announced, {count} are there")
        if self.fingerprint and self.fingerprint != self.pomdp.fingerprint:
            raise PolicyError(
                f"{self.file}: this policy is for another model: the fingerprint of its states, actions,"
                " observations, numbers and discount is not that of"
                f" {self.pomdp.file or 'the given model'}; solve again"
            )
        return Policy.of_sets(self.pomdp, [self._piece(value) for value in sorted(self.vectors)])

    def _piece(self, observed: int) -> AlphaVectors:
        order = np.argsort(self.blocks[observed])
        vectors = np.array(self.vectors[observed])
        return AlphaVectors(self.blocks[observed][order], vectors[:, order], np.array(self.actions[observed]))

    def _error(self, message: str) -> PolicyError:
        line, column = self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1
        return PolicyError(f"{self.file}:{line}:{column}: {message}")

    def _doctype(self, *declaration: object) -> None:
        raise self._error("a document type declaration is refused; a policy needs none")

    def _comment(self, text: str) -> None:
        match = _FINGERPRINT.fullmatch(text)
        if match:
            self.fingerprint = match.group(1)
        pieces = _PIECES.fullmatch(text)
        if pieces and not self.vectors:
            self.own = self.given = [self._states(words) for words in pieces.group(1).split()]

    def _states(self, words: str) -> npt.NDArray[np.intp]:
        """The states of a piece, written as ranges."""
        ends = [word.partition("-") for word in words.split(",")]
        ranges = [(int(first), int(last or first)) for first, _, last in ends]
        rising = [number for pair in ranges for number in pair]
        if rising != sorted(rising) or rising[-1] >= len(self.pomdp.states):
            raise self._error(f"{words[:80]!r} are no states of the model, in ranges that rise")
        return np.concatenate([np.arange(first, last + 1) for first, last in ranges])

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if not self.open and name != "Policy":
            raise self._error(f"expected <Policy>, found <{name}>")
        if len(self.open) > 8:
            raise self._error(f"<{name}> is nested too deeply for a policy")
        if name in _VECTORS and any(outer in _VECTORS for outer in self.open):
            raise self._error(f"<{name}> cannot stand in another vector")
        self.open.append(name)
        self.text.clear()
        if name == "AlphaVector":
            self._header(attributes)
        elif name in _VECTORS:
            self._begin_vector(attributes)
            self.entries.clear()

    def _header(self, attributes: dict[str, str]) -> None:
        if self.vectors:
            raise self._error("<AlphaVector> stands twice in this policy")
        values = self._whole(attributes, "numObsValue") if "numObsValue" in attributes else 1
        if values == 1:
            self._check_length(attributes, len(self.pomdp.states), "states")
        elif self.given is None:
            raise self._error(
                f"this policy is for a factored model with {values} values of its observed"
                " variables; only policies over one set of states are read"
            )
        elif values != len(self.given):
            raise self._error(
                f"this policy is for another model: its observed variables have {values} values, those of the"
                f" model {len(self.given)}"
            )
        else:
            self.blocks = self.given
            for block in () if self.own else self.blocks:
                self._check_length(attributes, len(block), "values of the hidden variables")
        if "numVectors" in attributes:
            self.promised = self._whole(attributes, "numVectors")

    def _check_length(self, attributes: dict[str, str], length: int, what: str) -> None:
        if "vectorLength" in attributes and self._whole(attributes, "vectorLength") != length:
            raise self._error(
                f"this policy is for another model: its vectors have {attributes['vectorLength']} numbers,"
                f" the model has {length} {what}"
            )

    def _begin_vector(self, attributes: dict[str, str]) -> None:
        action = self._whole(attributes, "action")
        if action >= len(self.pomdp.actions):
            raise self._error(
                f"this policy is for another model: action {action} is not among its"
                f" {len(self.pomdp.actions)} actions, counted from 0"
            )
        if self.given is None and attributes.get("obsValue", "0") != "0":
            raise self._error(f"obsValue {attributes['obsValue']!r} belongs to a factored model")
        self.observed = self._whole(attributes, "obsValue") if "obsValue" in attributes else 0
        if self.observed >= len(self.blocks):
            raise self._error(
                f"obsValue {self.observed} is not among the {len(self.blocks)} values of the observed"
                " variables, counted from 0"
            )
        self.actions.setdefault(self.observed, []).append(action)

    def _end(self, name: str) -> None:
        self.open.pop()
        text = "".join(self.text)
        self.text.clear()
        length = len(self.blocks[self.observed])
        if name == "Vector":
            vector = self._numbers(text, "vector")
            if len(vector) != length:
                raise self._error(
                    f"this policy is for another model: a vector of {len(vector)} numbers,"
                    f" the model has {length} states"
                )
            self._add(vector)
        elif name == "Entry":
            words = text.split()
            if len(words) != 2 or not is_count(words[0]) or len(words[0]) > 9:
                raise self._error(f"an entry is a state's number and a value, not {' '.join(words)[:80]!r}")
            self.entries.append((int(words[0]), float(self._numbers(words[1], "entry")[0])))
        elif name == "SparseVector":
            vector = np.zeros(length)
            for state, value in self.entries:
                if state >= length:
                    raise self._error(f"state {state} is not among the {length} states, counted from 0")
                vector[state] = value
            self._add(vector)

    def _add(self, vector: Array) -> None:
        self.vectors.setdefault(self.observed, []).append(vector)

    def _whole(self, attributes: dict[str, str], name: str) -> int:
        text = attributes.get(name, "")
        if not (is_count(text) and len(text) < 10):
            raise self._error(f"{name} must be a whole number, not {text[:40]!r}")
        return int(text)

    def _numbers(self, text: str, what: str) -> Array:
        values = finite_numbers(text)
        if values is None:
            index, message = first_fault(text.split())
            raise self._error(f"{message}, number {index + 1} of this {what}")
        return values

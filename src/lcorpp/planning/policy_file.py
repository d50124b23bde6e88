"""APPL's policy XML: read from any APPL-made file, written so that APPL's tools read it.

Format: the files of APPL (https://github.com/AdaCompNUS/sarsop); a `Vector` holds S numbers, a `SparseVector`
entries of a state's number and a value. What lcorpp writes also carries the fingerprint of its model, in a
comment that other readers pass over.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from lcorpp.errors import PolicyError
from lcorpp.files import read_bytes, write_atomically
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

_FINGERPRINT = re.compile(r"\s*lcorpp model sha256 ([0-9a-f]{64})\s*")


def write_policy(policy: Policy, path: str | Path) -> None:
    """Write a policy with all its digits: reading it gives the same vectors bit for bit.

    Raises:
        FileError: the file cannot be written.
    """
    count, length = policy.vectors.shape
    # control characters have no place in XML, not even escaped
    model = "".join(c if c.isprintable() else "?" for c in Path(policy.model or "unknown.pomdp").name)
    lines = [
        '<?xml version="1.0" encoding="ISO-8859-1"?>',
        f'<Policy version="0.1" type="value" model={quoteattr(model)}>',
        f'<AlphaVector vectorLength="{length}" numObsValue="1" numVectors="{count}">',
    ]
    for action, vector in zip(policy.actions.tolist(), policy.vectors.tolist(), strict=True):
        # the space after the last number is APPL's; some readers drop what follows it
        numbers = " ".join(map(repr, vector))
        lines.append(f'<Vector action="{action}" obsValue="0">{numbers} </Vector>')
    lines.append("</AlphaVector>")
    if policy.fingerprint:
        lines.append(f"<!-- lcorpp model sha256 {policy.fingerprint} -->")
    lines.append("</Policy>")
    write_atomically(path, ("\n".join(lines) + "\n").encode("ascii", "xmlcharrefreplace"))


def read_policy(path: str | Path, pomdp: Pomdp) -> Policy:
    """Read a policy for `pomdp`.

    Raises:
        FileError: the file cannot be read.
        PolicyError: it is malformed, holds a DTD, or belongs to another model.
    """
    return _Reader(str(path), pomdp).read(read_bytes(path))


class _Reader:
    """Collects vectors while expat walks through the file; a DTD is refused, so no entity is expanded."""

    def __init__(self, file: str, pomdp: Pomdp) -> None:
        self.file, self.pomdp = file, pomdp
        self.vectors: list[Array] = []
        self.actions: list[int] = []
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
        if not self.vectors:
            raise self._error("there is no alpha vector in it")
        if self.promised not in (-1, len(self.vectors)):
            raise self._error(f"{self.promised} vectors are announced, {len(self.vectors)} are there")
        if self.fingerprint and self.fingerprint != self.pomdp.fingerprint:
            raise PolicyError(
                f"{self.file}: this policy is for another model: the fingerprint of its states, actions,"
                " observations, numbers and discount is not that of"
                f" {self.pomdp.file or 'the given model'}; solve again"
            )
        return Policy.of(self.pomdp, np.array(self.vectors), self.actions)

    def _error(self, message: str) -> PolicyError:
        line, column = self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1
        return PolicyError(f"{self.file}:{line}:{column}: {message}")

    def _doctype(self, *declaration: object) -> None:
        raise self._error("a document type declaration is refused; a policy needs none")

    def _comment(self, text: str) -> None:
        match = _FINGERPRINT.fullmatch(text)
        if match:
            self.fingerprint = match.group(1)

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if not self.open and name != "Policy":
            raise self._error(f"expected <Policy>, found <{name}>")
        if len(self.open) > 8:
            raise self._error(f"<{name}> is nested too deeply for a policy")
        self.open.append(name)
        self.text.clear()
        if name == "AlphaVector":
            self._header(attributes)
        elif name in ("Vector", "SparseVector"):
            self._check_vector(attributes)
            self.entries.clear()

    def _header(self, attributes: dict[str, str]) -> None:
        S = len(self.pomdp.states)
        if "vectorLength" in attributes and self._whole(attributes, "vectorLength") != S:
            raise self._error(
                f"this policy is for another model: its vectors have {attributes['vectorLength']} numbers,"
                f" the model has {S} states"
            )
        if "numObsValue" in attributes and self._whole(attributes, "numObsValue") != 1:
            raise self._error(
                f"this policy is for a factored model with {attributes['numObsValue']} values of its observed"
                " variables; only policies over one set of states are read"
            )
        if "numVectors" in attributes:
            self.promised = self._whole(attributes, "numVectors")

    def _check_vector(self, attributes: dict[str, str]) -> None:
        action = self._whole(attributes, "action")
        if action >= len(self.pomdp.actions):
            raise self._error(
                f"this policy is for another model: action {action} is not among its"
                f" {len(self.pomdp.actions)} actions, counted from 0"
            )
        if attributes.get("obsValue", "0") != "0":
            raise self._error(f"obsValue {attributes['obsValue']!r} belongs to a factored model")
        self.actions.append(action)

    def _end(self, name: str) -> None:
        self.open.pop()
        words = "".join(self.text).split()
        self.text.clear()
        if name == "Vector":
            self.vectors.append(np.array([self._number(word) for word in words]))
            self._check_length(len(words))
        elif name == "Entry":
            if len(words) != 2 or not words[0].isascii() or not words[0].isdigit():
                raise self._error(f"an entry is a state's number and a value, not {' '.join(words)!r}")
            self.entries.append((int(words[0]), self._number(words[1])))
        elif name == "SparseVector":
            vector = np.zeros(len(self.pomdp.states))
            for state, value in self.entries:
                if state >= len(vector):
                    raise self._error(f"state {state} is not among the {len(vector)} states, counted from 0")
                vector[state] = value
            self.vectors.append(vector)

    def _check_length(self, length: int) -> None:
        if length != len(self.pomdp.states):
            raise self._error(
                f"this policy is for another model: a vector of {length} numbers,"
                f" the model has {len(self.pomdp.states)} states"
            )

    def _whole(self, attributes: dict[str, str], name: str) -> int:
        text = attributes.get(name, "")
        if not (text.isascii() and text.isdigit() and len(text) < 10):
            raise self._error(f"{name} must be a whole number, not {text!r}")
        return int(text)

    def _number(self, word: str) -> float:
        try:
            value = float(word)
        except ValueError:
            raise self._error(f"expected a number, found {word[:40]!r}") from None
        if not np.isfinite(value):
            raise self._error(f"{word[:40]} is not a finite number")
        return value

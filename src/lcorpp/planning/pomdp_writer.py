"""Writing the .pomdp format so that reading gives the same model, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.files import write_atomically
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.pomdp_tokens import PREAMBLE, TABLES, is_number
from lcorpp.values import Array

_RESERVED = {*PREAMBLE, *TABLES, "start", "include", "exclude", "uniform", "identity", "reset", "*"}


def write_pomdp(pomdp: Pomdp, path: str | Path) -> None:
    """Write a .pomdp file; `read_pomdp` gives the same tables back exactly.

    Raises:
        FileError: the file cannot be written.
        ModelError: a name cannot stand in the format, such as one with a space.
    """
    write_atomically(path, format_pomdp(pomdp))


def format_pomdp(pomdp: Pomdp) -> str:
    """The text of a model in .pomdp format, non-zero entries only.

    Raises:
        ModelError: a name cannot stand in the format.
    """
    return "\n".join(_lines(pomdp)) + "\n"


def _lines(pomdp: Pomdp) -> Iterator[str]:
    yield f"discount: {pomdp.discount!r}"
    yield "values: reward"
    yield f"states: {_names(pomdp.states)}"
    yield f"actions: {_names(pomdp.actions)}"
    yield f"observations: {_names(pomdp.observations)}"
    yield "start: " + " ".join(map(repr, pomdp.start.tolist()))
    yield ""
    yield from _entries("T", pomdp.actions, pomdp.states, pomdp.states, pomdp.transition)
    yield ""
    yield from _entries("O", pomdp.actions, pomdp.states, pomdp.observations, pomdp.observation)
    yield ""
    for a, s in np.argwhere(pomdp.reward):
        yield f"R: {pomdp.actions[a]} : {pomdp.states[s]} : * : * {float(pomdp.reward[a, s])!r}"


def _entries(
    keyword: str, actions: Sequence[str], states: Sequence[str], columns: Sequence[str], table: Array
) -> Iterator[str]:
    indices = np.nonzero(table)
    for a, s, c, p in zip(*(index.tolist() for index in indices), table[indices].tolist(), strict=True):
        yield f"{keyword}: {actions[a]} : {states[s]} : {columns[c]} {p!r}"


def _names(names: Sequence[str]) -> str:
    if all(name == str(i) for i, name in enumerate(names)):
        return str(len(names))
    for name in names:
        if not name or name in _RESERVED or is_number(name) or any(c.isspace() or c in ":#" for c in name):
            raise ModelError(f"the name {name!r} cannot be written into a .pomdp file")
    return " ".join(names)

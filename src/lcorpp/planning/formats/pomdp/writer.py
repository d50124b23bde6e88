"""Write the .pomdp format so that reading it back gives the same bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.files import write_atomically
from lcorpp.planning.formats.numbers import is_number
from lcorpp.planning.formats.pomdp.tokens import PREAMBLE_KEYWORDS, TABLE_KEYWORDS
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import SparseTables

_OTHER_KEYWORDS = ("start", "include", "exclude", "uniform", "identity", "reset", "*")
_RESERVED = {*PREAMBLE_KEYWORDS, *TABLE_KEYWORDS, *_OTHER_KEYWORDS}


def write_pomdp(pomdp: Pomdp, path: str | Path) -> None:
    """Write a .pomdp file; reading it back gives the same tables exactly.

    Raises:
        FileError: the file cannot be written.
        ModelError: the format does not allow a name, such as one with a space.

    Examples:
        >>> from lcorpp import load_domain, read_pomdp
        >>> from lcorpp.planning import write_pomdp
        >>> pomdp = load_domain("intention").pomdp
        >>> write_pomdp(pomdp, "copy.pomdp")
        >>> read_pomdp("copy.pomdp").fingerprint == pomdp.fingerprint
        True
    """
    write_atomically(path, format_pomdp(pomdp))


def format_pomdp(pomdp: Pomdp) -> str:
    """Return the text of a model in .pomdp format, nonzero entries only.

    Raises:
        ModelError: the format does not allow a name.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import format_pomdp
        >>> print(format_pomdp(load_domain("intention").pomdp))
        discount: 0.99
        values: reward
        ...
    """
    return "\n".join(_format_lines(pomdp)) + "\n"


def _format_lines(pomdp: Pomdp) -> Iterator[str]:
    yield f"discount: {pomdp.discount!r}"
    yield "values: reward"
    yield f"states: {_format_names(pomdp.states)}"
    yield f"actions: {_format_names(pomdp.actions)}"
    yield f"observations: {_format_names(pomdp.observations)}"
    yield "start: " + " ".join(map(repr, pomdp.start.tolist()))
    yield ""
    yield from _format_entries("T", pomdp, pomdp.transition, pomdp.states)
    yield ""
    yield from _format_entries("O", pomdp, pomdp.observation, pomdp.observations)
    yield ""
    action, state = np.nonzero(pomdp.reward)
    for a, s, r in zip(*(x.tolist() for x in (action, state, pomdp.reward[action, state])), strict=True):
        yield f"R: {pomdp.actions[a]} : {pomdp.states[s]} : * : * {r!r}"


def _format_entries(keyword: str, pomdp: Pomdp, table: SparseTables, columns: Sequence[str]) -> Iterator[str]:
    actions, states = pomdp.actions, pomdp.states
    for row, c, p in zip(table.rows.tolist(), table.columns.tolist(), table.values.tolist(), strict=True):
        a, s = divmod(row, len(states))
        yield f"{keyword}: {actions[a]} : {states[s]} : {columns[c]} {p!r}"


def _format_names(names: Sequence[str]) -> str:
    if all(name == str(i) for i, name in enumerate(names)):
        return str(len(names))
    for name in names:
        invalid = any(c.isspace() or c in ":#" or "\ud800" <= c <= "\udfff" for c in name)
        if not name or name in _RESERVED or is_number(name) or invalid:
            raise ModelError(f"the name {name!r} cannot be written into a .pomdp file")
    return " ".join(names)

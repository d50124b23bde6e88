"""Statements that other tools add to the .pomdp format: some are read, the others refused by name.

PyPOMDP (https://github.com/namoshizun/PyPOMDP) has the keys ``costs`` and ``init_state``; pomdps-reveal
(https://github.com/gaperez64/pomdps-reveal) labels states by ``atom N:`` and ``prio N:`` and has neither
discount, values nor rewards; MADP (https://github.com/MADPToolbox/MADP) has ``agents``.
"""

from __future__ import annotations

import logging

from lcorpp.errors import ParseError, expected_one_of
from lcorpp.planning.formats.pomdp.tokens import Tokens

LOG = logging.getLogger(__name__)

_IGNORED = {
    "costs": "the costs of actions, which PyPOMDP pays from a budget, are not rewards; they are ignored",
    "init_state": "the hidden state with which PyPOMDP begins is ignored; 'start:' gives the start belief",
}
_LABELS = (
    "'{} N:' is a statement of pomdps-reveal: it labels states for an objective in temporal logic; expected a"
    " model with rewards"
)
_REFUSED = {
    "atom": _LABELS.format("atom"),
    "prio": _LABELS.format("prio"),
    "agents": "'agents:' begins a model for several agents (MADP's .dpomdp); expected a model of one agent",
}


class PyPomdpKeys:
    """The keys of PyPOMDP in one file: costs of actions, paid from a budget, and the hidden initial state.

    The costs are not rewards, and the state is that of a simulation, unknown to the agent. So they change
    neither values nor policies; the log warns that they are ignored.
    """

    def __init__(self) -> None:
        self._offsets: dict[str, int] = {}
        self._costs = 0
        self._state = ""

    def read(self, tokens: Tokens) -> bool:
        """Read a statement if it has such a key; return whether it has."""
        key = tokens.peek()
        if key not in _IGNORED:
            return False
        if key in self._offsets:
            raise tokens.error(f"duplicate preamble: {key!r} is given twice")
        tokens.take()
        tokens.take()
        self._offsets[key] = tokens.offset
        if key == "init_state":
            self._state = tokens.take()
            return True
        while tokens.at_number():
            tokens.number("cost of an action")
            self._costs += 1
        return True

    def check(self, tokens: Tokens, names: dict[str, tuple[str, ...]]) -> None:
        """Check the values against the names of the actions and states, and log that they are ignored."""
        count, states = len(names["actions"]), names["states"]
        for key, offset in self._offsets.items():
            if key == "costs" and self._costs != count:
                message = f"costs needs a number for each of {count} actions, found {self._costs}"
                raise tokens.error(message, offset)
            if key == "init_state" and self._state not in states:
                raise tokens.error(f"unknown state {self._state!r}; {expected_one_of(states)}", offset)
            place = tokens.error(_IGNORED[key], offset)
            LOG.warning("%s:%d:%d: %s", place.file, place.line, place.column, place.message)


def describe_foreign(tokens: Tokens) -> ParseError | None:
    """Return the error if the next statement is one of another tool that is not read."""
    message = _REFUSED.get(tokens.peek())
    return None if message is None else tokens.error(message)


def describe_missing(names: list[str]) -> str:
    """Return the error message for a preamble without these keywords."""
    message = f"missing preamble: {', '.join(names)}"
    if "discount" in names and "values" in names:
        message += (
            " (files of pomdps-reveal, for objectives in temporal logic, have neither, and no rewards;"
            " expected e.g. 'discount: 0.95' and 'values: reward')"
        )
    return message

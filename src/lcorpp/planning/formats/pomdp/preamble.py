"""Preamble of a .pomdp file: discount, sign of the values, names and initial belief."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.formats.numbers import ROW_TOLERANCE, is_count, is_number
from lcorpp.planning.formats.pomdp.dialects import PyPomdpKeys, describe_foreign, describe_missing
from lcorpp.planning.formats.pomdp.tokens import PREAMBLE_KEYWORDS, TABLE_KEYWORDS, Tokens
from lcorpp.planning.pomdp import SUM_TOLERANCE, discount_message
from lcorpp.values import Belief

MAX_COUNT = 1_000_000
"""Maximum number of states, actions or observations; beyond it the names alone exhaust the memory."""

MAX_ROWS = 2**26
"""Maximum number of pairs of an action and a state; each takes about 32 bytes even in empty tables."""

THE_OBSERVATION = "none"
"""Name of the single observation of a model without observations, an MDP."""

ALL = -1
"""The index that represents ``*``."""


@dataclass
class Preamble:
    """Contents of the preamble, filled during reading.

    names: of states, actions and observations. offsets: of each name, or of the count.
    indices: for states, actions and observations: name or number -> index; `ALL` for ``*``.
    sign: 1 if values are rewards, -1 if they are costs.
    declared_start: the initial belief, None if the file has none.
    is_mdp: whether the file declares no observations; the model then has a single one.
    """

    discount: float = 0.0
    sign: float = 1.0
    names: dict[str, tuple[str, ...]] = field(default_factory=dict)
    offsets: dict[str, list[int]] = field(default_factory=dict)
    indices: dict[str, dict[str, int]] = field(default_factory=dict)
    declared_start: Belief | None = None
    is_mdp: bool = False

    @property
    def counts(self) -> tuple[int, int, int]:
        """The numbers of actions, states and observations."""
        return len(self.names["actions"]), len(self.names["states"]), len(self.names["observations"])

    @property
    def start(self) -> Belief:
        """(S,) the initial belief; uniform if the file has none."""
        if self.declared_start is not None:
            return self.declared_start
        return _make_uniform_start(self.counts[1], range(self.counts[1]))

    def read_reference(self, tokens: Tokens, kind: str) -> int:
        """Read a name, a number or ``*`` among the states, actions or observations; return its index."""
        indices, text = self.indices[kind], tokens.peek()
        index = indices.get(text)
        if index is None and is_count(text):  # a number with leading zeros, or too large
            index = int(text) if len(text) <= 18 else MAX_COUNT
            if index >= len(self.names[kind]):
                raise tokens.error(
                    f"number {text} is not among the {len(self.names[kind])} {kind}, counted from 0"
                )
        if index is None:
            known = expected_one_of(self.names[kind])
            raise tokens.error(f"unknown {kind.removesuffix('s')} {tokens.describe_next()}; {known}")
        tokens.take()
        return index


def read_preamble(tokens: Tokens) -> Preamble:
    """Read up to the first T, O or R. Raises ParseError and ModelError (too many names)."""
    preamble, pypomdp = Preamble(), PyPomdpKeys()
    while not tokens.at_end():
        if not tokens.at_statement():
            raise tokens.unexpected_token()
        keyword = tokens.peek()
        if keyword in TABLE_KEYWORDS:
            break
        if keyword == "start":
            _read_start(tokens, preamble)
        elif keyword in PREAMBLE_KEYWORDS:
            _read_item(tokens, preamble, keyword)
        elif not pypomdp.read(tokens):
            raise describe_foreign(tokens) or tokens.unexpected_token()
    missing = [name for name in PREAMBLE_KEYWORDS if name not in preamble.offsets]
    if set(missing) - {"observations"}:
        raise tokens.error(describe_missing(missing))
    if missing:
        preamble.is_mdp = True
        _set_names(preamble, "observations", (THE_OBSERVATION,))
    pypomdp.check(tokens, preamble.names)
    A, S, _ = preamble.counts
    if A * S > MAX_ROWS:
        raise ModelError(f"{A} actions in {S} states are too many: at most {MAX_ROWS} pairs are supported")
    return preamble


def _read_item(tokens: Tokens, preamble: Preamble, keyword: str) -> None:
    if keyword in preamble.offsets:
        raise tokens.error(f"duplicate preamble: {keyword!r} is given twice")
    tokens.take()
    tokens.take()
    preamble.offsets[keyword] = [tokens.offset]
    if keyword == "discount":
        preamble.discount = tokens.number("discount")
        if not 0 <= preamble.discount <= 1:
            raise tokens.error(discount_message(preamble.discount), preamble.offsets[keyword][0])
    elif keyword == "values":
        word = tokens.peek()
        if word.removesuffix("s") not in ("reward", "cost"):
            raise tokens.error(f"values must be 'reward' or 'cost', found {tokens.describe_next()}")
        preamble.sign = 1.0 if tokens.take().startswith("reward") else -1.0
    else:
        names, preamble.offsets[keyword] = _read_names(tokens, keyword)
        _set_names(preamble, keyword, names)


def _set_names(preamble: Preamble, keyword: str, names: tuple[str, ...]) -> None:
    preamble.names[keyword] = names
    # published files declare names and then use numbers; no name is a number
    numbers = {str(i): i for i in range(len(names))} if not is_count(names[0]) else {}
    preamble.indices[keyword] = {**numbers, **{name: i for i, name in enumerate(names)}, "*": ALL}


def _is_single_count(tokens: Tokens) -> bool:
    """Return whether a whole number follows that is not a list of numbers."""
    return is_count(tokens.peek()) and not is_number(tokens.peek(1))


def _read_names(tokens: Tokens, keyword: str) -> tuple[tuple[str, ...], list[int]]:
    """Read names or a count; return the names and their offsets."""
    if _is_single_count(tokens):
        text, offset = tokens.peek(), tokens.offset
        if len(text) > 18 or int(text) > MAX_COUNT:
            raise ModelError(f"{text[:30]} {keyword} are too many; at most {MAX_COUNT} are supported")
        if int(text) == 0:
            raise tokens.error(f"there must be at least one of the {keyword}")
        tokens.take()
        return tuple(str(i) for i in range(int(text))), [offset]
    offset_of: dict[str, int] = {}
    while not tokens.at_end() and not tokens.at_statement():
        name = tokens.peek()
        if is_number(name) or name in (":", "*"):
            raise tokens.error(f"expected a name among the {keyword}, found {name!r}")
        if name in offset_of:
            raise tokens.error(f"{name!r} appears twice among the {keyword}")
        offset_of[name] = tokens.offset
        tokens.take()
    if not offset_of:
        raise tokens.error(f"expected a count or names after '{keyword}:', found {tokens.describe_next()}")
    if len(offset_of) > MAX_COUNT:
        raise ModelError(f"{len(offset_of)} {keyword} are too many; at most {MAX_COUNT} are supported")
    return tuple(offset_of), list(offset_of.values())


def _read_start(tokens: Tokens, preamble: Preamble) -> None:
    if preamble.declared_start is not None:
        raise tokens.error("duplicate preamble: 'start' is given twice")
    if "states" not in preamble.names:
        raise tokens.error("missing preamble: 'states' must come before 'start'")
    S = len(preamble.names["states"])
    tokens.take()
    mode = tokens.take()
    if mode != ":":
        tokens.take()
        first = tokens.offset
        states = _read_states(tokens, preamble)
        states = set(range(S)) - states if mode == "exclude" else states
        if not states:
            raise tokens.error("no state is left to start in", first)
        preamble.declared_start = _make_uniform_start(S, states)
    elif tokens.peek() == "uniform" and "uniform" not in preamble.indices["states"]:
        tokens.take()
        preamble.declared_start = _make_uniform_start(S, range(S))
    elif tokens.at_number() and (S == 1 or not _is_single_count(tokens)):
        first = tokens.offset
        start = tokens.probabilities(S, "the start belief").dense()[0]
        total = start.sum()
        if abs(total - 1) > ROW_TOLERANCE:
            raise tokens.error(f"the start belief sums to {total:.10g}, not 1", first)
        preamble.declared_start = start / total if abs(total - 1) > SUM_TOLERANCE else start
    else:
        preamble.declared_start = _make_uniform_start(S, _read_states(tokens, preamble))


def _read_states(tokens: Tokens, preamble: Preamble) -> set[int]:
    states: set[int] = set()
    while not tokens.at_end() and not tokens.at_statement():
        if tokens.peek() == "*":
            raise tokens.error("'*' is not a state to start in")
        states.add(preamble.read_reference(tokens, "states"))
    if not states:
        raise tokens.error(f"expected states to start in, found {tokens.describe_next()}")
    return states


def _make_uniform_start(count: int, states: Collection[int]) -> Belief:
    belief = np.zeros(count)
    belief[list(states)] = 1.0 / len(states)
    return belief

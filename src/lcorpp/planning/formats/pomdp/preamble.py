"""The head of a .pomdp file: discount, sign, names and start belief."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.formats.numbers import is_count, is_number
from lcorpp.planning.formats.pomdp.tokens import PREAMBLE, ROW_TOLERANCE, TABLES, Tokens
from lcorpp.planning.pomdp import SUM_TOLERANCE, discount_message
from lcorpp.values import Belief

MAX_COUNT = 1_000_000
"""The most states, actions or observations a count may ask for: beyond it even their names do not fit."""

MAX_ROWS = 2**26
"""The most pairs of an action and a state: each takes some 32 bytes whatever the tables hold."""

ALL = -1
"""The index that stands for ``*``."""


@dataclass
class Preamble:
    """What stands before the tables, filled while it is read.

    names: for states, actions and observations the names. places: the offset of each name, or of the count.
    indices: for each of them what may stand for one, names and numbers, with the index; `ALL` for ``*``.
    sign: 1 where values are rewards, -1 where they are costs.
    """

    discount: float = 0.0
    sign: float = 1.0
    names: dict[str, tuple[str, ...]] = field(default_factory=dict)
    places: dict[str, list[int]] = field(default_factory=dict)
    indices: dict[str, dict[str, int]] = field(default_factory=dict)
    given_start: Belief | None = None

    @property
    def counts(self) -> tuple[int, int, int]:
        """The numbers of actions, states and observations."""
        return len(self.names["actions"]), len(self.names["states"]), len(self.names["observations"])

    @property
    def start(self) -> Belief:
        """(S,) the start belief; uniform where none is given."""
        if self.given_start is not None:
            return self.given_start
        return _uniform_over(self.counts[1], range(self.counts[1]))

    def reference(self, tokens: Tokens, kind: str) -> int:
        """Read a name, a number or ``*`` among the states, actions or observations."""
        known, text = self.indices[kind], tokens.peek()
        index = known.get(text)
        if index is None and is_count(text):  # a number with zeros before it, or too large
            index = int(text) if len(text) <= 18 else MAX_COUNT
            if index >= len(self.names[kind]):
                raise tokens.error(
                    f"number {text} is not among the {len(self.names[kind])} {kind}, counted from 0"
                )
        if index is None:
            singular = kind.removesuffix("s")
            raise tokens.error(f"unknown {singular} {tokens.found()}; {expected_one_of(self.names[kind])}")
        tokens.take()
        return index


def read_preamble(tokens: Tokens) -> Preamble:
    """Read up to the first T, O or R.

    Raises:
        ParseError: it is malformed or incomplete.
        ModelError: it names or counts more than can be held.
    """
    head = Preamble()
    while not tokens.done():
        if not tokens.at_statement():
            raise tokens.stray()
        keyword = tokens.peek()
        if keyword in TABLES:
            break
        if keyword == "start":
            _read_start(tokens, head)
        else:
            _read_item(tokens, head, keyword)
    missing = [name for name in PREAMBLE if name not in head.places]
    if missing:
        raise tokens.error(f"missing preamble: {', '.join(missing)}")
    A, S, _ = head.counts
    if A * S > MAX_ROWS:
        raise ModelError(f"{A} actions in {S} states are too many: at most {MAX_ROWS} pairs can be held")
    return head


def _read_item(tokens: Tokens, head: Preamble, keyword: str) -> None:
    if keyword in head.places:
        raise tokens.error(f"duplicate preamble: {keyword!r} is given twice")
    tokens.take()
    tokens.take()
    head.places[keyword] = [tokens.at]
    if keyword == "discount":
        head.discount = float(tokens.numbers(1, "discount")[0][0, 0])
        if not 0 < head.discount < 1:
            raise tokens.error(discount_message(head.discount), head.places[keyword][0])
    elif keyword == "values":
        if tokens.peek() not in ("reward", "cost"):
            raise tokens.error(f"values must be 'reward' or 'cost', found {tokens.found()}")
        head.sign = 1.0 if tokens.take() == "reward" else -1.0
    else:
        names, head.places[keyword] = _read_names(tokens, keyword)
        head.names[keyword] = names
        # a published file may mix: names declared, numbers used; no name is a number
        numbers = {str(i): i for i in range(len(names))} if not is_count(names[0]) else {}
        head.indices[keyword] = {**numbers, **{name: i for i, name in enumerate(names)}, "*": ALL}


def _read_names(tokens: Tokens, keyword: str) -> tuple[tuple[str, ...], list[int]]:
    if is_count(tokens.peek()) and not is_number(tokens.peek(1)):
        text, place = tokens.peek(), tokens.at
        if len(text) > 18 or int(text) > MAX_COUNT:
            raise ModelError(f"{text[:30]} {keyword} are too many; at most {MAX_COUNT} can be held")
        if int(text) == 0:
            raise tokens.error(f"there must be at least one of the {keyword}")
        tokens.take()
        return tuple(str(i) for i in range(int(text))), [place]
    names: dict[str, int] = {}
    while not tokens.done() and not tokens.at_statement():
        name = tokens.peek()
        if is_number(name) or name in (":", "*"):
            raise tokens.error(f"expected a name among the {keyword}, found {name!r}")
        if name in names:
            raise tokens.error(f"{name!r} is twice among the {keyword}")
        names[name] = tokens.at
        tokens.take()
    if not names:
        raise tokens.error(f"expected a count or names after '{keyword}:', found {tokens.found()}")
    if len(names) > MAX_COUNT:
        raise ModelError(f"{len(names)} {keyword} are too many; at most {MAX_COUNT} can be held")
    return tuple(names), list(names.values())


def _read_start(tokens: Tokens, head: Preamble) -> None:
    if head.given_start is not None:
        raise tokens.error("duplicate preamble: 'start' is given twice")
    if "states" not in head.names:
        raise tokens.error("missing preamble: 'states' must come before 'start'")
    S = len(head.names["states"])
    tokens.take()
    mode = tokens.take()
    if mode != ":":
        tokens.take()
    first = tokens.at
    if mode != ":":
        chosen = _read_states(tokens, head)
        chosen = set(range(S)) - chosen if mode == "exclude" else chosen
        if not chosen:
            raise tokens.error("no state is left to start in", first)
        head.given_start = _uniform_over(S, chosen)
    elif tokens.peek() == "uniform" and "uniform" not in head.indices["states"]:
        tokens.take()
        head.given_start = _uniform_over(S, range(S))
    elif is_number(tokens.peek()) and not _one_state_number(tokens, S):
        start = tokens.probabilities(S, "the start belief")[0][0]
        total = start.sum()
        if abs(total - 1) > ROW_TOLERANCE:
            raise tokens.error(f"the start belief sums to {total:.10g}, not 1", first)
        head.given_start = start / total if abs(total - 1) > SUM_TOLERANCE else start
    else:
        head.given_start = _uniform_over(S, _read_states(tokens, head))


def _one_state_number(tokens: Tokens, states: int) -> bool:
    """Whether one whole number stands alone after ``start:``, the number of a state."""
    return states > 1 and is_count(tokens.peek()) and not is_number(tokens.peek(1))


def _read_states(tokens: Tokens, head: Preamble) -> set[int]:
    chosen: set[int] = set()
    while not tokens.done() and not tokens.at_statement():
        if tokens.peek() == "*":
            raise tokens.error("'*' is no state to start in")
        chosen.add(head.reference(tokens, "states"))
    if not chosen:
        raise tokens.error(f"expected states to start in, found {tokens.found()}")
    return chosen


def _uniform_over(states: int, chosen: Collection[int]) -> Belief:
    belief = np.zeros(states)
    belief[list(chosen)] = 1.0 / len(chosen)
    return belief

"""Reading A. Cassandra's .pomdp format, as published files use it.

The format: http://pomdp.org/code/pomdp-file-spec.html. Later statements override earlier ones. Beyond the
specification, as in published files: a bare list of start states, and a stray colon before the numbers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, ParseError, expected
from lcorpp.files import read_text
from lcorpp.planning.pomdp import SUM_TOLERANCE, Pomdp, check_size, discount_message
from lcorpp.planning.pomdp_rewards import Index, Reward, expected_rewards
from lcorpp.planning.pomdp_tokens import (
    PREAMBLE,
    ROW_TOLERANCE,
    TABLES,
    Tokens,
    is_count,
    is_number,
)
from lcorpp.values import Array, Belief

MAX_COUNT = 1_000_000
"""The most states, actions or observations a count may ask for: beyond it even their names do not fit."""

_KEYWORD_BODIES = ("identity", "uniform", "reset")


def read_pomdp(path: str | Path) -> Pomdp:
    """Read a .pomdp file.

    Raises:
        FileError: the file cannot be read.
        ParseError: the text is malformed; file, line and column are told.
        ModelError: the model is too large for dense tables.
    """
    return parse_pomdp(read_text(path), file=str(path))


def parse_pomdp(text: str, *, file: str = "<text>") -> Pomdp:
    """The POMDP that a text in .pomdp format describes.

    Rows that sum to 1 within 1e-4 are normalised; costs become negative rewards; rewards that depend on the
    next state or the observation are folded into the expected reward.

    Raises:
        ParseError: the text is malformed.
        ModelError: the model is too large for dense tables.
    """
    try:
        return _Reader(Tokens(text, file)).read()
    except ModelError as error:
        raise ModelError(f"{file}: {error}") from None


class _Reader:
    """One pass over the tokens: the preamble and the start first, then the tables, then the checks."""

    def __init__(self, tokens: Tokens) -> None:
        self.tokens = tokens
        self.discount = 0.0
        self.sign = 1.0
        self.names: dict[str, tuple[str, ...]] = {}
        self.indices: dict[str, dict[str, int]] = {}
        self.declared: dict[str, int] = {}  # preamble item -> token index of its first value
        self.start: Belief | None = None
        self.tables: dict[str, _Table] = {}
        self.rewards: list[Reward] = []

    def read(self) -> Pomdp:
        tokens = self.tokens
        while not tokens.done():
            if not tokens.at_statement():
                raise tokens.error(self._stray())
            keyword = tokens.peek()
            if keyword in TABLES:
                self._begin_tables()
                tokens.at += 2
                self._reward() if keyword == "R" else self._row(self.tables[keyword])
            elif self.tables:
                raise tokens.error(f"{keyword!r} must come before the first T, O or R")
            elif keyword == "start":
                self._start()
            else:
                self._preamble(keyword)
        self._begin_tables()
        assert self.start is not None
        for table in self.tables.values():
            self._check(table)
        transition, observation = self.tables["T"].values, self.tables["O"].values
        reward = expected_rewards(transition, observation, self.rewards)
        for table_values in (transition, observation):
            table_values.setflags(write=False)
        return Pomdp(
            self.names["states"],
            self.names["actions"],
            self.names["observations"],
            transition,
            observation,
            # 0 + and 0 - turn -0.0 into 0.0: a file should not come back with another sign
            0.0 + reward if self.sign > 0 else 0.0 - reward,
            self.discount,
            self.start,
            tokens.file,
        )

    def _stray(self) -> str:
        if is_number(self.tokens.peek()) and self.tokens.at:
            return f"too many numbers: {self.tokens.peek()} is left over; expected a new statement"
        names = ", ".join(f"{name}:" for name in (*PREAMBLE, "start", *TABLES))
        return f"expected one of {names}, found {self.tokens.found()}"

    # --- preamble ---

    def _preamble(self, keyword: str) -> None:
        tokens = self.tokens
        if keyword in self.declared:
            raise tokens.error(f"duplicate preamble: {keyword!r} is given twice")
        tokens.at += 2
        self.declared[keyword] = tokens.at
        if keyword == "discount":
            self.discount = float(tokens.numbers(1, "discount")[0])
            if not 0 < self.discount < 1:
                raise tokens.error(discount_message(self.discount), self.declared[keyword])
        elif keyword == "values":
            if tokens.peek() not in ("reward", "cost"):
                raise tokens.error(f"values must be 'reward' or 'cost', found {tokens.found()}")
            self.sign = 1.0 if tokens.peek() == "reward" else -1.0
            tokens.at += 1
        else:
            self.names[keyword] = self._names(keyword)
            self.indices[keyword] = {name: i for i, name in enumerate(self.names[keyword])}

    def _names(self, keyword: str) -> tuple[str, ...]:
        tokens = self.tokens
        if is_count(tokens.peek()) and (tokens.peek(1) == "" or not is_number(tokens.peek(1))):
            text = tokens.peek()
            if len(text) > 18 or int(text) > MAX_COUNT:
                raise ModelError(f"{text[:30]} {keyword} are too many; at most {MAX_COUNT} can be held")
            if int(text) == 0:
                raise tokens.error(f"there must be at least one of the {keyword}")
            tokens.at += 1
            return tuple(str(i) for i in range(int(text)))
        names: dict[str, None] = {}
        while not tokens.done() and not tokens.at_statement():
            name = tokens.peek()
            if is_number(name) or name in (":", "*"):
                raise tokens.error(f"expected a name among the {keyword}, found {name!r}")
            if name in names:
                raise tokens.error(f"{name!r} is twice among the {keyword}")
            names[name] = None
            tokens.at += 1
        if not names:
            raise tokens.error(f"expected a count or names after '{keyword}:', found {tokens.found()}")
        return tuple(names)

    def _start(self) -> None:
        tokens = self.tokens
        if self.start is not None:
            raise tokens.error("duplicate preamble: 'start' is given twice")
        if "states" not in self.names:
            raise tokens.error("missing preamble: 'states' must come before 'start'")
        S = len(self.names["states"])
        mode, first = tokens.peek(1), tokens.at + 2
        tokens.at = first + (mode in ("include", "exclude"))
        if mode in ("include", "exclude"):
            chosen = self._states()
            self.start = _uniform_over(S, set(range(S)) - chosen if mode == "exclude" else chosen)
            if not self.start.any():
                raise tokens.error("no state is left to start in", first + 1)
        elif tokens.peek() == "uniform" and "uniform" not in self.indices["states"]:
            tokens.at += 1
            self.start = _uniform_over(S, set(range(S)))
        elif is_number(tokens.peek()) and not self._one_state_number(S):
            start = tokens.probabilities(S, "the start belief")
            total = start.sum()
            if abs(total - 1) > ROW_TOLERANCE:
                raise tokens.error(f"the start belief sums to {total:.10g}, not 1", first)
            self.start = start / total if abs(total - 1) > SUM_TOLERANCE else start
        else:
            self.start = _uniform_over(S, self._states())

    def _one_state_number(self, states: int) -> bool:
        """Whether one whole number stands alone after ``start:``, the number of a state."""
        tokens = self.tokens
        return states > 1 and is_count(tokens.peek()) and not is_number(tokens.peek(1))

    def _states(self) -> set[int]:
        tokens = self.tokens
        chosen: set[int] = set()
        while not tokens.done() and not tokens.at_statement():
            state = self._reference("states")
            if isinstance(state, slice):
                raise tokens.error("'*' is no state to start in", tokens.at - 1)
            chosen.add(state)
        if not chosen:
            raise tokens.error(f"expected states to start in, found {tokens.found()}")
        return chosen

    # --- tables ---

    def _begin_tables(self) -> None:
        if self.tables:
            return
        missing = [name for name in PREAMBLE if name not in self.declared]
        if missing:
            raise self.tokens.error(f"missing preamble: {', '.join(missing)}")
        S, A, obs = (len(self.names[kind]) for kind in ("states", "actions", "observations"))
        check_size(S, A, obs)
        if self.start is None:
            self.start = _uniform_over(S, set(range(S)))
        self.tables = {
            "T": _Table("transition", "states", (A, S, S)),
            "O": _Table("observation", "observations", (A, S, obs)),
        }

    def _reference(self, kind: str) -> Index:
        """A name, a number or ``*`` among the states, actions or observations."""
        tokens, known = self.tokens, self.indices[kind]
        text = tokens.peek()
        tokens.at += 1
        if text == "*":
            return slice(None)
        if text in known:
            return known[text]
        if is_count(text):
            # a published file may mix: names declared, numbers used
            if len(text) <= 18 and int(text) < len(known):
                return int(text)
            raise tokens.error(
                f"number {text} is not among the {len(known)} {kind}, counted from 0", tokens.at - 1
            )
        tokens.at -= 1
        singular = kind.removesuffix("s")
        raise tokens.error(f"unknown {singular} {tokens.found()}; {expected(self.names[kind])}")

    def _another(self, kind: str) -> bool:
        """Whether a colon and one more reference follow; a stray colon before the numbers is stepped over."""
        tokens = self.tokens
        if tokens.peek() != ":":
            return False
        tokens.at += 1
        text = tokens.peek()
        if text in self.indices[kind] or text == "*" or is_count(text):
            return True
        return not (is_number(text) or text in _KEYWORD_BODIES)

    def _row(self, table: _Table) -> None:
        """``T:`` or ``O:`` with an entry, a row or a matrix."""
        tokens = self.tokens
        _, S, N = table.values.shape
        action = self._reference("actions")
        if not self._another("states"):
            values, places = self._body(table, S * N, f"{table.title} matrix of {S} rows")
            table.values[action] = values.reshape(-1, N) if values.size > N else values
            table.places[action] = places[::N] if places.size > 1 else places
            return
        state = self._reference("states")
        if not self._another(table.columns):
            values, places = self._body(table, N, f"{table.title} row")
            table.values[action, state] = values
            table.places[action, state] = places[0]
            return
        column = self._reference(table.columns)
        tokens.at += tokens.peek() == ":"
        table.places[action, state] = tokens.at
        table.values[action, state, column] = tokens.probabilities(1, f"{table.title} entry")[0]

    def _body(self, table: _Table, count: int, what: str) -> tuple[Array, npt.NDArray[np.intp]]:
        """The numbers of a row or matrix, and the token index of each; one index where a keyword stands."""
        tokens = self.tokens
        _, S, N = table.values.shape
        first, word = tokens.at, tokens.peek()
        if word not in _KEYWORD_BODIES:
            return tokens.probabilities(count, what), np.arange(first, first + count)
        tokens.at += 1
        place = np.array([first])
        if word == "uniform":
            return np.full(N, 1.0 / N), place
        if word == "reset" and table.columns == "states":
            assert self.start is not None
            return self.start, place
        if word == "identity" and N == S and count == S * N:
            return np.eye(S), place
        raise tokens.error(f"{word!r} cannot stand for this {what}", first)

    def _reward(self) -> None:
        """``R:`` with an entry, a row over the observations or a matrix of next states by observations."""
        tokens = self.tokens
        S, obs = len(self.names["states"]), len(self.names["observations"])
        action = self._reference("actions")
        tokens.skip_colon()
        state = self._reference("states")
        if not self._another("states"):
            values = tokens.numbers(S * obs, f"reward matrix of {S} rows").reshape(S, obs)
            self.rewards.append(Reward(action, state, slice(None), slice(None), values))
            return
        following = self._reference("states")
        if not self._another("observations"):
            row = tokens.numbers(obs, "reward row")
            self.rewards.append(Reward(action, state, following, slice(None), row))
            return
        observation = self._reference("observations")
        tokens.at += tokens.peek() == ":"
        self.rewards.append(
            Reward(action, state, following, observation, tokens.numbers(1, "reward").reshape(()))
        )

    # --- after the last statement ---

    def _check(self, table: _Table) -> None:
        """Every row is there and sums to 1; rounding of the file is taken out."""
        unset = table.places < 0
        for a in np.flatnonzero(unset.any(axis=1)):
            action = self.names["actions"][a]
            place = self.declared["actions"]
            if not is_count(self.tokens.texts[place]):
                place += int(a)
            if unset[a].all():
                raise self.tokens.error(f"action {action!r} has no {table.title} rows", place)
            state = self.names["states"][int(np.argmax(unset[a]))]
            raise self.tokens.error(f"{table.title} row for {action!r}, {state!r} is missing", place)
        sums = table.values.sum(axis=2)
        off = np.abs(sums - 1)
        wrong = np.argwhere(off > ROW_TOLERANCE)
        if len(wrong):
            a, s = min(wrong, key=lambda row: table.places[row[0], row[1]])
            raise self._row_error(table, a, s, sums[a, s])
        inexact = off > SUM_TOLERANCE
        table.values[inexact] /= sums[inexact][:, None]

    def _row_error(self, table: _Table, a: int, s: int, total: float) -> ParseError:
        action, state = self.names["actions"][a], self.names["states"][s]
        return self.tokens.error(
            f"{table.title} row for {action!r}, {state!r} sums to {total:.10g}, not 1",
            int(table.places[a, s]),
        )


class _Table:
    """T or O while it is read.

    values: (A, S, N) probabilities.
    places: (A, S) token index of the first number of the row, -1 before it is given.
    """

    def __init__(self, title: str, columns: str, shape: tuple[int, int, int]) -> None:
        self.title, self.columns = title, columns
        self.values = np.zeros(shape)
        self.places = np.full(shape[:2], -1, dtype=np.intp)


def _uniform_over(states: int, chosen: set[int]) -> Belief:
    belief = np.zeros(states)
    belief[sorted(chosen)] = 1.0 / max(len(chosen), 1)
    return belief

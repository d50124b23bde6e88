"""The statements T, O and R of a .pomdp file, one at a time or many plain entries at once."""

from __future__ import annotations

from sys import float_info

import numpy as np

from lcorpp.planning.formats.numbers import is_count, is_number
from lcorpp.planning.formats.pomdp.entries import Entries
from lcorpp.planning.formats.pomdp.preamble import ALL, Preamble
from lcorpp.planning.formats.pomdp.tables import Content, Table
from lcorpp.planning.formats.pomdp.tokens import ROW_TOLERANCE, TABLES, Places, Tokens

_KEYWORD_BODIES = ("identity", "uniform", "reset")


class Statements:
    """Reads all tables.

    transition, observation: what T and O gave. rewards: what R gave, by action, state, next state and
        observation, each of which may be `ALL`.
    """

    def __init__(self, tokens: Tokens, head: Preamble) -> None:
        self.tokens, self.head = tokens, head
        A, S, observations = head.counts
        self.transition = Table("transition", (A, S, S))
        self.observation = Table("observation", (A, S, observations))
        self.rewards = Entries(4)
        self._kept: dict[tuple[str, str], Content] = {}
        kinds = head.indices
        # `*` for the column gives a whole row, which is no plain entry
        states, observed = (
            {k: i for k, i in kinds[c].items() if i != ALL} for c in ("states", "observations")
        )
        self._plain = {
            "T": (kinds["actions"], kinds["states"], states),
            "O": (kinds["actions"], kinds["states"], observed),
            "R": (kinds["actions"], kinds["states"], kinds["states"], kinds["observations"]),
        }

    def read(self) -> None:
        """Read up to the end of the text.

        Raises:
            ParseError: it is malformed.
        """
        tokens = self.tokens
        while not tokens.done():
            if not tokens.at_statement():
                raise tokens.stray()
            keyword = tokens.peek()
            if keyword not in TABLES:
                raise tokens.error(f"{keyword!r} must come before the first T, O or R")
            if self._read_plain(keyword):
                continue
            tokens.take()
            tokens.take()
            if keyword == "R":
                self._reward()
            elif keyword == "T":
                self._rows(self.transition, "states")
            else:
                self._rows(self.observation, "observations")

    def _read_plain(self, keyword: str) -> bool:
        """Read plain entries of one table; False where the next statement is none."""
        least, most = (-float_info.max, float_info.max) if keyword == "R" else (0.0, 1 + ROW_TOLERANCE)
        found = self.tokens.entries(self._plain[keyword], least, most)
        if found is None:
            return False
        entries = {"T": self.transition.entries, "O": self.observation.entries, "R": self.rewards}
        entries[keyword].add(*found)
        return True

    def _another(self, kind: str) -> bool:
        """Whether a colon and one more reference follow; a stray colon before the numbers is stepped over."""
        tokens = self.tokens
        if tokens.peek() != ":":
            return False
        tokens.take()
        text = tokens.peek()
        if text in self.head.indices[kind] or is_count(text):
            return True
        return not (is_number(text) or text in _KEYWORD_BODIES)

    def _skip_colon(self) -> None:
        if self.tokens.peek() == ":":
            self.tokens.take()

    # --- T and O ---

    def _rows(self, table: Table, columns: str) -> None:
        """An entry, a row or a matrix."""
        tokens, head = self.tokens, self.head
        S = table.shape[1]
        action = head.reference(tokens, "actions")
        if not self._another("states"):
            content, places = self._body(table, columns, f"{table.title} matrix of {S} rows", matrix=True)
            table.replace(action, ALL, content, places)
            return
        state = head.reference(tokens, "states")
        if not self._another(columns):
            table.replace(action, state, *self._body(table, columns, f"{table.title} row", matrix=False))
            return
        column = head.reference(tokens, columns)
        self._skip_colon()
        place = tokens.at
        value = float(tokens.probabilities(1, f"{table.title} entry")[0][0, 0])
        if column == ALL:
            table.replace(action, state, self._constant(table, value), place)
        else:
            table.entries.add([action, state, column], value, place)

    def _body(self, table: Table, columns: str, what: str, *, matrix: bool) -> tuple[Content, int | Places]:
        """The numbers of a matrix or of one row, or the keyword that stands for them, and where they are."""
        tokens = self.tokens
        _, S, N = table.shape
        place, word = tokens.at, tokens.peek()
        if word not in _KEYWORD_BODIES:
            values, places = tokens.probabilities(N, what, S if matrix else 1)
            return (table.store(values), places) if matrix else (table.store(values[0]), place)
        fits = {"uniform": True, "reset": columns == "states", "identity": N == S and (matrix or S == 1)}
        if not fits[word]:
            raise tokens.error(f"{word!r} cannot stand for this {what}")
        tokens.take()
        if word == "uniform" or N == 1:
            return self._constant(table, 1.0 / N), place
        if (table.title, word) not in self._kept:
            content = table.store_identity() if word == "identity" else table.store(self.head.start)
            self._kept[table.title, word] = content
        return self._kept[table.title, word], place

    def _constant(self, table: Table, value: float) -> Content:
        """A row of one number throughout, kept once."""
        key = (table.title, repr(value))
        if key not in self._kept:
            self._kept[key] = table.store(np.full(table.shape[2], value))
        return self._kept[key]

    # --- R ---

    def _reward(self) -> None:
        """An entry, a row over the observations or a matrix of next states by observations."""
        tokens, head = self.tokens, self.head
        S = head.counts[1]
        action = head.reference(tokens, "actions")
        if tokens.peek() != ":":
            raise tokens.error(f"expected ':', found {tokens.found()}")
        tokens.take()
        state = head.reference(tokens, "states")
        if not self._another("states"):
            self._reward_rows(action, state, np.arange(S), f"reward matrix of {S} rows")
            return
        following = head.reference(tokens, "states")
        if not self._another("observations"):
            self._reward_rows(action, state, np.array([following]), "reward row")
            return
        observation = head.reference(tokens, "observations")
        self._skip_colon()
        place = tokens.at
        value = tokens.numbers(1, "reward")[0]
        self.rewards.add([action, state, following, observation], value, place)

    def _reward_rows(self, action: int, state: int, following: np.ndarray, what: str) -> None:
        count = self.head.counts[2]
        place = self.tokens.at
        values, _ = self.tokens.numbers(count, what, len(following))
        indices = np.empty((*values.shape, 4), dtype=np.int64)
        indices[..., :2] = action, state
        indices[..., 2] = following[:, None]
        indices[..., 3] = np.arange(count)
        self.rewards.add(indices, values, np.full(values.size, place))

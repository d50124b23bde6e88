"""Read the statements T, O and R of a .pomdp file: plain ones in batches, all others one at a time."""

from __future__ import annotations

import numpy as np

from lcorpp.planning.formats.numbers import is_count
from lcorpp.planning.formats.pomdp.dialects import describe_foreign
from lcorpp.planning.formats.pomdp.preamble import ALL, Preamble
from lcorpp.planning.formats.pomdp.scanner import PlainTable, Scanner
from lcorpp.planning.formats.pomdp.tables import StoredRows, TableStatements, make_reward_columns
from lcorpp.planning.formats.pomdp.tokens import TABLE_KEYWORDS, Offsets, Tokens

_ROW_KEYWORDS = ("identity", "uniform", "reset")


class Statements:
    """Reads all tables.

    transition, observation: the statements of T and O. rewards: those of R, by action, state, next state and
        observation, each of which may be `ALL`. A later statement overrides earlier ones.
    """

    def __init__(self, tokens: Tokens, preamble: Preamble) -> None:
        self.tokens, self.preamble = tokens, preamble
        A, S, observations = preamble.counts
        self.transition = TableStatements("transition", (A, S, S))
        self.observation = TableStatements("observation", (A, S, observations))
        self.rewards = make_reward_columns()
        self._shared_rows: dict[tuple[str, str], StoredRows] = {}
        self._scanner = Scanner(preamble.indices, S, observations, is_mdp=preamble.is_mdp)
        if preamble.is_mdp:
            self.observation.set_rows(ALL, ALL, self._store_constant_row(self.observation, 1.0), 0)

    def read(self) -> None:
        """Read up to the end of the text. Raises ParseError."""
        tokens = self.tokens
        while not tokens.at_end():
            if not tokens.at_statement():
                raise tokens.unexpected_token()
            keyword = tokens.peek()
            if keyword not in TABLE_KEYWORDS:
                raise describe_foreign(tokens) or tokens.error(
                    f"{keyword!r} must come before the first T, O or R"
                )
            if keyword == "O" and self.preamble.is_mdp:
                raise tokens.error("O needs observations, which the preamble does not declare")
            plain = tokens.plain_statements(self._scanner)
            if plain is not None:
                self._add_plain(*plain)
                continue
            tokens.take()
            tokens.take()
            action = self.preamble.read_reference(tokens, "actions")
            if keyword == "R":
                self._read_reward(action)
            elif keyword == "T":
                self._read_rows(self.transition, action, "states")
            else:
                self._read_rows(self.observation, action, "observations")

    def _add_plain(self, transition: PlainTable, observation: PlainTable, reward: PlainTable) -> None:
        self.transition.add_plain(transition)
        indices, values = reward.entry_indices, reward.entry_values
        if self.preamble.is_mdp:
            for offsets in (observation.entry_offsets, observation.row_offsets):
                if len(offsets):
                    message = "O needs observations, which the preamble does not declare"
                    raise self.tokens.error(message, int(offsets[0]))
            indices = np.pad(indices, ((0, 0), (0, 1)), constant_values=ALL)
        self.observation.add_plain(observation)
        self.rewards.add(indices, values)

    def _take_reference_colon(self, kind: str) -> bool:
        """Take a colon, also a stray one before numbers; return whether a reference follows it."""
        tokens = self.tokens
        if tokens.peek() != ":":
            return False
        tokens.take()
        text = tokens.peek()
        if text in self.preamble.indices[kind] or is_count(text):
            return True
        return not (tokens.at_number() or text in _ROW_KEYWORDS)

    def _skip_colon(self) -> None:
        if self.tokens.peek() == ":":
            self.tokens.take()

    # --- T and O ---

    def _read_rows(self, table: TableStatements, action: int, columns: str) -> None:
        """Read an entry, a row or a matrix."""
        tokens, preamble = self.tokens, self.preamble
        if not self._take_reference_colon("states"):
            table.set_rows(action, ALL, *self._read_body(table, columns, matrix=True))
            return
        state = preamble.read_reference(tokens, "states")
        if not self._take_reference_colon(columns):
            table.set_rows(action, state, *self._read_body(table, columns, matrix=False))
            return
        column = preamble.read_reference(tokens, columns)
        self._skip_colon()
        offset = tokens.offset
        value = float(tokens.probabilities(1, f"{table.title} entry").dense()[0, 0])
        if column == ALL:
            table.set_rows(action, state, self._store_constant_row(table, value), offset)
        else:
            table.add_entry((action, state, column), value, offset)

    def _read_body(
        self, table: TableStatements, columns: str, *, matrix: bool
    ) -> tuple[StoredRows, int | Offsets]:
        """Read the numbers of a matrix or of one row, or a keyword; return the rows and their offsets."""
        tokens = self.tokens
        _, S, N = table.shape
        what = f"{table.title} matrix of {S} rows" if matrix else f"{table.title} row"
        offset, word = tokens.offset, tokens.peek()
        if word not in _ROW_KEYWORDS:
            numbers = tokens.probabilities(N, what, S if matrix else 1)
            rows = table.store(numbers.begins, numbers.columns, numbers.values)
            return (rows, numbers.offsets) if matrix else (rows.row(0), offset)
        fits = {"uniform": True, "reset": columns == "states", "identity": N == S and (matrix or S == 1)}
        if not fits[word]:
            raise tokens.error(f"{word!r} is not allowed for this {what}")
        tokens.take()
        if word == "uniform" or N == 1:
            return self._store_constant_row(table, 1.0 / N), offset
        if (table.title, word) not in self._shared_rows:
            rows = table.store_identity() if word == "identity" else table.store_row(self.preamble.start)
            self._shared_rows[table.title, word] = rows
        return self._shared_rows[table.title, word], offset

    def _store_constant_row(self, table: TableStatements, value: float) -> StoredRows:
        """Return a row of equal numbers, stored once."""
        key = (table.title, repr(value))
        if key not in self._shared_rows:
            self._shared_rows[key] = table.store_row(np.full(table.shape[2], value))
        return self._shared_rows[key]

    # --- R ---

    def _read_reward(self, action: int) -> None:
        """Read an entry, a row over the observations or a matrix of next states by observations.

        In an MDP: an entry without an observation, a row over the next states or a matrix of states by next
        states.
        """
        tokens, preamble, is_mdp = self.tokens, self.preamble, self.preamble.is_mdp
        if tokens.peek() != ":":
            if not is_mdp:
                raise tokens.error(f"expected ':', found {tokens.describe_next()}")
            self._read_reward_table((action,))
            return
        tokens.take()
        state = preamble.read_reference(tokens, "states")
        if not self._take_reference_colon("states"):
            self._read_reward_table((action, state))
            return
        next_state = preamble.read_reference(tokens, "states")
        if self._take_reference_colon("observations"):
            observation = preamble.read_reference(tokens, "observations")
            self._skip_colon()
        elif is_mdp:
            observation = ALL
        else:
            self._read_reward_table((action, state, next_state))
            return
        self.rewards.add([action, state, next_state, observation], tokens.number("reward"))

    def _read_reward_table(self, scope: tuple[int, ...]) -> None:
        """Read a row or a matrix over the last axes of R; its numbers override its whole scope."""
        A, S, observations = self.preamble.counts
        last = 2 if self.preamble.is_mdp else 3  # axis of the columns
        is_row = len(scope) == last
        title, rows = ("reward row", 1) if is_row else (f"reward matrix of {S} rows", S)
        numbers = self.tokens.numbers((A, S, S, observations)[last], title, rows)
        self.rewards.add([*scope, *[ALL] * (4 - len(scope))], 0.0)
        indices = np.full((len(numbers.values), 4), ALL, dtype=np.int32)
        indices[:, : len(scope)] = scope
        indices[:, last] = numbers.columns
        if not is_row:
            indices[:, last - 1] = np.repeat(np.arange(rows), np.diff(numbers.begins))
        self.rewards.add(indices, numbers.values)

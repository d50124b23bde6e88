"""Statements in any order give the same tables as writing them into dense arrays."""

from __future__ import annotations

from dataclasses import dataclass
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import SparseTables
from lcorpp.planning.formats.pomdp import (
    rewards as pomdp_rewards,
    scanner as pomdp_scanner,
    tables as pomdp_tables,
)
from lcorpp.planning.formats.pomdp.preamble import read_preamble
from lcorpp.planning.formats.pomdp.rewards import expected_rewards
from lcorpp.planning.formats.pomdp.statements import Statements
from lcorpp.planning.formats.pomdp.tokens import Tokens
from tests.planning.formats.pomdp.texts import head

S, A, O = 3, 2, 2  # noqa: E741
SIZES = {"T": (A, S, S), "O": (A, S, O), "R": (A, S, S, O)}
PROBABILITIES = st.sampled_from([0.0, 0.0, 0.25, 0.5, 1.0])
REWARDS = st.sampled_from([0.0, -1.0, 2.0, 10.5])
START = np.array([0.25, 0.0, 0.75])


@dataclass
class Statement:
    """keyword: T, O or R. indices: a prefix of them, None for all. body: values for the remaining axes."""

    keyword: str
    indices: tuple[int | None, ...]
    body: str | np.ndarray

    def text(self) -> str:
        words = ["*" if index is None else str(index) for index in self.indices]
        body = self.body if isinstance(self.body, str) else " ".join(map(repr, self.body.ravel().tolist()))
        return f"{self.keyword}: {' : '.join(words)} {body}"

    def write(self, tables: dict[str, np.ndarray], given: dict[str, np.ndarray]) -> None:
        scope = tuple(slice(None) if index is None else index for index in self.indices)
        N = SIZES[self.keyword][-1]
        whole = {"identity": np.eye(S), "uniform": np.full(N, 1 / N), "reset": START}
        tables[self.keyword][scope] = whole[self.body] if isinstance(self.body, str) else self.body
        given[self.keyword][scope[:2]] = True


@st.composite
def statements(draw: st.DrawFn, keywords: str) -> Statement:
    keyword = draw(st.sampled_from(keywords))
    sizes = SIZES[keyword]
    length = draw(st.integers(2 if keyword == "R" else 1, len(sizes)))
    indices = tuple(draw(st.none() | st.integers(0, size - 1)) for size in sizes[:length])
    words = []
    if keyword != "R" and length < 3:
        words = ["uniform"] + ["reset"] * (keyword == "T") + ["identity"] * (keyword == "T" and length == 1)
    if words and draw(st.booleans()):
        return Statement(keyword, indices, draw(st.sampled_from(words)))
    shape = sizes[length:]
    numbers = REWARDS if keyword == "R" else PROBABILITIES
    count = int(np.prod(shape))
    return Statement(
        keyword, indices, np.array(draw(st.lists(numbers, min_size=count, max_size=count))).reshape(shape)
    )


def dense_tables(given: list[Statement]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    tables = {keyword: np.zeros(sizes) for keyword, sizes in SIZES.items()}
    rows = {keyword: np.zeros(sizes[:2], dtype=bool) for keyword, sizes in SIZES.items()}
    for statement in given:
        statement.write(tables, rows)
    return tables, rows


def read_all(given: list[Statement]) -> Statements:
    text = head(S, A, O) + "start: " + " ".join(map(str, START)) + "\n"
    text += "".join(statement.text() + "\n" for statement in given)
    tokens = Tokens(text.encode(), "<text>")
    read = Statements(tokens, read_preamble(tokens))
    read.read()
    return read


@pytest.mark.parametrize("batch_size", [1, 3, 10**6])
@given(given=st.lists(statements("TTOO"), max_size=14))
@settings(max_examples=12)
def test_tables_are_what_the_statements_write(batch_size, given):
    """With statements in small batches, and rows in small parts."""
    with patch.object(pomdp_scanner, "MAX_NUMBERS", batch_size):
        read = read_all(given)
    tables, rows = dense_tables(given)
    for keyword, table in (("T", read.transition), ("O", read.observation)):
        with patch.object(pomdp_tables, "PART_ROWS", batch_size):
            rows_read, offsets = table.take_rows()
        assert (rows_read.dense == tables[keyword]).all()
        assert ((offsets >= 0) == rows[keyword]).all()


@pytest.mark.parametrize("batch_size", [1, 2, 3, 10**6])
def test_entries_after_a_row_for_all_override_it(batch_size):
    half = np.full(3, 1 / 3)
    given = [
        Statement("T", (0, 0), np.eye(3)[0]),
        Statement("T", (None, None), half),
        Statement("T", (0, 0, 0), np.array(0.25)),
        Statement("T", (1, 2), np.eye(3)[1]),
    ]
    with patch.object(pomdp_scanner, "MAX_NUMBERS", batch_size):
        rows, _ = read_all(given).transition.take_rows()
    assert rows[0, 0].tolist() == [0.25, 1 / 3, 1 / 3]
    assert rows[1].tolist() == [half.tolist(), half.tolist(), [0, 1, 0]]


@st.composite
def distributions(draw: st.DrawFn, N: int) -> np.ndarray:
    weights = draw(
        st.lists(
            st.lists(st.integers(0, 3), min_size=N, max_size=N).filter(any), min_size=A * S, max_size=A * S
        )
    )
    table = np.array(weights, dtype=float).reshape(A, S, N)
    return table / table.sum(axis=2, keepdims=True)


@pytest.mark.parametrize("batch_size", [1, 3, 10**6])
@given(given=st.lists(statements("R"), max_size=10), T=distributions(S), Z=distributions(O))
@settings(max_examples=10)
def test_expected_rewards_are_the_explicit_sums(batch_size, given, T, Z):
    """With small chunks, matrix products replace looking up all cases."""
    expected = np.einsum("ast,ato,asto->as", T, Z, dense_tables(given)[0]["R"])
    with patch.object(pomdp_rewards, "CHUNK_CASES", batch_size):
        reward = expected_rewards(SparseTables.of(T), SparseTables.of(Z), read_all(given).rewards)
    assert reward == pytest.approx(expected, abs=1e-12)  # a handful of roundings of numbers up to 10


@given(given=st.lists(statements("TTOOR"), min_size=1, max_size=8), data=st.data())
@settings(max_examples=30)
def test_the_offset_of_a_row_is_that_of_the_last_statement_about_it(given, data):
    read = read_all(given)
    text = read.tokens.text
    keyword = data.draw(st.sampled_from("TO"))
    _, offsets = (read.transition if keyword == "T" else read.observation).take_rows()
    for a in range(A):
        for s in range(S):
            matching = [
                number
                for number, each in enumerate(given)
                if each.keyword == keyword
                and all(i in (None, own) for i, own in zip(each.indices, (a, s), strict=False))
            ]
            if not matching:
                assert offsets[a, s] == -1
            else:
                assert text[: offsets[a, s]].count(b"\n") == 6 + matching[-1]

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import csr_array

from lcorpp.errors import ModelError
from lcorpp.planning import SparseTables

tables = st.tuples(st.integers(1, 3), st.integers(1, 4), st.integers(1, 4)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=st.sampled_from([0.0, 0.0, 0.25, 1.0, -2.0]))
)


@given(tables)
def test_tables_round_trip(table):
    rows = SparseTables.of(table)
    assert (rows.dense == table).all()
    assert (np.asarray(rows) == table).all()
    assert rows.values.all()
    assert (SparseTables.of([csr_array(part) for part in table]).dense == table).all()
    place = np.nonzero(table.reshape(-1, table.shape[2]))
    order = np.random.default_rng(0).permutation(len(place[0]))
    again = SparseTables.of_entries(table.shape, place[0][order], place[1][order], rows.values[order])
    assert (again.dense == table).all()
    assert rows.row_sums() == pytest.approx(table.sum(axis=2))
    for a in range(len(table)):
        weights, worth = np.arange(table.shape[1]) + 1.0, np.arange(table.shape[2]) - 1.0
        assert rows.forward(a, weights) == pytest.approx(weights @ table[a])
        other = np.arange(len(table))[::-1]
        many = np.outer(np.arange(len(table)), weights)
        assert (
            rows.forward_many(other, many) == [rows.forward(*each) for each in zip(other, many, strict=True)]
        ).all()
        assert rows.backward(a, worth) == pytest.approx(table[a] @ worth)
        columns, values = rows.row(a, 0)
        assert table[a, 0, columns].tolist() == values.tolist()


def test_the_last_duplicate_entry_counts():
    rows = SparseTables.of_entries((1, 2, 2), [1, 0, 1, 0], [1, 0, 1, 0], [0.5, 1.0, 0.75, 0.0])
    assert rows.dense.tolist() == [[[0.0, 0.0], [0.0, 0.75]]]


def test_zeros_are_dropped():
    rows = SparseTables(
        (1, 3, 2), np.array([0, 2, 3, 4]), np.array([0, 1, 1, 0]), np.array([0.0, 1.0, 0.0, 2.0])
    )
    assert (rows.begins.tolist(), rows.columns.tolist(), rows.values.tolist()) == (
        [0, 1, 1, 2],
        [1, 0],
        [1.0, 2.0],
    )


def test_row_entries_gives_entries_and_their_rows():
    rows = SparseTables.of(np.array([[[0.5, 0.5], [0, 1.0]], [[1, 0], [0.25, 0.75]]]))
    index, owner = rows.row_entries(np.array([3, 1, 0]))
    assert rows.values[index].tolist() == [0.25, 0.75, 1.0, 0.5, 0.5]
    assert owner.tolist() == [0, 0, 1, 2, 2]


def test_tables_are_read_only():
    values = np.ones(2)
    rows = SparseTables((1, 2, 2), np.array([0, 1, 2]), np.array([0, 1]), values)
    values[:] = 7
    assert rows.values.tolist() == [1.0, 1.0]
    with pytest.raises(ValueError, match="read-only"):
        rows.values[0] = 3


@pytest.mark.parametrize(
    ("begins", "columns"),
    [([0, 1], [0]), ([0, 2, 1], [0]), ([1, 1, 1], [0]), ([0, 1, 2], [0, 2]), ([0, 1, 2], [0, -1])],
)
def test_arrays_of_wrong_shape(begins, columns):
    with pytest.raises(ModelError, match="are not a table"):
        SparseTables((1, 2, 2), np.array(begins), np.array(columns), np.ones(len(columns)))


def test_columns_must_increase():
    with pytest.raises(ModelError, match="the columns of a row must increase"):
        SparseTables((1, 1, 3), np.array([0, 2]), np.array([2, 1]), np.ones(2))


@pytest.mark.parametrize("table", ["ab", [[1.0]], [["a"]], None])
def test_invalid_tables(table):
    with pytest.raises(ModelError, match="a table"):
        SparseTables.of(table)


@pytest.mark.parametrize("columns", [np.array([0, 2**31]), np.array([0.0, 0.5])])
def test_columns_beyond_32_bits_are_rejected(columns):
    """A number beyond 32 bits would wrap to another state."""
    with pytest.raises(ModelError, match="whole numbers up to 2147483647"):
        SparseTables((1, 1, 2), np.array([0, 2]), columns, np.array([0.5, 0.5]))

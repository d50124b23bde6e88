from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import FileError, ModelError
from lcorpp.planning import Pomdp, SparseTables, format_pomdp, parse_pomdp, read_pomdp, write_pomdp
from tests.planning.formats.pomdp.texts import BODY, HEAD, PUBLISHED, same
from tests.planning.models import pomdps, shared_model


@pytest.mark.parametrize("name", PUBLISHED or ["tiger.95.pomdp"])
def test_published_models_are_read_and_written_back(name, tmp_path):
    pomdp = read_pomdp(shared_model(name))
    write_pomdp(pomdp, tmp_path / "copy.pomdp")
    assert same(read_pomdp(tmp_path / "copy.pomdp"), pomdp)


@given(pomdps())
@settings(max_examples=15)
def test_write_then_read_is_the_same(pomdp):
    assert same(parse_pomdp(format_pomdp(pomdp)), pomdp)


@st.composite
def sparse_pomdps(draw: st.DrawFn) -> Pomdp:
    """Models of up to some hundred states with one to four entries in a row, numbers of any magnitude."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    S, A, count = draw(st.integers(1, 300)), draw(st.integers(1, 3)), draw(st.integers(1, 30))

    def rows(N: int) -> SparseTables:
        row = np.repeat(np.arange(A * S), 4)
        column = rng.integers(N, size=len(row))
        # no weight is below 1e-200, so that the inverse of the sum of a row is finite
        weights = np.maximum(rng.random(len(row)) ** draw(st.sampled_from([1, 60])), 1e-200)
        rough = SparseTables.of_entries((A, S, N), row, column, weights)
        return rough.scale_rows(1 / rough.row_sums())

    names = draw(st.sampled_from(["s{}", "{}", "a.b-{}", "é{}", "1_{}", "-{}x"]))
    start = rng.random(S)
    return Pomdp(
        tuple(names.format(i) for i in range(S)),
        tuple(f"a{i}" for i in range(A)),
        tuple(str(i) for i in range(count)),
        rows(S),
        rows(count),
        np.where(rng.random((A, S)) < 0.5, rng.normal(size=(A, S)) * 10.0 ** draw(st.integers(-200, 100)), 0),
        draw(st.floats(0.01, 0.999)),
        start / start.sum(),
    )


@given(sparse_pomdps())
@settings(max_examples=20)
def test_sparse_models_are_written_and_read_exactly(pomdp):
    back = parse_pomdp(format_pomdp(pomdp))
    assert same(back, pomdp)
    assert (back.states, back.actions, back.observations) == (pomdp.states, pomdp.actions, pomdp.observations)


@pytest.mark.parametrize(
    "name", ["two words", "T", "3", "a:b", "*", "x#", "", "uniform", "\ud800", "a\u2028b"]
)
def test_names_that_a_file_cannot_contain_raise_an_error(name):
    pomdp = parse_pomdp(HEAD + BODY)
    unwritable = Pomdp(
        (name, "b"),
        *(getattr(pomdp, f) for f in ("actions", "observations", "transition", "observation")),
        pomdp.reward,
        0.9,
        pomdp.start,
    )
    with pytest.raises(ModelError, match="cannot be written"):
        format_pomdp(unwritable)


def test_a_missing_folder_raises_an_error(tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        write_pomdp(parse_pomdp(HEAD + BODY), tmp_path / "missing" / "x.pomdp")

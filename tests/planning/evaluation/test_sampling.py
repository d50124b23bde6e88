from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError
from lcorpp.planning.evaluation.sampling import CounterRng, InverseCdfSampler, splitmix64

ROWS = st.lists(st.lists(st.integers(0, 4), min_size=1, max_size=9).filter(any), min_size=1, max_size=5)


@given(ROWS, st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=20))
@settings(max_examples=50)
def test_a_sample_is_the_first_entry_whose_sum_exceeds_the_number(rows, numbers):
    begins = np.cumsum([0, *map(len, rows)])
    columns = np.concatenate([np.arange(len(row)) + 10 for row in rows]).astype(np.int32)
    draws = InverseCdfSampler(begins, columns, np.concatenate(rows).astype(float))
    for r, row in enumerate(rows):
        sums = np.cumsum(np.array(row, dtype=float)) / sum(row)
        found = draws.draw(np.full(len(numbers), r), np.array(numbers))
        assert found.tolist() == [10 + int(np.argmax(sums > u)) for u in numbers]
        assert all(row[c - 10] > 0 for c in found)


def test_long_and_short_rows_agree():
    weights = np.random.default_rng(0).random(100)
    for count in (64, 65, 100):  # the limit is 64
        draws = InverseCdfSampler(np.array([0, count]), np.arange(count, dtype=np.int32), weights[:count])
        numbers = np.linspace(0, 1, 1000, endpoint=False)
        sums = np.cumsum(weights[:count])
        expected = np.searchsorted(sums / sums[-1], numbers, side="right")
        assert np.array_equal(draws.draw(np.zeros(1000, dtype=np.intp), numbers), expected)


def test_splitmix64_gives_its_published_numbers():
    state = np.array([1234567], dtype=np.uint64)
    found = []
    for _ in range(5):
        state = state + np.uint64(0x9E3779B97F4A7C15)
        found.append(int(splitmix64(state.copy())[0]))
    assert found == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]


def test_a_number_depends_on_seed_trial_and_counter_only():
    rng = CounterRng(7)
    keys = rng.trial_keys(0, 1000)
    assert np.array_equal(rng.trial_keys(300, 5), keys[300:305])
    numbers = rng.uniforms(keys, 4)
    assert np.array_equal(CounterRng(7).uniforms(keys[300:305], 4), numbers[300:305])
    assert not np.intersect1d(numbers, rng.uniforms(keys, 5)).size
    assert not np.intersect1d(numbers, CounterRng(8).uniforms(CounterRng(8).trial_keys(0, 1000), 4)).size


def test_the_numbers_are_uniform_and_independent():
    rng, n, cells = CounterRng(0), 100_000, 32
    keys = rng.trial_keys(0, n)
    columns = [rng.uniforms(keys, place) for place in range(4)]
    columns.append(np.roll(columns[0], 1))  # the previous trial
    assert min(c.min() for c in columns) >= 0
    assert max(c.max() for c in columns) < 1
    for i, one in enumerate(columns):
        for other in columns[i + 1 :]:
            counts, *_ = np.histogram2d(one, other, bins=cells, range=[[0, 1], [0, 1]])
            share = n / cells**2
            chi = float(((counts - share) ** 2 / share).sum())
            # chi squared with 1023 degrees of freedom: mean 1023, deviation 45; five of them are allowed
            assert abs(chi - (cells**2 - 1)) < 5 * (2 * (cells**2 - 1)) ** 0.5


@pytest.mark.parametrize("seed", [-1, 0.5, True, "7", None])
def test_invalid_seeds(seed):
    with pytest.raises(ModelError, match="a seed is a whole number from 0"):
        CounterRng(seed)

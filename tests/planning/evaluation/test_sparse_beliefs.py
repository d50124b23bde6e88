from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.planning import SparseTables, observation_probabilities, parse_pomdp, update
from lcorpp.planning.evaluation import sparse_beliefs as module
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs, gather_entries
from tests.planning.models import TIGER, pomdps

tiger = parse_pomdp(TIGER)


def points(pomdp, draw):
    """Return some beliefs of a model, including its start, and an action for each."""
    S = len(pomdp.states)
    dense = np.array([pomdp.start, *np.eye(S), np.full(S, 1 / S)])
    actions = np.array([draw(st.integers(0, len(pomdp.actions) - 1)) for _ in dense])
    return dense, actions


@given(pomdps(), st.data())
@settings(max_examples=20)
def test_batches_agree_with_single_updates(pomdp, data):
    dense, actions = points(pomdp, data.draw)
    S = len(pomdp.states)
    spread = SparseBeliefs.of(dense).predict(pomdp, actions)
    owner, observation, parts = spread.posteriors(pomdp, actions)
    for i, (belief, a) in enumerate(zip(dense, actions, strict=True)):
        assert spread.dense(i, S) == pytest.approx(pomdp.transition.forward(a, belief))
        chances = observation_probabilities(pomdp, belief, a)
        mine = np.flatnonzero(owner == i)
        assert observation[mine].tolist() == np.flatnonzero(chances).tolist()
        assert parts.totals()[mine] == pytest.approx(chances[observation[mine]])
        for k in mine:
            o = int(observation[k])
            after = update(pomdp, belief, a, o)
            seen = spread.condition(pomdp, actions, np.full(len(dense), o))
            assert np.array_equal(seen.dense(i, S), parts.dense(int(k), S))
            # 40 digits: relative error at most 2**-41, plus rounding of doubles
            assert parts.round_weights().dense(int(k), S) == pytest.approx(after, rel=2.0**-40, abs=0)


@given(pomdps(), st.data())
@settings(max_examples=10)
def test_posteriors_do_not_depend_on_the_batch(pomdp, data):
    dense, actions = points(pomdp, data.draw)

    def compute_posteriors(which):
        predicted = SparseBeliefs.of(dense[which]).predict(pomdp, actions[which])
        return predicted.posteriors(pomdp, actions[which]).parts.round_weights()

    together, alone = compute_posteriors(slice(None)), [compute_posteriors([i]) for i in range(len(dense))]
    for field in ("sizes", "states", "weights"):
        assert np.array_equal(
            getattr(together, field), np.concatenate([getattr(part, field) for part in alone])
        )


def test_rounding_merges_equal_beliefs():
    listen = np.array([0])
    one = SparseBeliefs.of(tiger.start[None])
    for o in (0, 1):
        one = one.predict(tiger, listen).condition(tiger, listen, np.array([o])).round_weights()
    assert one.keys() == SparseBeliefs.of(tiger.start[None]).round_weights().keys()


def test_keys_distinguish_beliefs():
    dense = np.array([[0.5, 0.5], [0.5, 0.5], [0.25, 0.75], [0.75, 0.25], [1.0, 0.0], [0.0, 1.0]])
    keys = SparseBeliefs.of(dense).keys()
    assert keys[0] == keys[1]
    assert len(set(keys)) == 5


def test_take_and_chunks(monkeypatch):
    dense = np.array([[0.5, 0.5, 0.0], [0.0, 0.0, 1.0], [0.2, 0.3, 0.5], [1.0, 0.0, 0.0]])
    beliefs = SparseBeliefs.of(dense)
    assert beliefs.take(np.array([2, 0])).dense(0, 3).tolist() == [0.2, 0.3, 0.5]
    monkeypatch.setattr(module, "MAX_CHUNK_ENTRIES", 3)
    assert [(run.start, run.stop) for run in beliefs.chunks()] == [(0, 2), (2, 3), (3, 4)]
    assert [(run.start, run.stop) for run in beliefs.chunks(9)] == [(0, 1), (1, 2), (2, 3), (3, 4)]


def test_entries_from_sparse_and_dense_tables_agree(monkeypatch):
    rng = np.random.default_rng(3)
    dense = rng.random((3, 7, 11)) * (rng.random((3, 7, 11)) < 0.4)
    dense[1, 2] = 0
    table = SparseTables.of(dense)
    a, r, n = (np.ravel(axis) for axis in np.indices(dense.shape))
    assert np.array_equal(gather_entries(table, a, r, n), dense.ravel())
    monkeypatch.setattr(module, "MAX_DENSE_ENTRIES", 0)
    assert np.array_equal(gather_entries(table, a, r, n), dense.ravel())

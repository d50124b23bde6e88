from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from lcorpp.errors import ModelError
from lcorpp.planning import AlphaVectors, BatchPolicy, Policy, parse_pomdp
from lcorpp.planning.evaluation import batch_policy as module
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from tests.planning.models import TIGER

tiger = parse_pomdp(TIGER)
NAMES = tuple("abcdef"), tuple("xyz")


@st.composite
def pieces(draw):
    """Draw policies over six states in one to four vector sets, with frequent ties."""
    parts = []
    for _ in range(draw(st.integers(1, 4))):
        states = sorted(draw(st.sets(st.integers(0, 5), min_size=1)))
        count = draw(st.integers(1, 4))
        numbers = st.lists(st.integers(-3, 3), min_size=len(states), max_size=len(states))
        vectors = [draw(numbers) for _ in range(count)]
        parts.append(AlphaVectors(states, vectors, [draw(st.integers(0, 2)) for _ in range(count)]))
    return Policy(tuple(parts), *NAMES, floor=-5.0)


@st.composite
def dyadic(draw):
    """Beliefs in sixteenths: sums of their products with whole numbers are exact in any order."""
    cuts = sorted(draw(st.lists(st.integers(0, 16), min_size=5, max_size=5)))
    return np.diff([0, *cuts, 16]) / 16


@given(pieces(), st.lists(dyadic(), min_size=1, max_size=8))
@settings(max_examples=25)
def test_a_batch_agrees_with_single_beliefs(policy, beliefs):
    values, actions = BatchPolicy(policy).values_and_actions(np.array(beliefs))
    for belief, value, action in zip(beliefs, values, actions, strict=True):
        assert (value, action) == policy.value_and_action(belief)


@given(pieces(), st.lists(dyadic(), min_size=1, max_size=8))
@settings(max_examples=15)
def test_results_do_not_depend_on_the_batch(policy, beliefs):
    scaled = np.array(beliefs) / 3  # not exact: the order of summation matters
    together = BatchPolicy(policy).best(SparseBeliefs.of(scaled))
    for i in range(len(beliefs)):
        alone = BatchPolicy(policy).best(SparseBeliefs.of(scaled[i : i + 1]))
        assert (alone.values[0], alone.vectors[0]) == (together.values[i], together.vectors[i])


def test_sparse_and_dense_products_choose_the_same(monkeypatch):
    rng = np.random.default_rng(5)
    beliefs = rng.dirichlet(np.full(40, 0.05), size=200)
    beliefs[beliefs < 0.01] = 0
    policy = Policy(
        (AlphaVectors(np.arange(40), rng.normal(size=(30, 40)), np.arange(30) % 3),), ("s",) * 40, NAMES[1]
    )
    found = []
    for share in (0, 10**9):
        monkeypatch.setattr(module, "SPARSE_RATIO", share)
        found.append(BatchPolicy(policy).best(SparseBeliefs.of(beliefs)))
    assert np.array_equal(found[0].values, found[1].values)
    assert np.array_equal(found[0].vectors, found[1].vectors)
    monkeypatch.setattr(module, "MAX_PRODUCTS", 100)  # in several blocks
    assert np.array_equal(BatchPolicy(policy).best(SparseBeliefs.of(beliefs)).values, found[0].values)


def test_many_almost_equal_vectors(monkeypatch):
    """Forty vectors that differ by rounding: one by one and by a sparse product."""
    rng = np.random.default_rng(6)
    beliefs = rng.dirichlet(np.ones(6), size=50)
    vectors = rng.normal(size=6) * (1 + 1e-15 * rng.integers(0, 3, (40, 1)))
    policy = Policy((AlphaVectors(np.arange(6), vectors, np.arange(40) % 3),), *NAMES)
    found = []
    for limit in (0, 40):
        monkeypatch.setattr(module, "MAX_NEAR", limit)
        found.append(BatchPolicy(policy).best(SparseBeliefs.of(beliefs)))
    assert found[0].values == pytest.approx(found[1].values, rel=1e-15)
    assert found[0].values == pytest.approx((beliefs @ vectors.T).max(axis=1), rel=1e-14)


def test_the_first_of_equal_vectors_counts():
    policy = Policy.of(tiger, [[1.0, 3.0], [2.0, 2.0], [3.0, 1.0]], [2, 1, 0])
    assert BatchPolicy(policy).values_and_actions(np.array([[0.5, 0.5]]))[1].tolist() == [2]


def test_an_empty_batch_and_a_wrong_shape():
    policy = Policy.of(tiger, [[1.0, 3.0]], [2])
    assert [len(part) for part in BatchPolicy(policy).values_and_actions(np.zeros((0, 2)))] == [0, 0]
    with pytest.raises(ModelError, match=r"beliefs over 2 states cannot have shape \(2,\)"):
        BatchPolicy(policy).values_and_actions(np.array([0.5, 0.5]))


def test_the_layout_is_shared_and_does_not_keep_its_policy():
    policy = Policy.of(tiger, [[1.0, 3.0]], [2])
    layout, reference = module.batch_policy(policy), weakref.ref(policy)
    assert module.batch_policy(policy) is layout
    del policy
    gc.collect()
    assert reference() is None

"""The cache of predictions: each evidence is computed once, within a limit; likelihoods are not kept."""

import numpy as np

from lcorpp.trust import evidence_cache
from lcorpp.trust.evidence_cache import EvidenceCache
from lcorpp.values import Likelihood


def make_cache():
    """Return a cache, a function that is cached, and the evidences for which it was called."""
    calls = []

    def compute(evidence):
        calls.append(dict(evidence))
        return np.array([float(len(evidence))])

    return EvidenceCache(), compute, calls


def test_equal_evidence_is_computed_once():
    cache, compute, calls = make_cache()
    found = [cache.find({"sky": sky}, compute) for sky in ("grey", "sunny", "grey")]
    assert found[0] is found[2]
    assert calls == [{"sky": "grey"}, {"sky": "sunny"}]


def test_a_full_cache_is_cleared(monkeypatch):
    monkeypatch.setattr(evidence_cache, "MAX_CACHED_PREDICTIONS", 2)
    cache, compute, calls = make_cache()
    for sky in ("grey", "sunny", "grey", "dark", "grey"):
        cache.find({"sky": sky}, compute)
    assert [each["sky"] for each in calls] == ["grey", "sunny", "dark", "grey"]


def test_evidence_with_a_likelihood_is_computed_each_time():
    cache, compute, calls = make_cache()
    evidence = {"sky": "grey", "label": Likelihood(("yes", "no"), np.array([0.7, 0.3]))}
    assert [cache.find(evidence, compute).tolist() for _ in range(2)] == [[2.0], [2.0]]
    assert len(calls) == 2

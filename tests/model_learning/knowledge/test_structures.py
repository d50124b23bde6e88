"""The best network and the probabilities of edges, compared with the enumeration of all networks."""

from itertools import product

import numpy as np
import pytest

from lcorpp.model_learning.knowledge.scores import EQUIVALENT_RECORDS, MAX_EDGE_ODDS, score_sets
from lcorpp.model_learning.knowledge.structures import average_edges, find_best


def list_networks(n, before=()):
    """Yield the adjacency matrix of each acyclic network that some order of the constraints allows."""
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    for kinds in product(range(3), repeat=len(pairs)):
        edges = np.zeros((n, n), dtype=int)
        for (i, j), kind in zip(pairs, kinds, strict=True):
            if kind:
                edges[(i, j) if kind == 1 else (j, i)] = 1
        ordered = edges.copy()
        for i, j in before:
            ordered[i, j] = 1
        if not np.linalg.matrix_power(ordered, n).any():  # no path of n edges: no circle
            yield edges


def score(edges, scores):
    total = 0.0
    for j in range(len(edges)):
        parents = sum(1 << int(i) for i in np.flatnonzero(edges[:, j]))
        total += scores[parents | 1 << j] - scores[parents]
    return total


@pytest.mark.parametrize("before", [(), ((0, 3), (2, 1))])
@pytest.mark.parametrize("scale", [0, 1, 30])
def test_the_best_network_and_its_edges_are_those_of_the_enumeration(scale, before):
    scores = scale * np.random.default_rng(scale).normal(size=16)
    networks = list(list_networks(4, before))
    assert before or len(networks) == 543  # the number of acyclic networks of four attributes
    values = np.array([score(edges, scores) for edges in networks])
    weights = np.exp(values - values.max())
    expected = np.einsum("g,gij->ij", weights / weights.sum(), np.array(networks))
    assert average_edges(scores, before) == pytest.approx(expected, abs=1e-12)
    parents = find_best(scores, before)
    found = np.zeros((4, 4), dtype=int)
    for j, own in enumerate(parents):
        found[list(own), j] = 1
    assert any((found == edges).all() for edges in networks)
    assert score(found, scores) == pytest.approx(values.max(), abs=1e-9)


def test_without_data_all_edges_of_twelve_attributes_are_equally_probable():
    edges = average_edges(np.zeros(1 << 12))
    off = edges[~np.eye(12, dtype=bool)]
    # of n attributes: a(n) networks; the share with an edge tends to 1/4 of the pairs from above
    assert off == pytest.approx(np.full(132, off[0]), abs=1e-12)
    assert 0.25 < off[0] < 0.5
    assert not np.diag(edges).any()


def test_scores_are_the_probability_of_the_data():
    """That of an attribute given others: the product of what is expected after the records before."""
    rows = np.random.default_rng(0).integers([2, 3, 2], size=(40, 3))
    scores = score_sets(rows, np.ones(40), (2, 3, 2))
    logs, counts = 0.0, {}
    for x, y, z in rows.tolist():  # y given x and z
        before = sum(counts.get((x, own, z), 0) for own in range(3))
        expected = counts.get((x, y, z), 0) + EQUIVALENT_RECORDS / 12
        logs += np.log(expected / (before + EQUIVALENT_RECORDS / 4))
        counts[x, y, z] = counts.get((x, y, z), 0) + 1
    assert scores[0b111] - scores[0b101] == pytest.approx(logs + 2 * np.log(MAX_EDGE_ODDS))


def test_scores_of_many_values_and_of_fractions_of_records():
    """Codes of many joint values are numbered again; a record in two halves is one record."""
    rows = np.random.default_rng(1).integers(9, size=(200, 4))
    scores = score_sets(rows, np.ones(200), (9, 9, 9, 9))
    halves = score_sets(np.repeat(rows, 2, axis=0), np.full(400, 0.5), (9, 9, 9, 9))
    possible = np.isfinite(scores)
    assert halves[possible] == pytest.approx(scores[possible])
    shuffled = score_sets(rows[:, [3, 1, 2, 0]], np.ones(200), (9, 9, 9, 9))
    assert shuffled[0b0011] == pytest.approx(scores[0b1010])
    # 81 joint values of two have two records each, 729 of three have not
    assert possible.tolist() == [members.bit_count() < 3 for members in range(16)]


def test_few_edges_are_found_in_noise():
    """Twelve coins, 100 times: of 66 pairs few are linked."""
    found = 0
    for seed in range(5):
        rows = np.random.default_rng(seed).integers(2, size=(100, 12))
        scores = score_sets(rows, np.ones(100), (2,) * 12)
        found += sum(map(len, find_best(scores)))
        edges = average_edges(scores)
        assert np.mean(edges + edges.T) < 0.15
    assert found <= 12

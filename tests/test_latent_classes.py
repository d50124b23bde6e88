"""Expected counts of latent classes equal those of all assignments of classes, one by one."""

from itertools import product

import numpy as np
import pytest

from lcorpp.latent_classes import LatentClasses, index_counts


def test_expected_counts_are_those_of_all_assignments_of_classes():
    rng = np.random.default_rng(0)
    contexts, weights = np.array([1, 0, 1]), np.array([1.0, 2.0, 0.5])
    labels, answers = index_counts(np.array([2, -1, 0]), 3), rng.integers(3, size=(3, 2)).astype(float)
    pi, rates, rows = (rng.dirichlet(np.ones(k), size=2) for k in (2, 3, 2))
    found = LatentClasses(contexts, weights, (labels, answers)).expect(
        np.log(pi), [np.log(rates), np.log(rows)]
    )
    total, classes = 0.0, np.zeros((3, 2))
    for chosen in product(range(2), repeat=3):
        p = 1.0
        for case, value in enumerate(chosen):
            p *= pi[contexts[case], value]
            p *= np.prod(rates[value] ** labels[case]) * np.prod(rows[value] ** answers[case])
        total += p
        classes[np.arange(3), list(chosen)] += p
    classes /= total
    np.testing.assert_allclose(found.classes, classes, atol=1e-12)
    np.testing.assert_allclose(found.contexts[1], classes[0] + 0.5 * classes[2], atol=1e-12)
    np.testing.assert_allclose(found.answers[0][:, 2], classes[0], atol=1e-12)
    np.testing.assert_allclose(found.answers[1], (classes * weights[:, None]).T @ answers, atol=1e-12)
    alone = LatentClasses(contexts, np.ones(3), (labels, answers)).expect(
        np.log(pi), [np.log(rates), np.log(rows)]
    )
    assert alone.log_likelihood == pytest.approx(np.log(total))

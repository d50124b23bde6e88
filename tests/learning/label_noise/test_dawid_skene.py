"""Dawid and Skene's model: known error rates are recovered, the classes are calibrated, and the laws hold."""

import numpy as np
import pytest

from lcorpp.errors import DataError
from lcorpp.learning.label_noise.answer_source import AnswerSource
from lcorpp.learning.label_noise.dawid_skene import CONTEXT_WEIGHT, estimate_classes
from lcorpp.learning.label_noise.rate_samples import sample_rates

FIRST = np.array([[0.8, 0.2], [0.35, 0.65]])  # P(answer | class)
SECOND = np.array([[0.6, 0.4], [0.1, 0.9]])
LABEL = np.array([[0.75, 0.25], [0.3, 0.7]])
PRIORS = np.array([[0.7, 0.3], [0.2, 0.8], [0.5, 0.5]])  # of each context


def answer(rng, classes, matrix, most=3):
    """(N, O) the answers of each case to a question that is asked 0 to `most` times."""
    counts = [rng.multinomial(rng.integers(most + 1), matrix[c]) for c in classes]
    return np.array(counts, dtype=float)


def make_cases(n, seed=0):
    """True classes, contexts, and three sources whose prior knowledge is vague and partly wrong."""
    rng = np.random.default_rng(seed)
    contexts = rng.integers(3, size=n)
    classes = (rng.random(n) > PRIORS[contexts, 0]).astype(int)
    vague = 2 * np.array([[0.9, 0.1], [0.1, 0.9]])
    labels = np.array([rng.multinomial(1, LABEL[c]) for c in classes], dtype=float)
    sources = [
        AnswerSource(answer(rng, classes, FIRST), [0, 1], vague),
        AnswerSource(answer(rng, classes, SECOND), [0, 1], vague),
        AnswerSource(labels, [0, 1], vague),
    ]
    return classes, contexts, sources


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_known_error_rates_are_recovered(seed):
    _, contexts, sources = make_cases(6000, seed)
    estimate = estimate_classes(sources, contexts, 2)
    for matrix, true in zip(estimate.matrices, (FIRST, SECOND, LABEL), strict=True):
        np.testing.assert_allclose(matrix, true, atol=0.04)
    shares = [estimate.posteriors[contexts == x].mean(axis=0) for x in range(3)]
    np.testing.assert_allclose(shares, PRIORS, atol=0.06)


def test_the_probabilities_of_the_classes_are_calibrated():
    classes, contexts, sources = make_cases(6000, 3)
    posteriors = estimate_classes(sources, contexts, 2).posteriors
    np.testing.assert_allclose(posteriors.sum(axis=1), 1)
    for low in (0, 0.25, 0.5, 0.75):
        within = (posteriors[:, 1] >= low) & (posteriors[:, 1] < low + 0.25)
        assert within.sum() > 500
        assert classes[within].mean() == pytest.approx(posteriors[within, 1].mean(), abs=0.05)


def test_the_classes_are_those_of_bayes_rule_with_the_estimated_rates():
    """Case by case, answer by answer."""
    _, contexts, sources = make_cases(200)
    estimate = estimate_classes(sources, contexts, 2)
    overall = estimate.posteriors.mean(axis=0)
    for case in range(200):
        prior = estimate.posteriors[contexts == contexts[case]].sum(axis=0) + CONTEXT_WEIGHT * overall
        weights = prior / prior.sum()
        for source, matrix in zip(sources, estimate.matrices, strict=True):
            for k in range(2):
                for observation, times in enumerate(source.counts[case]):
                    weights[k] *= matrix[k, observation] ** times
        np.testing.assert_allclose(estimate.posteriors[case], weights / weights.sum(), atol=1e-4)
    for source, matrix, counts in zip(sources, estimate.matrices, estimate.counts, strict=True):
        np.testing.assert_allclose(counts, estimate.posteriors.T @ source.counts, atol=1e-9)
        expected = counts + source.pseudo_counts
        np.testing.assert_allclose(matrix, expected / expected.sum(axis=1, keepdims=True))


def test_the_order_of_cases_and_the_names_of_contexts_do_not_matter():
    _, contexts, sources = make_cases(300)
    order = np.random.default_rng(1).permutation(300)
    moved = [AnswerSource(s.counts[order], s.rows, s.pseudo_counts) for s in sources]
    plain = estimate_classes(sources, contexts, 2).posteriors
    other = estimate_classes(moved, 100 - contexts[order], 2).posteriors
    np.testing.assert_allclose(other, plain[order], atol=1e-9)


def test_classes_that_answer_alike_share_a_row():
    """Of three classes the first question separates the first, the second question the last."""
    rng = np.random.default_rng(0)
    classes = rng.integers(3, size=6000)
    stated = np.array([[0.9, 0.1], [0.2, 0.8]])
    true = np.array([[0.75, 0.25], [0.3, 0.7]])
    first, second = [0, 1, 1], [0, 0, 1]
    sources = [
        AnswerSource(answer(rng, np.array(rows)[classes], true, 6), rows, 5 * stated)
        for rows in (first, second)
    ]
    estimate = estimate_classes(sources, np.zeros(6000), 3)
    for matrix in estimate.matrices:
        np.testing.assert_allclose(matrix, true, atol=0.04)
    np.testing.assert_allclose(estimate.posteriors.mean(axis=0), 1 / 3, atol=0.05)
    assert (estimate.posteriors.argmax(axis=1) == classes).mean() > 0.65


def test_samples_have_the_moments_of_the_posterior_by_importance_sampling():
    """Of a few cases: rates from the prior, weighted by the likelihood of the answers."""
    rng = np.random.default_rng(0)
    pseudo = [8 * FIRST, 3 * LABEL]
    counts = [np.array([[2, 0], [1, 1], [0, 3], [0, 1]]), np.array([[1, 0], [0, 1], [0, 1], [1, 0]])]
    cases = np.array([3, 2, 4, 2])
    sources = [AnswerSource(c, [0, 1], p) for c, p in zip(counts, pseudo, strict=True)]
    one = np.zeros(4, dtype=int)  # one context, whose classes are those of all cases: a large weight
    found = sample_rates(sources, one, cases, np.ones(4), 1e9, [FIRST, LABEL], np.array([[0.5, 0.5]]))

    n = 100_000
    prior = [np.stack([rng.dirichlet(row, n) for row in p], axis=1) for p in pseudo]
    likelihood = rng.dirichlet([0.5, 0.5], n)[:, np.newaxis]  # of each kind of cases and class
    for own, rates in zip(counts, prior, strict=True):
        likelihood = likelihood * np.exp(np.einsum("uo,sko->suk", own, np.log(rates)))
    weights = (likelihood.sum(axis=2) ** cases).prod(axis=1)
    for own, rates in zip(found, prior, strict=True):
        mean = np.average(rates, axis=0, weights=weights)
        deviation = np.sqrt(np.average((rates - mean) ** 2, axis=0, weights=weights))
        np.testing.assert_allclose(own.mean(axis=0), mean, atol=0.02)
        np.testing.assert_allclose(own.std(axis=0), deviation, rtol=0.1)


def test_variances_of_known_classes_are_those_of_counts_and_grow_with_the_errors_of_the_answers():
    def variances(error, asked=8):
        rng = np.random.default_rng(1)
        classes = np.arange(400) % 2
        true = np.array([[1 - error, error], [error, 1 - error]])
        counts = np.array([rng.multinomial(asked, true[c]) for c in classes])
        labels = np.eye(2)[[rng.choice(2, p=LABEL[c]) for c in classes]]
        sources = [AnswerSource(counts, [0, 1], 5 * true + 0.1), AnswerSource(labels, [0, 1], LABEL)]
        estimate = estimate_classes(sources, np.zeros(400), 2)
        rates, totals = estimate.matrices[1], estimate.counts[1].sum(axis=1, keepdims=True) + 1
        return estimate.samples[1].var(axis=0) / (rates * (1 - rates) / totals)

    np.testing.assert_allclose(variances(0.01), 1, rtol=0.15)  # of 1600 samples
    growth = [variances(error).min() for error in (0.1, 0.2, 0.3)]
    assert growth == sorted(growth)
    assert growth[-1] > 1.2
    assert variances(0.3, asked=2).min() > 1.5 * growth[-1]


def test_a_case_of_weight_two_counts_as_two_cases():
    _, contexts, sources = make_cases(120)
    weights = np.where(np.arange(120) % 3, 1.0, 2.0)
    twice = np.repeat(np.arange(120), weights.astype(int))
    repeated = [AnswerSource(s.counts[twice], s.rows, s.pseudo_counts) for s in sources]
    weighted = estimate_classes(sources, contexts, 2, weights)
    other = estimate_classes(repeated, contexts[twice], 2)
    np.testing.assert_allclose(weighted.posteriors[twice], other.posteriors, atol=1e-9)
    for wrong in (weights[1:], 0 * weights, weights * np.nan):
        with pytest.raises(DataError, match="120 cases need as many weights, finite and above 0"):
            estimate_classes(sources, contexts, 2, wrong)


def test_no_cases_and_no_sources():
    source = AnswerSource(np.zeros((0, 2)), [0, 1], FIRST)
    estimate = estimate_classes([source], np.zeros(0), 2)
    assert estimate.posteriors.shape == (0, 2)
    np.testing.assert_allclose(estimate.matrices[0], FIRST)
    assert estimate_classes([], np.zeros(3), 2).posteriors.tolist() == [[0.5, 0.5]] * 3


@pytest.mark.parametrize(
    ("counts", "rows", "pseudo_counts", "words"),
    [
        ([[1, -1]], [0, 1], FIRST, "the counts of answers: expected a matrix of finite numbers from 0"),
        ([[1, np.nan]], [0, 1], FIRST, "the counts of answers"),
        ([1, 1], [0, 1], FIRST, "the counts of answers"),
        ([[1, 1]], [0, 1], -FIRST, "the pseudo_counts of answers"),
        ([[1, 1, 1]], [0, 1], FIRST, r"answers of shape \(1, 3\) and the rows \[0, 1\]"),
        ([[1, 1]], [0, 2], FIRST, r"the rows \[0, 2\] of the classes do not fit a matrix of shape \(2, 2\)"),
        ([[1, 1]], [0, 1], [[0, 0], [1, 1]], "a row of a source's matrix has no pseudo-counts"),
    ],
)
def test_wrong_sources_are_refused(counts, rows, pseudo_counts, words):
    with pytest.raises(DataError, match=words):
        AnswerSource(np.array(counts), rows, np.array(pseudo_counts))


def test_sources_of_other_cases_are_refused():
    source = AnswerSource(np.ones((3, 2)), [0, 1], FIRST)
    for n, k in ((4, 2), (3, 3)):
        with pytest.raises(DataError, match=f"about 3 cases of 2 classes; expected {n} of {k}"):
            estimate_classes([source], np.zeros(n), k)

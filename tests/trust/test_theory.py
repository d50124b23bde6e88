"""The ingredients of docs/background/trust-theory.md hold on random models at all distances."""

import numpy as np
import pytest

DISTANCES = np.array([1.0, 0.3, 0.1, 0.03, 0.01])


def total_variation(p, q, axis=-1):
    return np.abs(p - q).sum(axis=axis) / 2


def draw_pairs(rng, n: int, *shape: int):
    """Two arrays (n, *shape) of distributions along the last axis; some are near each other."""
    one, other = rng.dirichlet(np.ones(shape[-1]), (2, n, *shape[:-1]))
    share = rng.choice(DISTANCES, n).reshape(n, *[1] * len(shape))
    return one, (1 - share) * one + share * other


def follow(own, true, depth, rows, cost, reward):
    """The return of the best policy by a robot's model, as the robot expects it and in truth.

    own, true: (n, V) joint probabilities of value and history. rows: both models (n, A, V, O). cost: (n, A).
    reward: (n, V, V) by value and report.
    """
    options = [((own * r).sum(1), (true * r).sum(1)) for r in np.moveaxis(reward, 2, 0)]
    for a in range(cost.shape[1] if depth else 0):
        parts = [
            follow(own * rows[0][:, a, :, o], true * rows[1][:, a, :, o], depth - 1, rows, cost, reward)
            for o in range(rows[0].shape[3])
        ]
        options.append(tuple(sum(p[k] for p in parts) - cost[:, a] * (own, true)[k].sum(1) for k in (0, 1)))
    best = np.argmax([expected for expected, _ in options], axis=0)
    return tuple(np.choose(best, [option[k] for option in options]) for k in (0, 1))


@pytest.mark.parametrize(("n_values", "depth"), [(2, 3), (3, 2)])
def test_a_policy_of_a_wrong_model_costs_at_most_the_bound_of_the_simulation_lemma(n_values, depth):
    n, rng = 1000, np.random.default_rng(n_values)
    prior, guess = draw_pairs(rng, n, n_values)
    rows, heard = draw_pairs(rng, n, 2, n_values, 2)
    cost, reward = rng.uniform(0, 0.3, (n, 2)), rng.uniform(-1, 1, (n, n_values, n_values))
    expected, found = follow(guess, prior, depth, (heard, rows), cost, reward)
    best, _ = follow(prior, prior, depth, (rows, rows), cost, reward)
    span = np.ptp(reward, axis=(1, 2)) + depth * cost.max(axis=1)
    limit = span * (total_variation(prior, guess) + depth * total_variation(rows, heard).max(axis=(1, 2)))
    assert (np.abs(found - expected) <= limit + 1e-12).all()
    assert (best - found >= -1e-12).all()
    assert (best - found <= 2 * limit + 1e-12).all()
    assert (np.abs(found - expected) / limit).max() > 0.3  # the bound is not far away


def find_law(pi, rates, heard):
    """(n, L, 2, 2, 2) P(label, three answers), from (n, 2), (n, 2, L) and (n, 2) P(yes | value)."""
    answers = np.stack([heard, 1 - heard], axis=2)
    return np.einsum("ny,nyl,nya,nyb,nyc->nlabc", pi, rates, answers, answers, answers)


def test_three_answers_determine_contrast_and_joint_distribution():
    n, rng = 5000, np.random.default_rng(1)
    pi, pi_ = draw_pairs(rng, n, 2)
    rates, rates_ = draw_pairs(rng, n, 2, 2)
    heard, heard_ = (np.sort(rows[..., 0])[:, ::-1] for rows in draw_pairs(rng, n, 2, 2))
    contrast, contrast_ = heard[:, 0] - heard[:, 1], heard_[:, 0] - heard_[:, 1]
    law, law_ = find_law(pi, rates, heard), find_law(pi_, rates_, heard_)
    distance = np.abs(law - law_).sum(axis=(1, 2, 3, 4)) / 2
    # the identities from which the constants follow
    yes = law.sum(axis=1)[:, 0]
    m1, m2, m3 = yes.sum(axis=(1, 2)), yes[:, 0].sum(axis=1), yes[:, 0, 0]
    c2, c3 = m2 - m1**2, m3 - 3 * m1 * m2 + 2 * m1**3
    np.testing.assert_allclose(c2, pi.prod(axis=1) * contrast**2, atol=1e-12)
    np.testing.assert_allclose(c3, c2 * (pi[:, 1] - pi[:, 0]) * contrast, atol=1e-12)
    # the constants
    v = pi.prod(axis=1)
    assert (np.abs(contrast - contrast_) <= 35 * distance / (v * contrast**3)).all()
    joint, joint_ = pi[:, :, None] * rates, pi_[:, :, None] * rates_
    between = total_variation(joint, joint_, axis=(1, 2))
    assert (between <= 63 * distance / (v * contrast**4)).all()
    labels, given, given_ = joint.sum(axis=1), *(x / x.sum(axis=1, keepdims=True) for x in (joint, joint_))
    assert ((labels * total_variation(given, given_, axis=1)).sum(axis=1) <= 2 * between + 1e-12).all()


def test_maximum_likelihood_is_near_the_truth_though_questions_depend_on_people_before():
    """Sum of 1 - sum sqrt(p q) of the best of N models: at most log(N / d) with probability 1 - d."""
    streams, people, size, rng = 300, 200, 20, np.random.default_rng(2)
    pi = rng.dirichlet(np.ones(2), size)
    heard = np.stack([rng.uniform(0.5, 1, size), rng.uniform(0, 0.5, size)], axis=1)
    law = find_law(pi, np.ones((size, 2, 1)), heard).reshape(size, 8)
    laws = np.stack([law, np.pad(law.reshape(size, 2, 4).sum(axis=2), ((0, 0), (0, 6)))])  # three, or one
    apart = 1 - np.sqrt(laws * laws[:, :1]).sum(axis=2)  # (2, N) from the truth, the first model
    score, lost, asks = np.zeros((streams, size)), np.zeros((streams, size)), np.zeros(streams, np.intp)
    for _ in range(people):
        chances = laws[asks, 0].cumsum(axis=1)
        outcome = (rng.random((streams, 1)) > chances[:, :-1]).sum(axis=1)
        score += np.log(laws[asks, :, outcome])
        lost += apart[asks]
        asks = outcome % 2
    found = lost[np.arange(streams), score.argmax(axis=1)]
    assert found.max() > 0
    assert np.mean(found > np.log(size / 0.2)) <= 0.2

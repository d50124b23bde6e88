"""Weights of sources and noises: Bayes' rule by hand, and which answers have the fixed noise."""

import numpy as np
import pytest

from lcorpp.errors import DecisionError
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.forms import ByClass, ByNumber, Repeated
from lcorpp.trust.sources.weights import FIXED_NOISE, SourceWeights
from tests.trust.fakes import STATED_TABLES

ANSWERS = AnswerModel.of_tables(STATED_TABLES)
ROWS = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.5]])


def list_tables(estimated):
    """Return the (V, O) table at each noise, the estimated one first."""
    middle = np.full((2, 2), 0.5)
    return [estimated, *[(1 - d) * STATED_TABLES[0] + d * middle for d in FIXED_NOISE]]


@pytest.mark.parametrize("answers", [(), (0,), (0, 1, 0), (1, 1, 1, 1)])
def test_the_weights_are_bayes_rule_over_all_pairs(answers):
    weights, estimated = SourceWeights(3, 2, ANSWERS, 0.0), np.array([[0.6, 0.4], [0.3, 0.7]])
    expected, joint = np.empty((7, 3)), np.zeros(2)
    for e, table in enumerate(list_tables(estimated)):
        likelihood = np.prod([table[:, o] for o in answers], axis=0) * np.ones(2)
        for k, row in enumerate(ROWS):
            degree = 0 if e == 0 else FIXED_NOISE[e - 1]
            own = (1 - degree) * (0.4 if k == 0 else 0.3) + degree * (k == 2)  # the last without evidence
            prior = (0.5 if e == 0 else 0.5 / 6) * own
            expected[e, k] = prior * (row @ likelihood)
            joint += prior * row * likelihood
    likelihoods = np.exp(weights.compute_log_likelihoods(answers, np.log(estimated).T))
    np.testing.assert_allclose(weights.compute_joint(ROWS, likelihoods), joint)
    weights.update(likelihoods @ ROWS.T)
    np.testing.assert_allclose(weights.joint, expected / expected.sum())
    np.testing.assert_allclose(weights.of_sources, weights.joint.sum(axis=0))


def test_answers_of_a_person_whose_value_persists_show_the_noise_and_no_source():
    """The value is known, and the answers contradict each other: noise is probable, and given a noise the
    sources remain as probable as before."""
    weights = SourceWeights(3, 2, ANSWERS, 0.0)
    likelihoods = np.exp(weights.compute_log_likelihoods((0, 1, 1, 0), np.log(STATED_TABLES[0]).T))
    same = likelihoods @ np.array([1.0, 0.0])
    before, noises = weights.joint, weights.of_noises
    weights.update(np.zeros((7, 3)), same)
    np.testing.assert_allclose(weights.joint, before * same[:, None] / (noises @ same))
    assert weights.of_noises[-1] > noises[-1]


def test_rows_are_the_mean_over_the_noises_and_the_stated_ones_are_refuted_by_bayes_factors():
    weights, estimated = SourceWeights(3, 2, ANSWERS, 0.0), np.array([[0.6, 0.4], [0.3, 0.7]])
    assert weights.stated_loss == 0
    p_answers = np.array([0.4, 0.1, 0.1, 0.1, 0.2, 0.1, 0.1])  # of the estimates and six noises
    weights.update(np.repeat(p_answers[:, None], 3, axis=1))
    assert weights.stated_loss == pytest.approx(np.log(2))
    shares = np.array([0.5, *[0.5 / 6] * 6]) * p_answers
    expected = np.tensordot(shares / shares.sum(), np.array(list_tables(estimated)), 1)
    np.testing.assert_allclose(weights.compute_mean_rows(estimated), expected)


def test_rows_of_other_groups_are_the_estimated_ones_at_each_noise():
    model = ByClass().make_answers(STATED_TABLES)
    weights = SourceWeights(3, 2, model, 0.0)
    mean = model.make_tables(weights.compute_mean_rows(model.start_rows))
    first, second = model.make_tables(model.start_rows)
    np.testing.assert_allclose(mean[1], second)
    assert np.abs(mean[0] - first).max() > 0.05


def test_each_pair_keeps_a_share():
    weights = SourceWeights(3, 2, ANSWERS, 0.1)
    start = weights.joint
    weights.update(np.eye(7, 3))
    assert (weights.joint >= 0.1 * start - 1e-15).all()
    assert weights.joint.sum() == pytest.approx(1)


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        (ByNumber(2), [True, True]),  # each copy follows the one before
        (Repeated(2), [True, False, False]),  # the new question, and the two last answers
    ],
)
def test_copies_have_the_fixed_noise_if_they_follow_the_first_one(form, expected):
    follows = form.make_answers(STATED_TABLES).follows_first_group
    assert follows.shape == (2 * len(expected), 2)
    assert follows.tolist() == [[own, own] for own in np.repeat(expected, 2).tolist()]


def test_the_first_class_of_people_has_the_fixed_noise():
    follows = ByClass().make_answers(STATED_TABLES).follows_first_group
    assert follows.tolist() == [[True, True, False, False]] * 2


def test_a_state_is_restored_and_a_wrong_one_refused():
    weights, other = SourceWeights(3, 2, ANSWERS, 0.0), SourceWeights(3, 2, ANSWERS, 0.0)
    weights.update(np.eye(7, 3) + 0.1)
    other.restore(weights.state())
    np.testing.assert_array_equal(other.joint, weights.joint)
    for wrong in (2 * weights.joint, weights.joint - 0.5, np.full((7, 3), np.nan)):
        with pytest.raises(DecisionError, match="the weights of sources do not sum to 1"):
            other.restore(wrong.tolist())

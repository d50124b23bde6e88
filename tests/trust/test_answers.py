"""The observation model: rows, and the estimates of noise, question and row."""

import numpy as np
import pytest

from lcorpp.trust.answers import AnswerModel, Noise, NoiseGroup
from lcorpp.trust.forms import Repeated

TWO_QUESTIONS = np.array([[[0.9, 0.1], [0.1, 0.9]], [[0.8, 0.2], [0.2, 0.8]]])


def count(model: AnswerModel, tables, people: float):
    """The expected answers (D, V) of some people of each value."""
    return people * np.asarray(tables).transpose(0, 2, 1).reshape(model.n_answers, -1)


def test_values_with_equal_rows_share_them_and_questions_do_not():
    table = np.array([[0.7, 0.3], [0.2, 0.8], [0.7, 0.3]])
    model = AnswerModel.of_tables(np.array([table, table]))
    assert model.row_of.tolist() == [[0, 1, 0], [2, 3, 2]]
    np.testing.assert_array_equal(model.make_tables(model.stated_rows), [table, table])


def test_without_answers_the_stated_model_remains():
    model = AnswerModel.of_tables(TWO_QUESTIONS)
    rows, noise = model.estimate_rows(np.zeros((4, 2)))
    assert noise == Noise((0.0,))
    np.testing.assert_allclose(rows, model.stated_rows)


@pytest.mark.parametrize("noise", [-0.1, 0.25, 0.5, 0.9])
def test_a_noise_that_all_questions_share_is_found(noise):
    model = AnswerModel.of_tables(TWO_QUESTIONS)
    noisy = (1 - noise) * TWO_QUESTIONS + noise / 2
    rows, found = model.estimate_rows(count(model, noisy, 1e5))
    assert found.degrees == pytest.approx((noise,), abs=0.011)
    np.testing.assert_allclose(model.make_tables(rows), noisy, atol=0.002)


@pytest.mark.parametrize("right", [0.6, 0.7, 0.85])
def test_a_noise_that_makes_all_questions_equal_is_found(right):
    """Of two questions that are stated as .9 and .8 right; half of the people were asked the second one."""
    model = AnswerModel.of_tables(TWO_QUESTIONS)
    equal = np.array(2 * [[[right, 1 - right], [1 - right, right]]])
    rows, noise = model.estimate_rows(count(model, equal, 100))
    assert noise.is_equal
    np.testing.assert_allclose(model.make_tables(rows), equal, atol=0.01)
    assert model.compute_log_prior(noise) < 0  # it is not what is stated


def test_equal_contrasts_are_those_of_the_questions_of_a_group():
    """The mean contrast of the stated rows, .7, less the noise; a group of its own keeps its contrast."""
    tables = np.concatenate([TWO_QUESTIONS, TWO_QUESTIONS[:1]])
    groups = (NoiseGroup(), NoiseGroup(follows=0))
    model = AnswerModel.of_tables(tables, group_of=np.array([0, 0, 1]), groups=groups)
    rows = model.make_tables(model.add_noise(Noise((0.5, 0.25), is_equal=True)))
    np.testing.assert_allclose(rows[:, 0, 0] - rows[:, 1, 0], [0.35, 0.35, 0.6], atol=0.01)


def test_repeated_answers_have_no_equal_contrasts():
    """The noise of a repeated question is the probability of the answer before."""
    model = Repeated(2).make_answers(TWO_QUESTIONS)
    equal, other = (model.add_noise(Noise((0.0, 0.4), is_equal=own)) for own in (True, False))
    again = model.row_of.reshape(2, 3, 2)[:, 1:].ravel()
    np.testing.assert_array_equal(equal[again], other[again])
    assert np.abs(equal - other).max() > 0.04


def test_each_question_and_each_row_may_differ():
    model = AnswerModel.of_tables(TWO_QUESTIONS)
    other = np.array([[[0.6, 0.4], [0.4, 0.6]], [[0.95, 0.05], [0.3, 0.7]]])
    rows, _ = model.estimate_rows(count(model, other, 1e6))
    np.testing.assert_allclose(model.make_tables(rows), other, atol=0.002)


def test_few_answers_move_all_questions_alike_rather_than_one():
    """Twenty wrong answers to the first question are noise of the second one, too."""
    model = AnswerModel.of_tables(TWO_QUESTIONS)
    counts = np.zeros((4, 2))
    counts[0], counts[1] = [30, 20], [20, 30]
    rows, noise = model.estimate_rows(counts)
    assert 0 < noise.degrees[0] < 0.8
    first, second = model.make_tables(rows)[:, 0, 1]
    assert first > 0.1
    assert second > 0.2


def test_an_observation_that_no_value_makes_possible_keeps_probability_zero():
    table = np.array([[[0.9, 0.1, 0.0], [0.0, 1.0, 0.0]]])
    model = AnswerModel.of_tables(table)
    rows, _ = model.estimate_rows(count(model, table, 100))
    assert (rows[:, 2] == 0).all()
    assert (rows[:, :2] > 0).all()  # stated as impossible for one value only: it may be wrong
    np.testing.assert_allclose(rows.sum(axis=1), 1)


def test_values_are_never_exchanged_in_the_rows():
    model = AnswerModel.of_tables(TWO_QUESTIONS)
    inverted = TWO_QUESTIONS[:, ::-1]
    rows, noise = model.estimate_rows(count(model, inverted, 1e6))
    first, second = model.make_tables(rows).transpose(1, 0, 2)
    assert noise.degrees[0] > 0.9
    assert (first[:, 0] > second[:, 0]).all()
    assert (first[:, 0] - second[:, 0] < 0.05).all()
    np.testing.assert_allclose(rows.sum(axis=1), 1)

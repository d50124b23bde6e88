"""Forms of answers: their memories and copies, and the noise of each group."""

import numpy as np
import pytest

from lcorpp.trust.answers import AnswerModel, Noise, NoiseGroup
from lcorpp.trust.forms import ByClass, ByNumber, Repeated
from lcorpp.trust.latent_class_model import LatentClassModel

TABLES = np.array([[[0.9, 0.1, 0], [0.1, 0.9, 0]], [[0.8, 0.2, 0], [0.2, 0.8, 0]]])


def test_the_number_of_the_question_chooses_the_copy():
    form = ByNumber(n_copies=3)
    answers = [0, 3, 1, 4, 0]  # kinds 0, 1, 0, 1, 0 with observations 0, 0, 1, 1, 0
    assert form.find_cells(answers, 2, 3) == [0, (3 + 1) * 3, 2 * 3 + 1, (3 + 2) * 3 + 1, 2 * 3]
    memories = [form.begin(2)]
    for answer in answers:
        memories.append(form.advance(memories[-1], *divmod(answer, 3)))
    assert memories == [(0,), (1,), (2,), (3,), (3,), (3,)]


def test_the_last_answer_to_the_same_question_chooses_the_copy():
    form = Repeated(n_observations=3)
    # kind 0: pos, kind 1: neg, kind 0: neg (after pos), kind 0: neg (after neg)
    assert form.find_cells([0, 4, 1, 1], 2, 3) == [0, 4 * 3 + 1, 1 * 3 + 1, 2 * 3 + 1]


def test_repeated_answers_are_certain_at_noise_1():
    model = Repeated(3).make_answers(TABLES)
    rows = model.make_tables(model.add_noise(Noise((0.0, 0.98))))
    np.testing.assert_allclose(rows[0], TABLES[0], atol=1e-4)
    assert (rows[1][:, 0] > 0.97).all()  # after pos
    assert (rows[6][:, 1] > 0.97).all()  # of the second kind, after neg


@pytest.mark.parametrize("noise", [(0.1, 0.3, 0.5, 0.7), (0.5, 0.3, 0.2, 0.0)])
def test_the_noise_of_each_group_is_found(noise):
    model = ByNumber().make_answers(TABLES)
    counts = 1e5 * model.make_tables(model.add_noise(Noise(noise))).transpose(0, 2, 1).reshape(-1, 2)
    rows, found = model.estimate_rows(counts)
    np.testing.assert_allclose(found.degrees, noise, atol=0.011)
    np.testing.assert_allclose(rows, model.add_noise(Noise(noise)), atol=0.005)


def test_the_noise_of_each_class_of_people_is_found():
    model = ByClass().make_answers(TABLES)
    assert (model.n_answers, model.n_values) == (6, 4)
    tables = model.make_tables(model.add_noise(Noise((0.1, 0.8))))  # kind 0 of both classes, kind 1 of both
    by_answer = tables.reshape(2, 2, 2, 3).transpose(0, 3, 1, 2).reshape(6, 4)
    np.testing.assert_allclose(
        np.exp(model.find_log_likelihoods(model.add_noise(Noise((0.1, 0.8)))))[0], by_answer[0]
    )
    rows, found = model.estimate_rows(1e5 * by_answer)
    np.testing.assert_allclose(found.degrees, [0.1, 0.8], atol=0.011)
    np.testing.assert_allclose(rows, model.add_noise(Noise((0.1, 0.8))), atol=0.005)
    assert model.estimate_rows(np.zeros((6, 4)))[1] == model.start_noise == Noise((0.0, 0.7))
    assert model.compute_log_prior(Noise((0.0, 0.7))) == 0


def test_two_classes_of_people_are_learnt_from_their_answers():
    """40 % answer at random, the others as stated; six answers of each person."""
    rng, form = np.random.default_rng(7), ByClass()
    answers = form.make_answers(TABLES)
    model = LatentClassModel(answers, [])
    model.add_context([])
    for _ in range(3000):
        value, is_random = rng.integers(2), rng.random() < 0.4
        row = np.array([0.5, 0.5, 0]) if is_random else TABLES[0, value]
        model.add(0, [], rng.choice(3, size=6, p=row).tolist())
    model.fit(200)
    np.testing.assert_allclose(model.class_shares, [0.6, 0.4], atol=0.1)
    own, random = model.answers.make_tables(model.rows)[:2]
    np.testing.assert_allclose(own, TABLES[0], atol=0.05)
    np.testing.assert_allclose(random[:, :2], 0.5, atol=0.1)  # their prior is noise .7: .62 right answers


def test_without_answers_a_group_has_the_noise_of_the_one_before():
    model = ByNumber().make_answers(TABLES)
    counts = 1e5 * model.make_tables(model.add_noise(Noise((0.4,) * 4))).transpose(0, 2, 1).reshape(8, 3, 2)
    counts[[1, 2, 3, 5, 6, 7]] = 0  # only first questions were asked
    _, found = model.estimate_rows(counts.reshape(-1, 2))
    np.testing.assert_allclose(found.degrees, 0.4, atol=0.02)
    assert model.compute_log_prior(found) < model.compute_log_prior(Noise((0.0,) * 4)) == 0


def test_one_group_is_the_model_without_groups():
    one, groups = AnswerModel.of_tables(TABLES), (NoiseGroup(),)
    other = AnswerModel.of_tables(TABLES, groups=groups, group_of=np.zeros(2, np.intp))
    counts = np.random.default_rng(0).uniform(0, 50, (6, 2))
    np.testing.assert_array_equal(one.estimate_rows(counts)[0], other.estimate_rows(counts)[0])

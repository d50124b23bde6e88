"""The latent class model: it recovers true parameters, weights decay, and its memory is bounded."""

import numpy as np
import pytest

from lcorpp.trust import latent_class_model
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.cases import NO_LABEL, Cases
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.trust.planned_rows import compute_stated_loss, find_planned_rows
from lcorpp.trust.sources.weights import SourceWeights

STATED_TABLES = np.array([[[0.9, 0.1], [0.1, 0.9]]])
RATES = np.array([[0.76, 0.24], [0.29, 0.71]])


def draw_people(rng, n, pi, rates, noise, answers=3):
    """(context, label, answers) of each person."""
    for context in rng.integers(len(pi), size=n):
        value = int(rng.random() > pi[context])
        label = int(rng.random() > rates[value][0])
        yield int(context), [label], [value ^ int(rng.random() < noise) for _ in range(answers)]


def make_model(n_contexts, memory=None):
    model = LatentClassModel(AnswerModel.of_tables(STATED_TABLES), [RATES], memory=memory)
    for k in range(n_contexts):
        model.add_context([("place", str(k))])
    return model


def test_em_recovers_contexts_rates_and_noise_that_are_stated_wrongly():
    rng, pi, rates = np.random.default_rng(0), [0.9, 0.2, 0.5], [(0.6, 0.4), (0.1, 0.9)]
    model = make_model(3)
    for person in draw_people(rng, 6000, pi, rates, 0.3):
        model.add(*person)
    model.fit(60)
    np.testing.assert_allclose(model.pi[:, 0], pi, atol=0.06)
    np.testing.assert_allclose(model.rates[0], rates, atol=0.05)
    np.testing.assert_allclose(model.rows, [[0.7, 0.3], [0.3, 0.7]], atol=0.03)


def test_the_likelihood_never_falls_from_one_iteration_to_the_next():
    rng, model = np.random.default_rng(1), make_model(2)
    people = list(draw_people(rng, 400, [0.8, 0.3], RATES, 0.25))
    for person in people:
        model.add(*person)

    def score():
        total = 0.0
        for context, (label,), answers in people:
            rows = model.answers.make_tables(model.rows)[0]
            total += np.log(model.pi[context] * model.rates[0][:, label] @ np.prod(rows[:, answers], axis=1))
        return total

    scores = []
    for _ in range(12):
        model.fit(1)
        scores.append(score())
    # the priors are worth some people, so the likelihood alone may fall by a little near the maximum
    assert (np.diff(scores) > -0.5).all()
    assert scores[-1] > scores[0]


def test_right_rows_are_rarely_refuted_and_wrong_ones_are():
    """A log posterior lower by 3 has a probability of about 5 % if the stated rows are right."""
    n_stated = {0.1: 0, 0.3: 0}
    for noise in n_stated:
        for seed in range(20):
            model = make_model(1)
            for person in draw_people(np.random.default_rng(seed), 200, [0.5], RATES, noise):
                model.add(*person)
            model.fit(30)
            n_stated[noise] += compute_stated_loss(model) <= 3
    assert n_stated[0.1] >= 16
    assert n_stated[0.3] == 0


def test_stated_rows_are_judged_by_the_answers_of_cases_that_are_not_kept_too(monkeypatch):
    """With 40 answers the value of each person is certain, so the expected counts contain all information."""
    whole, condensed = make_model(1), make_model(1)
    for model, max_cases in ((whole, 100), (condensed, 4)):
        monkeypatch.setattr(latent_class_model, "MAX_CASES", max_cases)
        for person in draw_people(np.random.default_rng(2), 30, [0.5], RATES, 0.2, answers=40):
            model.add(*person)
            model.fit(1)
    assert condensed.estimates.past.answers.sum() > 0.8 * 30 * 40
    loss = compute_stated_loss(whole)
    assert loss > 5
    assert compute_stated_loss(condensed) == pytest.approx(loss, rel=1e-3)


@pytest.mark.parametrize(("noise", "is_mean"), [(0.02, False), (0.25, True)])
def test_estimates_are_used_alone_where_answers_are_better_than_stated(noise, is_mean):
    """The stated rate of wrong answers is .1."""
    model = make_model(1)
    weights = SourceWeights(3, 2, model.answers, 0.0)
    for person in draw_people(np.random.default_rng(5), 600, [0.5], RATES, noise, answers=4):
        model.add(*person)
    model.fit(30)
    assert (model.noise.degrees[0] > 0) == is_mean
    rows = find_planned_rows(model, weights, 3.0)
    np.testing.assert_array_equal(rows, weights.compute_mean_rows(model.rows) if is_mean else model.rows)
    assert np.array_equal(rows, model.rows) != is_mean


def test_stated_rows_that_exclude_an_answer_are_refuted_by_it():
    """As stated, the second value never gives the first answer, and the first value seldom the second one."""
    stated = np.array([[[0.9, 0.1], [0.0, 1.0]]])
    model = LatentClassModel(AnswerModel.of_tables(stated), [])
    model.add_context([])
    for _ in range(20):
        model.add(0, [], [0, 1, 1, 1, 1, 1])
    model.fit(20)
    assert 10 < compute_stated_loss(model) < np.inf


def test_facts_one_by_one_predict_a_new_context():
    """P(value | time, place) of a product: two facts that suggest the same value suggest it more together."""
    rng = np.random.default_rng(2)
    model = LatentClassModel(AnswerModel.of_tables(STATED_TABLES), [])
    for time, place, p in (("am", "lab", 0.8), ("pm", "hall", 0.2), ("am", "hall", 0.5)):
        context = model.add_context([("time", time), ("place", place)])
        for _ in range(400):
            value = int(rng.random() > p)
            model.add(context, [], [value ^ int(rng.random() < 0.1) for _ in range(4)])
    model.fit(30)
    new = model.add_context([("time", "pm"), ("place", "lab")])
    assert model.predict(new, [])[0] == pytest.approx(0.5, abs=0.1)


def test_prediction_without_a_label_is_that_of_the_context():
    model = make_model(1)
    np.testing.assert_allclose(model.predict(0, [NO_LABEL]), [0.5, 0.5])
    np.testing.assert_allclose(model.predict(0, [0]), RATES[:, 0] / RATES[:, 0].sum())
    np.testing.assert_allclose(model.predict(0, [NO_LABEL], prior=np.array([3.0, 1.0])), [0.75, 0.25])


def test_a_recent_model_follows_a_world_that_inverts():
    rng = np.random.default_rng(3)
    model, everybody = make_model(1, memory=100), make_model(1)
    for pi in (0.9, 0.1):
        for person in draw_people(rng, 600, [pi], RATES, 0.1):
            model.add(*person)
            everybody.add(*person)
    model.fit(40)
    everybody.fit(40)
    assert model.pi[0, 0] == pytest.approx(0.1, abs=0.08)
    assert everybody.pi[0, 0] == pytest.approx(0.5, abs=0.08)


def test_equal_people_are_one_case_and_answers_have_no_order():
    cases = Cases(1, 4)
    cases.add(0, [1], [2, 3, 2])
    cases.add(0, [1], [2, 2, 3])
    cases.add(0, [0], [])
    assert (cases.n, cases.weights.tolist()) == (2, [2, 1])
    assert cases.answer_counts.tolist() == [[0, 0, 2, 1], [0, 0, 0, 0]]


def test_weights_fade_with_memory():
    cases = Cases(0, 1, memory=10)
    for k in range(30):
        cases.add(k, [], [0])
    np.testing.assert_allclose(cases.weights, np.exp(-(29 - np.arange(30)) / 10))


def test_faded_cases_are_forgotten():
    cases = Cases(0, 1, memory=2)
    for k in range(1000):
        cases.add(k, [], [0])
    assert cases.n <= 20
    assert cases.contexts[-1] == 999
    assert cases.weights.sum() == pytest.approx(1 / (1 - np.exp(-0.5)), rel=0.02)


def test_counts_of_cases_that_are_not_kept_remain(monkeypatch):
    monkeypatch.setattr(latent_class_model, "MAX_CASES", 8)
    rng, small = np.random.default_rng(4), make_model(2)
    monkeypatch.undo()
    whole = make_model(2)
    for k, person in enumerate(draw_people(rng, 2000, [0.8, 0.3], RATES, 0.2, answers=2)):
        monkeypatch.setattr(latent_class_model, "MAX_CASES", 8)
        small.add(*person)
        monkeypatch.undo()
        whole.add(*person)
        if k % 20 == 0:
            small.fit(2)
            whole.fit(2)
    assert small.cases.n <= 9
    assert whole.cases.n > 9
    np.testing.assert_allclose(small.pi, whole.pi, atol=0.08)

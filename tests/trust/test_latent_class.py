"""The latent class model: it recovers true parameters, weights decay, and its memory is bounded."""

import numpy as np
import pytest

from lcorpp.trust import latent_class_model
from lcorpp.trust.answers import AnswerModel
from lcorpp.trust.cases import NO_LABEL, Cases
from lcorpp.trust.latent_class_model import LatentClassModel
from lcorpp.trust.optimism import find_planned_rows

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


def test_rows_for_planning_are_as_good_as_the_answers_permit():
    """Question 1 answers with noise .3 where .1 is stated; question 2 is never asked."""
    rng = np.random.default_rng(4)
    model = LatentClassModel(AnswerModel.of_tables(np.repeat(STATED_TABLES, 2, axis=0)), [RATES])
    model.add_context([])
    people = list(draw_people(rng, 400, [0.7], RATES, 0.3))
    for person in people:
        model.add(*person)
    model.fit(60)
    rows = find_planned_rows(model, 0.5, -np.inf)
    asked, other = slice(0, 2), slice(2, 4)
    assert (np.abs(rows - model.rows)[asked] < 0.05).all()
    better = (rows - model.rows)[other].diagonal()
    assert (better > 0.03).all()
    assert (better < 0.08).all()

    def score(tables):
        total = 0.0
        for _, (label,), answers in people:
            total += np.log(model.pi[0] * model.rates[0][:, label] @ np.prod(tables[:, answers], axis=1))
        return total

    np.testing.assert_array_equal(find_planned_rows(model, 0.0, -np.inf), model.rows)
    credible = find_planned_rows(model, 4.0, -np.inf)
    assert score(model.rows[asked]) - 4 <= score(credible[asked]) < score(model.rows[asked])


def test_the_stated_rows_are_planned_for_while_they_are_credible():
    """A log posterior lower by 3 has a probability of about 5 % if the stated rows are right."""
    n_stated = {0.1: 0, 0.3: 0}
    for noise in n_stated:
        for seed in range(20):
            model = make_model(1)
            for person in draw_people(np.random.default_rng(seed), 200, [0.5], RATES, noise):
                model.add(*person)
            model.fit(30)
            rows = find_planned_rows(model, 0.0, 3.0)
            is_stated = np.array_equal(rows, model.answers.stated_rows)
            assert is_stated or np.array_equal(rows, model.rows)
            n_stated[noise] += is_stated
    assert n_stated[0.1] >= 16
    assert n_stated[0.3] == 0


def test_rows_that_are_better_than_stated_are_those_for_planning():
    model = make_model(1)
    for person in draw_people(np.random.default_rng(5), 600, [0.5], RATES, 0.02, answers=4):
        model.add(*person)
    model.fit(30)
    assert model.rows[0, 0] > 0.92
    np.testing.assert_array_equal(find_planned_rows(model, 0.5, -np.inf), model.rows)


def test_rows_for_planning_count_the_answers_of_cases_that_are_not_kept(monkeypatch):
    """With 40 answers the value of each person is certain, so the expected counts contain all information."""
    whole, condensed = make_model(1), make_model(1)
    for model, max_cases in ((whole, 100), (condensed, 4)):
        monkeypatch.setattr(latent_class_model, "MAX_CASES", max_cases)
        for person in draw_people(np.random.default_rng(2), 30, [0.5], RATES, 0.2, answers=40):
            model.add(*person)
            model.fit(1)
    assert condensed.estimates.past.answers.sum() > 0.8 * 30 * 40
    for max_loss in (0.5, 2.0):
        rows = find_planned_rows(whole, max_loss, -np.inf)
        assert np.abs(rows - whole.rows).min() > 0.005
        np.testing.assert_allclose(find_planned_rows(condensed, max_loss, -np.inf), rows, atol=1e-4)


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

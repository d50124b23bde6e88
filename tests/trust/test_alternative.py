"""Alternative estimates: which are used, and that more answers decide between them."""

from dataclasses import replace

import numpy as np
import pytest

from lcorpp.trust import latent_class_model
from lcorpp.trust.alternative import MAX_LEAD, AlternativeSearch
from lcorpp.trust.answers import AnswerModel, Noise
from lcorpp.trust.latent_class_model import LatentClassModel
from tests.trust.test_latent_class import RATES, draw_people, make_model

OPPOSITE = np.array([[0.29, 0.71], [0.76, 0.24]])
"""Rates of a classifier that says the contrary of what is stated."""


def believe_the_contrary(model, rng):
    """Let people without answers, labelled by the opposite rates, and EM make the contrary the estimate."""
    for context, label, _ in draw_people(rng, 300, [0.2, 0.7], OPPOSITE, 0.4):
        model.add(context, label, [])
    model.fit(50)
    assert model.rates[0][0, 0] > 0.65


@pytest.mark.parametrize("seed", range(4))
def test_after_few_answers_the_contrary_is_credible_too_and_more_answers_decide(seed):
    rng, model = np.random.default_rng(seed), make_model(2)
    believe_the_contrary(model, rng)
    for person in draw_people(rng, 40, [0.2, 0.7], OPPOSITE, 0.4, answers=4):
        model.add(*person)
    model.fit(50)
    search = AlternativeSearch(model)
    search.search(100)
    other = model.alternative
    assert model.noise.degrees < other.noise.degrees
    assert (model.rates[0][0, 0] < 0.5) != (other.rates[0][0, 0] < 0.5)
    assert (model.pi[0, 0] < 0.5) != (other.pi[0, 0] < 0.5)
    scores = [model.compute_log_posterior(estimates) for estimates in (other, model.estimates)]
    assert abs(scores[0] - scores[1]) <= MAX_LEAD
    # more answers refute the estimates in which all is exchanged
    for person in draw_people(rng, 1500, [0.2, 0.7], OPPOSITE, 0.4):
        model.add(*person)
    model.fit(20)
    search.choose()
    assert model.alternative is None
    model.fit(200)  # EM is slow where answers are noisy
    np.testing.assert_allclose(model.rates[0], OPPOSITE, atol=0.1)  # .03 is a standard error


@pytest.mark.parametrize("seed", range(3))
def test_a_maximum_at_which_the_values_are_exchanged_is_left(seed):
    """The rates are the opposite of the stated ones, at a noise of .4; EM begins where all is exchanged."""
    rng, model = np.random.default_rng(seed), make_model(2)
    for person in draw_people(rng, 3000, [0.2, 0.7], OPPOSITE, 0.4):
        model.add(*person)
    model.estimates = replace(
        model.estimates,
        rates=(np.array([[0.9, 0.1], [0.1, 0.9]]),),
        rows=model.answers.add_noise(Noise((0.98,))),
        pi=np.array([[0.8, 0.2], [0.3, 0.7]]),
    )
    model.fit(20)
    assert model.rates[0][0, 0] > 0.6
    search = AlternativeSearch(model)
    assert search.search(100)
    assert model.alternative is None
    np.testing.assert_allclose(model.rates[0], OPPOSITE, atol=0.1)
    assert model.rows[0, 0] == pytest.approx(0.6, abs=0.06)
    kept = model.rates[0]
    assert not search.search(100)  # the values exchanged are not credible any more
    assert model.alternative is None
    np.testing.assert_allclose(model.rates[0], kept, atol=0.02)


def test_estimates_that_are_far_more_probable_stay():
    rng, model = np.random.default_rng(5), make_model(2)
    for person in draw_people(rng, 500, [0.9, 0.2], RATES, 0.2):
        model.add(*person)
    model.fit(200)
    before = model.estimates
    assert not AlternativeSearch(model).search(1)
    assert (model.estimates, model.alternative) == (before, None)


def test_pairs_of_values_are_exchanged_in_turn(monkeypatch):
    tables = np.array([[[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]]])
    model = LatentClassModel(AnswerModel.of_tables(tables), [])
    model.add_context([("place", "hall")])
    model.add(0, [], [0])
    model.estimates = replace(model.estimates, pi=np.array([[0.5, 0.3, 0.2]]), rows=tables[0] / 2 + 1 / 6)
    starts, search = [], AlternativeSearch(model)

    def iterate(start, iterations):
        starts.append(start)
        return model.estimates

    monkeypatch.setattr(model, "iterate", iterate)
    for _ in range(4):
        search.search(5)
    assert [start.pi[0].tolist() for start in starts] == [
        [0.3, 0.5, 0.2],
        [0.2, 0.3, 0.5],
        [0.5, 0.2, 0.3],
        [0.3, 0.5, 0.2],
    ]
    for start in starts:
        np.testing.assert_array_equal(start.rows, tables[0])


def test_values_that_no_answer_distinguishes_are_not_exchanged():
    tables = np.array([[[0.8, 0.2], [0.3, 0.7], [0.3, 0.7]]])
    model = LatentClassModel(AnswerModel.of_tables(tables), [])
    assert AlternativeSearch(model)._pairs == [(0, 1), (0, 2)]


def make_two_credible():
    rng, model = np.random.default_rng(1), make_model(2)
    believe_the_contrary(model, rng)
    for person in draw_people(rng, 40, [0.2, 0.7], OPPOSITE, 0.4, answers=4):
        model.add(*person)
    model.fit(50)
    AlternativeSearch(model).search(100)
    assert model.alternative is not None
    return model


def test_new_contexts_and_rates_are_those_of_the_alternative_too():
    model = make_two_credible()
    model.add_context([("place", "new")])
    assert len(model.alternative.pi) == len(model.pi) == 3
    model.replace_rates([np.array([[0.6, 0.4], [0.5, 0.5]])])
    np.testing.assert_array_equal(model.alternative.rates[0], [[0.6, 0.4], [0.5, 0.5]])
    model.fit(2)
    assert model.alternative.values.sum() == pytest.approx(340)


def test_exchange_of_values_is_its_own_inverse():
    model = make_two_credible()
    past = model.expect(model.estimates, model.cases.weights)
    model.estimates = replace(model.estimates, past=past)
    twice = model.estimates.exchange(0, 1).exchange(0, 1)
    assert twice.state() == model.estimates.state()
    once = model.estimates.exchange(0, 1).past
    np.testing.assert_array_equal(once.labels[0], model.estimates.past.labels[0][::-1])
    np.testing.assert_array_equal(once.answers, model.estimates.past.answers[:, ::-1])


@pytest.mark.parametrize("max_cases", [12, 5000])
def test_an_exchange_that_is_wrong_is_left_where_rare_cases_are_counts_too(max_cases, monkeypatch):
    """With `MAX_CASES` 12 most people are counts, by estimates in which the values are exchanged."""
    monkeypatch.setattr(latent_class_model, "MAX_CASES", max_cases)
    rng, model = np.random.default_rng(0), make_model(2)
    wrong = np.array([[0.8, 0.2], [0.3, 0.7]])
    model.estimates = replace(model.estimates, pi=wrong, rows=model.answers.add_noise(Noise((0.98,))))
    for person in draw_people(rng, 3000, [0.2, 0.7], OPPOSITE, 0.25):
        model.add(*person)
    model.fit(5, model.answers.add_noise(Noise((0.98,))))
    assert model.rates[0][0, 0] > 0.6
    assert AlternativeSearch(model).search(100)
    assert model.alternative is None
    assert model.rates[0][0, 0] < 0.45 < model.rates[0][1, 0]

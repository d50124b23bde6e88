"""Classifiers that are trained again: what trust has learnt of people stays, old labels do not."""

import json

import numpy as np

from lcorpp.trust import Trust
from lcorpp.trust.cases import Cases
from lcorpp.values import Step
from tests.decision.fakes import FakeDomain, FakePlanner
from tests.trust.fakes import AskDialogue, SkyReasoner


def make_trust(rates=(0.8, 0.3)):
    return Trust(SkyReasoner(rates=rates), FakeDomain(), AskDialogue(), FakePlanner())


def meet(trust, seed, number):
    """People who want something if the sky is sunny; nine labels and answers of ten are right."""
    rng = np.random.default_rng(seed)
    for _ in range(number):
        sunny = bool(rng.random() < 0.5)
        label, *heard = ((rng.random(4) < 0.9) == sunny).tolist()
        evidence = {"sky": "sunny" if sunny else "grey", "label": "yes" if label else "no"}
        trust.learn(evidence, [Step("ask", "nod" if nod else "shake", np.array([0.5, 0.5])) for nod in heard])


def test_old_labels_are_forgotten_and_the_rates_begin_at_the_new_ones():
    trust = make_trust()
    meet(trust, 0, 200)
    weights, pi = trust.weights.copy(), trust.learnt.pi.copy()
    assert trust.learnt.rates[0][0, 0] > 0.85  # .8 was stated, .9 is true
    trust.retrain(SkyReasoner(rates=(0.6, 0.4)))
    np.testing.assert_allclose(trust.learnt.rates[0], [[0.6, 0.4], [0.4, 0.6]])
    np.testing.assert_array_equal(trust.weights, weights)
    np.testing.assert_allclose(trust.learnt.pi, pi, atol=0.03)  # the answers remain
    assert trust.n_people == trust.learnt.cases.weights.sum() == 200
    assert (trust.learnt.cases.labels == -1).all()
    expected = SkyReasoner(rates=(0.6, 0.4)).posterior("wish", {"sky": "grey", "label": "yes"})
    trust.used.source_weights.joint = np.tile(np.eye(7)[0] / 7, (7, 1))  # knowledge alone
    found = trust.posterior("wish", {"sky": "grey", "label": "yes"})
    np.testing.assert_allclose(found.probabilities, expected.probabilities)
    meet(trust, 1, 200)
    assert trust.learnt.rates[0][0, 0] > 0.8


def test_equal_rates_change_nothing():
    trust = make_trust()
    meet(trust, 0, 60)
    before = json.dumps(trust.state())
    trust.retrain(SkyReasoner())
    assert json.dumps(trust.state()) == before


def test_a_restart_may_come_before_or_after_a_training():
    whole, resumed = make_trust(), make_trust(rates=(0.6, 0.4))
    meet(whole, 0, 60)
    resumed.restore(json.loads(json.dumps(whole.state())))
    for trust in (whole, resumed):
        trust.retrain(SkyReasoner(rates=(0.6, 0.4)))
        meet(trust, 1, 40)
    assert json.dumps(whole.state()) == json.dumps(resumed.state())


def test_cases_that_differ_in_forgotten_labels_become_one():
    cases = Cases(2, 3)
    for labels in ([0, 1], [1, 1], [1, 0], [0, 1]):
        cases.add(0, labels, [2, 2])
    cases.forget_labels(0)
    assert cases.labels.tolist() == [[-1, 1], [-1, 0]]
    assert cases.weights.tolist() == [3, 1]
    cases.add(0, [-1, 0], [2, 2])
    assert cases.n == 2

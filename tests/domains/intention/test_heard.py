"""The preset heard: a measured observation model with silence, and its sentences."""

import json

import numpy as np
import pytest

from lcorpp.domains import load_domain
from lcorpp.worlds.speech import FEATURES, Recogniser, read_confidence

PRESETS = ("paper", "authors", "medium", "low", "heard", "around")


@pytest.fixture(scope="module")
def domain():
    return load_domain("intention", preset="heard")


def test_silence_is_possible_after_each_action_in_each_state(domain):
    pomdp = domain.pomdp
    assert (pomdp.observation.dense[:, :, pomdp.observation_index("none")] > 0).all()


def test_all_but_the_observations_is_as_stated(domain):
    stated = load_domain("intention").pomdp
    for name in ("states", "actions", "discount"):
        assert getattr(domain.pomdp, name) == getattr(stated, name)
    np.testing.assert_array_equal(domain.pomdp.transition.dense, stated.transition.dense)
    np.testing.assert_array_equal(domain.pomdp.reward, stated.reward)


def test_people_answer_by_the_measured_model(domain):
    np.testing.assert_array_equal(domain.simulation.feedback_model, domain.pomdp.observation.dense)


def test_the_recogniser_makes_the_observations_of_the_model(domain):
    confidence = read_confidence(domain.planning.recogniser, FEATURES)
    made = {name for rows in confidence.bins.values() for name, _ in rows}
    assert {*made, "none"} == set(domain.pomdp.observations)
    text = domain.planning.recogniser.read_text()
    assert "synthetic voices" in json.loads(text)["origin"]
    assert "/" not in json.loads(text)["origin"]  # no path of a machine


def test_the_sentences_are_many_and_in_the_dictionary():
    for preset in PRESETS:
        utterances = load_domain("intention", preset=preset).planning.utterances
        assert len(utterances["pos"]) >= 25
        assert len(utterances["neg"]) >= 20
    pytest.importorskip("pocketsphinx", reason="pocketsphinx is not installed")
    Recogniser(utterances)

"""The learnt confidence: a known answer, files that are written and read, and the words of errors."""

import json

import numpy as np
import pytest

from lcorpp.errors import DataError, FileError
from lcorpp.worlds.speech.confidence import (
    ANSWER,
    SPEECH,
    Confidence,
    Factor,
    fit_factor,
    read_confidence,
    write_confidence,
)

NAMES = ("score", "words")
BINS = {"pos": (("pos", 0.9), ("pos_unsure", 0.5)), "neg": (("neg", 0.7),)}


def make(**changes) -> Confidence:
    """Return a confidence with the factor of answers alone."""
    fields = {
        "centre": np.array([1.0, 2.0]),
        "scale": np.array([2.0, 1.0]),
        "weights": np.array([1.0, 0.0]),
        "bias": 0.0,
    }
    return Confidence(NAMES, {ANSWER: Factor(**{**fields, **changes})}, BINS)


def test_the_confidence_is_logistic():
    scores = make().score(np.array([[1.0, 9.0], [1 + 2 * np.log(3), 0.0], [-1e9, 0.0]]))
    np.testing.assert_allclose(scores, [0.5, 0.75, 0], atol=1e-12)


def test_the_confidence_is_the_product_of_its_factors():
    answer = make().factors[ANSWER]
    speech = Factor(np.zeros(2), np.ones(2), np.array([0.0, 1.0]), 0.0)
    both = Confidence(NAMES, {SPEECH: speech, ANSWER: answer}, BINS)
    rows = np.array([[1.0, 0.0], [1 + 2 * np.log(3), np.log(4)], [9.0, -1e9]])
    np.testing.assert_allclose(both.score(rows), [0.25, 0.6, 0], atol=1e-12)
    with pytest.raises(DataError, match="the factor 'answer' has 2 features; expected 1"):
        Confidence(NAMES[:1], {ANSWER: answer}, BINS)


def test_bins_become_observations():
    confidence = make()
    assert [confidence.observe("pos", p) for p in (0.95, 0.9, 0.6, 0.4)] == [
        "pos",
        "pos",
        "pos_unsure",
        "none",
    ]
    assert [confidence.observe("neg", p) for p in (0.7, 0.69)] == ["neg", "none"]
    assert confidence.observe("maybe", 1.0) == "none"
    kept = confidence.keep(("pos", "none"))
    assert [kept.observe("pos", p) for p in (0.95, 0.6)] == ["pos", "none"]
    assert kept.observe("neg", 1.0) == "none"


def test_what_is_learnt_separates_and_counts_weights():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(400, 2))
    right = rows[:, 0] + 0.5 * rng.normal(size=400) > 0
    learnt = fit_factor(rows, right, np.ones(400))
    scores = learnt.score(rows)
    assert ((scores > 0.5) == right).mean() > 0.8
    assert abs(scores.mean() - right.mean()) < 0.02  # calibrated in the large
    half = np.concatenate([np.ones(400), np.zeros(400)])
    twice = fit_factor(np.tile(rows, (2, 1)), np.r_[right, ~right], half)
    np.testing.assert_allclose(twice.score(rows), scores, atol=0.01)  # without weight nothing counts


def test_too_few_cases_are_an_error():
    with pytest.raises(DataError, match="3 answers are right and 97 wrong; expected at least 10 of each"):
        fit_factor(np.zeros((100, 2)), np.arange(100) < 3, np.ones(100))


def test_a_file_gives_the_same_confidence(tmp_path):
    write_confidence(make(), tmp_path / "c.json", origin="a test")
    read = read_confidence(tmp_path / "c.json", NAMES)
    rows = np.random.default_rng(0).normal(size=(5, 2))
    np.testing.assert_array_equal(read.score(rows), make().score(rows))
    assert read.bins == BINS
    assert json.loads((tmp_path / "c.json").read_text())["origin"] == "a test"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"version": 2', '"version": 1', "version 1; expected 2, measure again with `lcorpp observe`"),
        ('"answer": {', '"reply": {', "no factor 'answer'"),
        ('"score"', '"level"', "features level, words; expected score, words"),
        ('"bias": 0.0', '"bias": "0"', "TypeError: '0' is not a number"),
        ('"bias": 0.0', '"bias": NaN', "the bias must be finite"),
        ('"bias": 0.0', '"bias": true', "is not a number"),
        ('"scale": 2.0', '"scale": 0', "each scale positive"),
        ('"centre": 1.0', '"centre": 1e999', "centre is .*; expected 2 finite numbers"),
        ('"pos": 0.9', '"pos": 0.3', r"bins of 'pos' begin at \[0.3, 0.5\]; expected numbers from 1 to 0"),
        ('"pos": 0.9', '"pos": 1.3', "expected numbers from 1 to 0"),
        ('"bins": {', '"bims": {', "KeyError: 'bins'"),
        ("{", "[", "no confidence of a recogniser"),
    ],
)
def test_wrong_files(tmp_path, old, new, words):
    path = tmp_path / "c.json"
    write_confidence(make(), path, origin="a test")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(DataError, match=words) as caught:
        read_confidence(path, NAMES)
    assert "c.json: " in str(caught.value)


@pytest.mark.parametrize("text", ["", "[]", "3", '"a"', "null", "[" * 100_000, '{"features": 3, "bins": 4}'])
def test_files_of_something_else(tmp_path, text):
    (tmp_path / "c.json").write_text(text)
    with pytest.raises(DataError, match="expected a file that `lcorpp observe` wrote"):
        read_confidence(tmp_path / "c.json", NAMES)
    with pytest.raises(FileError):
        read_confidence(tmp_path / "missing.json", NAMES)

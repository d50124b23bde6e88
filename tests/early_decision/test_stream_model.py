"""The stream: bins by information, and steps that do not count the same evidence twice."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from lcorpp.early_decision.stream_model import ENDED, choose_edges, fit_stream_model
from lcorpp.errors import DataError
from tests.early_decision.streams import CLASSES, make_stream, make_timeline


def information(scores: np.ndarray, is_class: np.ndarray, edges: np.ndarray) -> float:
    bins = np.searchsorted(edges, scores, side="right")
    counts = np.array([np.bincount(bins[own], minlength=len(edges) + 1) for own in is_class])
    share = counts / counts.sum(axis=1, keepdims=True)
    return float(0.5 * (share * np.log(share / share.mean(axis=0))).sum())


def test_the_bins_are_the_best_of_all():
    """With few values, all edges can be tried; each cell then is one value."""
    rng = np.random.default_rng(3)
    scores = np.repeat(np.arange(8.0), 60)
    positive = (
        rng.uniform(size=len(scores)) < np.array([0.1, 0.5, 0.2, 0.3, 0.7, 0.6, 0.9, 0.8])[scores.astype(int)]
    )
    is_class = np.array([positive, ~positive])
    found = information(scores, is_class, choose_edges(scores, is_class, 3))
    best = max(information(scores, is_class, np.array(own)) for own in combinations(np.arange(1.0, 8.0), 2))
    assert found == pytest.approx(best, rel=0.01)  # the pseudo-counts may prefer another of nearly equal ones


def test_equal_scores_have_edges():
    flags = np.array([[True, False] * 5, [False, True] * 5])
    assert choose_edges(np.ones(10), flags, 3).tolist() == [1, 1]


def test_known_first_bins():
    """Bins of two values: the rates are the counts with Jeffreys' pseudo-counts."""
    timeline = make_timeline(200)
    p = timeline.probabilities.copy()
    is_first = np.array(timeline.labels) == CLASSES[0]
    high = np.arange(200) % 10 < 7  # of both classes alike, then exchanged for the second one
    p[:, 1:, 0] = np.where(high == is_first, 0.9, 0.1)[:, None]
    stream = fit_stream_model(replace(timeline, probabilities=p), stages=[0.5, 1.0], bins=2)
    right = (high & is_first).sum()
    n = is_first.sum()
    assert stream.first[0] == pytest.approx([(n - right + 0.5) / (n + 1), (right + 0.5) / (n + 1)])


def test_a_repeated_prediction_is_no_further_evidence():
    """The second stage equals the first: its bin is the old one, and the posterior hardly changes."""
    timeline = make_timeline(2000)
    p = timeline.probabilities.copy()
    p[:, 1:] = p[:, 1:2]
    stream = fit_stream_model(replace(timeline, probabilities=p), stages=3, bins=3)
    for step in stream.steps:
        for b in range(3):
            assert step[:, b, b] == pytest.approx([1, 1], abs=0.01)


def test_the_posterior_is_near_that_of_the_last_bin():
    """Log odds that contain the earlier ones: a path has the evidence of its last bin, not of all."""
    stream = fit_stream_model(make_timeline(4000), stages=4, bins=3)
    top = stream.first[:, 2].copy()
    marginal = stream.first
    for step in stream.steps:
        top *= step[:, 2, 2]
        marginal = np.einsum("cb,cbd->cd", marginal, step)
    last = marginal[0, 2] / marginal[1, 2]
    assert np.log(top[0] / top[1]) == pytest.approx(np.log(last), abs=0.5)
    alone = sum(np.log(row[0] / row[1]) for row in [stream.first[:, 2]] * 4)
    assert np.log(top[0] / top[1]) < alone  # as independent observations they would count more


def test_tracks_that_end():
    timeline = make_timeline(400, shortest=3)
    stream = fit_stream_model(timeline, stages=3, bins=2)
    assert stream.ends[0].max() < 0.01
    assert stream.ends[-1].min() > 0.05
    bins = stream.bin_tracks(timeline)
    assert (bins[:, 0] != ENDED).all()
    assert ((bins[:, -1] == ENDED) == np.isnan(timeline.probabilities[:, -1, 0])).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bins": 1}, "1 bins show nothing"),
        ({"stages": 7}, "7 stages; the tracks have predictions at 6 ages"),
        ({"stages": [1.0, 0.5]}, "not different ages that rise"),
        ({"bins": 201}, "fewer tracks of a class last 0.5 s than there are bins, 201"),
    ],
)
def test_wrong_options(options, words):
    with pytest.raises(DataError, match=words):
        fit_stream_model(make_timeline(), **options)


def test_a_timeline_in_fold_is_refused():
    with pytest.raises(DataError, match="no folds"):
        fit_stream_model(replace(make_timeline(), folds=()))


def test_a_stream_is_checked():
    with pytest.raises(DataError, match="the rows of a stream are distributions"):
        replace(make_stream(), first=np.full((2, 2), 0.4))
    with pytest.raises(DataError, match="edges of a stream has shape"):
        replace(make_stream(), edges=np.zeros((1, 1)))
    with pytest.raises(DataError, match="must rise"):
        replace(make_stream(), points=(3, 2))

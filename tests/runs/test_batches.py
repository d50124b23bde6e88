"""Why a run of Algorithm 1 ends, in one sentence."""

import numpy as np
import pytest

from lcorpp.decision import Batch, TrainedSense
from lcorpp.decision.stopping import compute_change
from lcorpp.runs.batches import explain_end
from lcorpp.values import ConfusionMatrix


def make_batch(*, confidence=0.95, converged=False, **cases: int) -> Batch:
    """Batch 7; each sense has so many cases, the same matrix as before, and its letters as classes."""
    senses, changes = {}, {}
    for name, n in cases.items():
        k = len(name)
        matrix = ConfusionMatrix(tuple(name), n / k * (np.full((k, k), 0.25 / (k - 1)) + 0.5 * np.eye(k)))
        senses[name] = TrainedSense(None, matrix, matrix)
        changes[name] = compute_change(matrix, matrix, confidence)
    return Batch(7, {}, senses, (), (), changes, converged)


@pytest.mark.parametrize(
    ("batch", "epsilon", "words"),
    [
        (
            make_batch(ab=100_000, converged=True),
            None,
            "the confusion matrix has converged: with 95 % confidence it changed by at most {:.3f}, not above"
            " 0.18",
        ),
        (
            make_batch(ab=100),
            0.3,
            "stopped after 7 batches; the confusion matrix has not converged: with 95 % confidence it changed"
            " by at most {:.3f}, above 0.3",
        ),
        (
            make_batch(ab=100, confidence=0.0, converged=True),
            0,
            "the confusion matrix has converged: it changed by at most 0.000, not above 0",
        ),
        (make_batch(ab=0), None, "stopped after 7 batches; not all classifiers could be trained"),
    ],
)
def test_the_end_of_a_run_is_explained(batch, epsilon, words):
    assert explain_end(batch, epsilon) == words.format(batch.change.high)


def test_of_several_senses_that_farthest_from_its_limit_is_named():
    """The default grows with the classes: .27 for three."""
    ended = explain_end(make_batch(ab=9000, cde=900), None)
    assert "the confusion matrix of cde has not converged" in ended
    assert ended.endswith("above 0.27")

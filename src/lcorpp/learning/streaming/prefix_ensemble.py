"""Prefix ensemble: one classifier per prefix length, for accurate early predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.special import softmax
from sklearn.base import clone
from sklearn.pipeline import Pipeline
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted

from lcorpp.arguments import check_arguments, check_value
from lcorpp.errors import DataError
from lcorpp.learning.contract import ProbabilityClassifier, fit_clone, predict_proba
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.learning.features.motion import ChannelStandardizer, Motion
from lcorpp.values import Array, measure_lengths
from lcorpp.values.probabilities import MIN_AVERAGED

FRACTIONS = (0.25, 0.5, 0.75, 1.0)
"""The prefix lengths, as fractions of the tracks."""


@dataclass(frozen=True, eq=False)
class PrefixEnsembleState:
    """The state of n running tracks.

    states: the state of each classifier. point_counts: (n,) number of points so far.
    """

    states: tuple[Any, ...]
    point_counts: npt.NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.point_counts)

    def take(self, rows: npt.ArrayLike) -> PrefixEnsembleState:
        """Copy the states of some tracks. rows: (k,) indices."""
        states = tuple(state.take(rows) for state in self.states)
        return PrefixEnsembleState(states, self.point_counts[np.asarray(rows)])

    def put(self, rows: npt.ArrayLike, state: PrefixEnsembleState) -> None:
        """Overwrite the states of some tracks in place. rows: (k,) indices for the k tracks of `state`."""
        for target, source in zip(self.states, state.states, strict=True):
            target.put(rows, source)
        self.point_counts[np.asarray(rows)] = state.point_counts


def _is_stateful(ensemble: PrefixEnsemble) -> bool:
    """Whether the classifier of the ensemble has `begin` and `advance`."""
    return all(hasattr(ensemble.classifier, name) for name in ("begin", "advance"))


class PrefixEnsemble(ProbabilityClassifier):
    """Several copies of a classifier, each trained on prefixes of another length.

    A classifier trained on whole tracks performs poorly after a quarter of one. The ensemble interpolates the
    log probabilities of the two copies whose prefix length is next to that of the track; tracks shorter or
    longer than all of them use the nearest copy.

    Args:
        classifier: a classifier of tracks of any length; each prefix length has a clone. The ensemble has
            `begin` and `advance` if the classifier has.
        fractions: the prefix lengths, as fractions of the longest training track.

    Attributes:
        classes_: (K,) the class names, set by `fit`. classifiers_: the copies. lengths_: (copies,) number of
            points of the training prefixes.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import LstmClassifier, PrefixEnsemble
        >>> walks = np.array([np.outer([speed, 0], np.arange(8) / 3) for speed in (0.2, 0.3, 1.2, 1.3)])
        >>> lstm = LstmClassifier(units=8, epochs=60, learning_rate=0.05)
        >>> ensemble = PrefixEnsemble(lstm, fractions=[0.5, 1.0]).fit(walks, 2 * ["slow"] + 2 * ["fast"])
        >>> ensemble.lengths_.tolist(), ensemble.predict(walks[:, :, :3]).tolist()
        ([4.0, 8.0], ['slow', 'slow', 'fast', 'fast'])
    """

    def __init__(self, classifier: Any, *, fractions: Sequence[float] = FRACTIONS) -> None:
        self.classifier = classifier
        self.fractions = fractions

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> Self:
        """Train every copy.

        Args:
            X: (cases, rows, points); a prefix of a shorter, padded track is at most the whole track.
            y: (cases,) class names.

        Raises:
            DataError: X is malformed, a fraction is out of range, the lengths do not rise, or the classifier
                fails.
        """
        tracks = check_tracks(X)
        check_value(self.fractions, Sequence[float], "the prefix lengths")
        if not len(self.fractions) or not all(0 < fraction <= 1 for fraction in self.fractions):
            raise DataError(f"the prefix lengths are fractions in (0, 1], not {tuple(self.fractions)}")
        longest = int(measure_lengths(tracks).max())
        lengths = [max(2, round(fraction * longest)) for fraction in self.fractions]
        if any(longer <= shorter for shorter, longer in pairwise(lengths)):
            raise DataError(
                f"the prefix lengths {tuple(self.fractions)} are {lengths} points; expected rising numbers"
            )
        self.classifiers_ = [fit_clone(self.classifier, tracks[:, :, :length], y) for length in lengths]
        self.lengths_ = np.array(lengths, dtype=np.float64)
        self.classes_ = self.classifiers_[0].classes_
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) the probability of each of `classes_` for tracks (cases, rows, points) of any length.

        Raises:
            DataError: X is malformed, or the classifier fails.
        """
        check_is_fitted(self, "classifiers_")
        tracks = check_tracks(X)
        weights = self._compute_weights(measure_lengths(tracks))
        # log 1 = 0: copies of weight 0 add nothing
        probabilities = np.full((len(self.classifiers_), len(tracks), len(self.classes_)), 1.0)
        for copy in np.flatnonzero(weights.any(axis=0)):
            probabilities[copy] = predict_proba(self.classifiers_[copy], tracks)
        return _average_geometrically(probabilities, weights)

    @available_if(_is_stateful)  # type: ignore[untyped-decorator]
    def begin(self, n: int = 1) -> PrefixEnsembleState:
        """Return the state before the first point of n tracks, for `advance`."""
        check_is_fitted(self, "classifiers_")
        states = tuple(classifier.begin(n) for classifier in self.classifiers_)
        return PrefixEnsembleState(states, np.zeros(n, dtype=np.intp))

    @available_if(_is_stateful)  # type: ignore[untyped-decorator]
    def advance(self, state: PrefixEnsembleState, features: npt.ArrayLike) -> Array:
        """(n, K) the probabilities after one more point of n tracks; updates `state` in place.

        features: (n, rows) the features of the points.

        All copies process all tracks, so a point costs one step per prefix length.
        """
        pairs = zip(self.classifiers_, state.states, strict=True)
        probabilities = np.stack(
            [classifier.advance(copy_state, features) for classifier, copy_state in pairs]
        )
        state.point_counts[:] += 1
        return _average_geometrically(probabilities, self._compute_weights(state.point_counts))

    def _compute_weights(self, point_counts: npt.NDArray[np.integer]) -> Array:
        """(n, copies) the weight of each copy for tracks with these numbers of points (n,)."""
        copies = np.arange(len(self.lengths_))
        position = np.interp(point_counts, self.lengths_, copies)
        return np.asarray(np.maximum(0, 1 - np.abs(position[:, None] - copies)))


@check_arguments
def with_prefix_ensemble(pipeline: Pipeline, *, fractions: Sequence[float] = FRACTIONS) -> Pipeline:
    """Return an unfitted pipeline with one classifier per prefix length, after the shared preprocessing.

    Args:
        pipeline: `Motion`, perhaps `ChannelStandardizer`, and a classifier of tracks of any length.
        fractions: the prefix lengths, as fractions of the longest training track.

    Raises:
        DataError: there is no step after `Motion` and `ChannelStandardizer`.

    Examples:
        >>> from lcorpp.learning import learner, with_prefix_ensemble
        >>> pipeline = with_prefix_ensemble(learner("summaries"), fractions=[0.5, 1.0])
        >>> [name for name, step in pipeline.steps], pipeline[-1].fractions
        (['motion', 'logistic'], [0.5, 1.0])
    """
    steps = list(pipeline.steps)
    shared = list(takewhile(lambda step: isinstance(step[1], Motion | ChannelStandardizer), steps))
    rest = steps[len(shared) :]
    if not rest:
        raise DataError("the pipeline has no classifier after its preprocessing")
    classifier = rest[0][1] if len(rest) == 1 else Pipeline(rest)
    return clone(Pipeline([*shared, (rest[-1][0], PrefixEnsemble(classifier, fractions=fractions))]))


def _average_geometrically(probabilities: Array, weights: Array) -> Array:
    """(n, K) normalised geometric mean of distributions (copies, n, K) by weights (n, copies) of sum 1."""
    logs = np.log(np.maximum(probabilities, MIN_AVERAGED))
    return np.asarray(softmax(np.einsum("nc,cnk->nk", weights, logs), axis=1))

"""LSTM classifier: the paper's classifier as a scikit-learn estimator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.exceptions import NotFittedError

from lcorpp.arguments import check_value
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.contract import ProbabilityClassifier
from lcorpp.learning.data.dataset import check_labels, check_tracks
from lcorpp.learning.lstm.network import Floats, Weights
from lcorpp.learning.lstm.trainer import TrainingConfig, TrainingSet
from lcorpp.learning.lstm.training import SCHEDULES, compute_class_weights, train
from lcorpp.values import Array, Lengths, measure_lengths

_PREDICTION_BATCH = 4096
"""Cases per call of the network in `predict_proba`, which bounds memory."""

LOWER_BOUNDS = {"units": 1, "epochs": 1, "min_updates": 0, "batch_size": 1, "random_state": 0}
"""The smallest values of the parameters that are whole numbers."""

_MAX_INPUT = 1e30
"""Inputs up to this size, times any weight, are finite in float32."""


@dataclass(frozen=True, eq=False)
class LstmState:
    """The recurrent state of n running tracks; `LstmClassifier.advance` updates it in place.

    weights: those of the classifier that created it; no other classifier can advance it.
    hidden, cell: (n, units) float32.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import LstmClassifier
        >>> tracks = np.array([[[0.0, 0.5, 1.0]], [[1.0, 0.5, 0.0]]])  # (cases, channels, time points)
        >>> lstm = LstmClassifier(units=8, epochs=100, learning_rate=0.05).fit(tracks, ["up", "down"])
        >>> state = lstm.begin(2)  # before the first point of two tracks
        >>> for point in range(3):
        ...     probabilities = lstm.advance(state, tracks[:, :, point])
        >>> np.allclose(probabilities, lstm.predict_proba(tracks))
        True
    """

    weights: Weights
    hidden: Floats
    cell: Floats

    def __len__(self) -> int:
        return len(self.hidden)

    def __repr__(self) -> str:
        return f"<LstmState of {len(self)} tracks, {self.weights.units} units>"

    def take(self, rows: npt.ArrayLike) -> LstmState:
        """Copy the states of some tracks. rows: (k,) indices."""
        index = np.asarray(rows, dtype=np.intp)
        return LstmState(self.weights, self.hidden[index], self.cell[index])

    def put(self, rows: npt.ArrayLike, state: LstmState) -> None:
        """Overwrite the states of some tracks in place. rows: (k,) indices for the k tracks of `state`.

        Raises:
            DataError: `state` belongs to another classifier.
        """
        if state.weights is not self.weights:
            raise DataError("states of two classifiers cannot be combined")
        index = np.asarray(rows, dtype=np.intp)
        self.hidden[index], self.cell[index] = state.hidden, state.cell


class LstmClassifier(ProbabilityClassifier):
    """LSTM, dropout on its last output, one dense layer; a scikit-learn classifier.

    Two classes share one sigmoid unit and binary cross-entropy, more have a softmax and cross-entropy. The
    optimiser is Adam, the initial weights are those of Keras, which the paper used. The same `random_state`
    gives the same classifier up to the rounding of the trainer: compiled kernels, or torch without kernels or
    on a GPU.

    Args:
        units: units of the LSTM.
        dropout: dropout rate of its outputs in training.
        epochs: passes over the training data.
        min_updates: lower bound on the number of updates: small data sets get as many passes as that takes.
        batch_size: cases per update.
        learning_rate: of Adam; for the schedule "one-cycle" the highest.
        schedule: "constant" as in the paper; "one-cycle" rises over the first quarter of the training and
            falls to 0 along a cosine (Smith and Topin 2018).
        class_weight: None: equal weight of all cases; "balanced": equal total weight of all classes; or class
            name -> weight of each of its cases.
        random_state: seed of the initial weights, the order of cases and the dropout, 0 or above.
        device: device of the training, "cpu" or "cuda"; a trained classifier runs anywhere.
        progress: callback (epochs done, number of epochs) after every epoch.

    Attributes:
        classes_: (K,) the class names in order, set by `fit`.
        weights_: the trained weights, set by `fit`.

    Source: Amiri, Shirazi and Zhang, AAAI 2020, section "Learning"; Hochreiter and Schmidhuber 1997.

    Examples:
        >>> from lcorpp.learning import LstmClassifier
        >>> rising, falling = [[0.0, 0.5, 1.0]], [[1.0, 0.5, 0.0]]  # (channels, time points)
        >>> lstm = LstmClassifier(units=8, epochs=100, learning_rate=0.05)
        >>> lstm = lstm.fit([rising, falling], ["up", "down"])
        >>> lstm.predict([[[0.1, 0.2, 0.9]], [[0.6, 0.4, 0.2]]]).tolist()
        ['up', 'down']
    """

    def __init__(
        self,
        *,
        units: int = 50,
        dropout: float = 0.2,
        epochs: int = 300,
        min_updates: int = 0,
        batch_size: int = 32,
        learning_rate: float = 1e-3,
        schedule: str = "constant",
        class_weight: str | Mapping[Any, float] | None = None,
        random_state: int = 0,
        device: str = "cpu",
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        self.units = units
        self.dropout = dropout
        self.epochs = epochs
        self.min_updates = min_updates
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.schedule = schedule
        self.class_weight = class_weight
        self.random_state = random_state
        self.device = device
        self.progress = progress

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike, sample_weight: npt.ArrayLike | None = None) -> Self:
        """Train from random initial weights.

        Args:
            X: (cases, channels, time points); shorter tracks are padded with NaN, as in `Dataset`. The dense
                layer reads the output at the last point of each.
            y: (cases,) class names.
            sample_weight: (cases,) the weight of each case in the loss, 1 by default, multiplied by that of
                its class.

        Raises:
            DataError: X or y is malformed, there is only one class, a parameter is out of range, the device
                is not available, there are neither compiled kernels nor torch, or the training diverged.
        """
        self._check_parameters()
        inputs, lengths = _to_inputs(check_tracks(X))
        classes, index = np.unique(check_labels(y, len(inputs)), return_inverse=True)
        if len(classes) < 2:
            raise DataError(f"all cases are of class {str(classes[0])!r}; at least two classes are needed")
        given = np.ones(len(index)) if sample_weight is None else np.asarray(sample_weight, dtype=np.float64)
        if given.shape != index.shape or not ((given >= 0) & np.isfinite(given)).all():
            raise DataError(f"{len(index)} cases need as many finite weights from 0, not {given}")
        weights = given * compute_class_weights(self.class_weight, classes, np.asarray(y), given)[index]
        training_set = TrainingSet(
            inputs, lengths, index.astype(np.int32), weights.astype(np.float32), len(classes)
        )
        batches = -(-len(inputs) // int(self.batch_size))
        config = TrainingConfig(
            units=int(self.units),
            dropout=float(self.dropout),
            epochs=max(int(self.epochs), -(-int(self.min_updates) // batches)),
            batch_size=int(self.batch_size),
            learning_rate=float(self.learning_rate),
            schedule=self.schedule,
        )
        rng = np.random.default_rng(self.random_state)
        self.weights_ = train(training_set, config, rng, device=self.device, progress=self.progress)
        self.classes_ = classes
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) the probability of each of `classes_`, rows summing to 1, for X as in `fit`.

        Raises:
            DataError: X is malformed or does not have the channels of the training data.
            NotFittedError: before `fit`.
        """
        weights = self._require_weights()
        inputs, lengths = _to_inputs(check_tracks(X, weights.channels))
        batches = [
            slice(start, start + _PREDICTION_BATCH) for start in range(0, len(inputs), _PREDICTION_BATCH)
        ]
        scores = [weights.network.scores(inputs[batch], lengths[batch]) for batch in batches]
        return _to_probabilities(np.concatenate(scores))

    def begin(self, n: int = 1) -> LstmState:
        """Return the state before the first time point of n tracks, for `advance`.

        Raises:
            NotFittedError: before `fit`.
        """
        weights = self._require_weights()
        hidden, cell = np.zeros((2, n, weights.units), dtype=np.float32)
        return LstmState(weights, hidden, cell)

    def advance(self, state: LstmState, points: npt.ArrayLike) -> Array:
        """(n, K) the probability of each of `classes_` after one more time point of n tracks.

        The cost per time point is constant, and the result equals `predict_proba` of the tracks so far.

        Args:
            state: state of the tracks, from `begin`; updated in place.
            points: (n, channels) the next time point of each track, scaled as in training.

        Raises:
            DataError: `points` are malformed or not finite, or the state belongs to another classifier or to
                this one before it was trained again; the state is unchanged then.
            NotFittedError: before `fit`.
        """
        weights = self._require_weights()
        if state.weights is not weights:
            raise DataError(
                "this state belongs to another classifier, or this one has been trained again since"
            )
        given = np.asarray(points, dtype=np.float64)
        if given.ndim != 2 or len(given) != len(state):
            raise DataError(
                f"expected points of shape ({len(state)}, {weights.channels}), one for each track,"
                f" not {given.shape}"
            )
        if given.shape[1] != weights.channels:
            raise DataError(f"trained on tracks of {weights.channels} channels, given {given.shape[1]}")
        if not np.abs(given).max(initial=0.0) <= _MAX_INPUT:  # true also for NaN
            track, channel = (int(i) for i in np.argwhere(~(np.abs(given) <= _MAX_INPUT))[0])
            raise DataError(
                f"the point of track {track}, channel {channel} (counted from 0) is"
                f" {given[track, channel]}; expected a finite number up to {_MAX_INPUT:g}"
            )
        return _to_probabilities(weights.network.step(state.hidden, state.cell, given.astype(np.float32)))

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The fitted state, for `storage`: the classes and every weight."""
        return {**self._require_weights().arrays(), "classes": self.classes_.astype(np.str_)}

    def restore_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the state that `to_arrays` returned.

        Raises:
            DataError: the weights do not match each other, the classes or `units`.
        """
        weights = Weights.from_arrays({name: w for name, w in arrays.items() if name != "classes"})
        classes = np.atleast_1d(arrays["classes"])
        outputs = 1 if classes.shape == (2,) else len(classes)
        if classes.ndim != 1 or len(classes) < 2 or len(weights.dense) != outputs:
            raise DataError(
                f"the weights of {len(weights.dense)} outputs do not fit classes of shape {classes.shape}"
            )
        if weights.units != self.units:
            raise DataError(f"the weights of {weights.units} units do not fit an LSTM of {self.units}")
        self.classes_, self.weights_ = classes, weights
        return self

    def _require_weights(self) -> Weights:
        weights: Weights | None = getattr(self, "weights_", None)
        if weights is None:
            raise NotFittedError("this LstmClassifier is not trained yet: call fit before")
        return weights

    def _check_parameters(self) -> None:
        for name, minimum in LOWER_BOUNDS.items():
            value = getattr(self, name)
            if not isinstance(value, Integral) or isinstance(value, bool):
                raise DataError(f"{name} must be a whole number, not {value!r}")
            if value < minimum:
                raise DataError(f"{name} must be at least {minimum}, not {value}")
        if not isinstance(self.dropout, Real) or not 0 <= self.dropout < 1:
            raise DataError(f"dropout must lie in [0, 1), not {self.dropout}")
        if not isinstance(self.learning_rate, Real) or not 0 < self.learning_rate <= 1:
            raise DataError(f"learning_rate must lie in (0, 1], not {self.learning_rate}")
        check_value(self.schedule, str, "schedule")
        check_value(self.device, str, "device")
        if self.schedule not in SCHEDULES:
            raise DataError(f"unknown schedule {self.schedule!r}; {expected_one_of(SCHEDULES)}")
        if self.device not in ("cpu", "cuda"):
            raise DataError(f"unknown device {self.device!r}; expected cpu or cuda")


def _to_inputs(tracks: Array) -> tuple[Floats, Lengths]:
    """(cases, time points, channels) float32, 0 as padding, and the (cases,) numbers of time points."""
    lengths = measure_lengths(tracks)
    if lengths.min() < tracks.shape[2]:
        tracks = np.nan_to_num(tracks)
    if np.abs(tracks).max() > _MAX_INPUT:
        raise DataError(f"a track has numbers above {_MAX_INPUT:g}, too large for the LSTM; scale the tracks")
    return np.ascontiguousarray(tracks.transpose(0, 2, 1), dtype=np.float32), lengths


def _to_probabilities(scores: Floats) -> Array:
    """(n, K) probabilities from scores (n, O): the sigmoid of one score, the softmax of several."""
    exact = scores.astype(np.float64)
    if exact.shape[1] == 1:
        exact = np.concatenate([np.zeros_like(exact), exact], axis=1)
    exact -= exact.max(axis=1, keepdims=True)
    np.exp(exact, out=exact)
    exact /= exact.sum(axis=1, keepdims=True)
    return exact

"""MiniRocket: ten thousand convolutions of a series, and a ridge classifier on how often each is high."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.linear_model import RidgeClassifierCV
from sklearn.utils.class_weight import compute_class_weight
from sklearn.utils.validation import check_is_fitted

from lcorpp.arguments import to_numbers
from lcorpp.errors import DataError
from lcorpp.learning.classifiers.running_convolutions import (
    KERNELS,
    N_TAPS,
    Floats,
    RunningConvolutions,
    RunningState,
    is_padded,
    weigh_taps,
)
from lcorpp.learning.contract import ProbabilityClassifier, to_probabilities
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.values import Array, measure_lengths

MAX_DILATIONS = 32

GOLDEN_RATIO = (np.sqrt(5) + 1) / 2
"""Its multiples modulo 1 spread evenly: they are the quantiles at which biases are chosen."""

RIDGE_PENALTIES = np.logspace(-3, 3, 10)

BLOCK_SIZE = 2**20
"""Numbers compared at once: larger blocks leave the cache."""


class MiniRocket(ProbabilityClassifier):
    """MiniRocket for any number of channels and for tracks of unequal lengths; a scikit-learn classifier.

    A feature is the fraction of the time in which a dilated convolution of a few channels exceeds a bias.
    Half of the convolutions see zeros before and after the track; the others count only inside it.
    Channels should be standardized, because convolutions add them. The
    probabilities increase with the scores of the ridge classifier, but are not calibrated.

    Args:
        features: number of features, at least 84; rounded down to a multiple of 84.
        class_weight: "balanced": equal total weight of all classes; None: equal weight of all cases.
        random_state: seed of the channels of each convolution, and of the cases that give its biases.

    Attributes:
        classes_: (K,) the class names in order, set by `fit`.
        dilations_: (D,) the dilations. counts_: (D,) biases of each kernel of a dilation.
        channels_: (84 D, channels) the channels that each convolution adds. biases_: (features,).
        weights_: (1 or K, features), intercept_: (1 or K,); two classes share one row.

    Source: Dempster, Schmidt and Webb, "MiniRocket", KDD 2021, and their code for several channels.
    """

    def __init__(
        self, *, features: int = 10_000, class_weight: str | None = "balanced", random_state: int = 0
    ) -> None:
        self.features = features
        self.class_weight = class_weight
        self.random_state = random_state

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike, sample_weight: npt.ArrayLike | None = None) -> Self:
        """Train on X (cases, channels, time points) and class names y (cases,), with weights (cases,).

        Raises:
            DataError: X is malformed, or `features` is below 84.
        """
        if self.features < len(KERNELS):
            raise DataError(f"MiniRocket needs at least {len(KERNELS)} features, not {self.features}")
        tracks, rng = check_tracks(X), np.random.default_rng(self.random_state)
        self._choose_convolutions(tracks, rng)
        self._choose_biases(tracks, rng)
        features = self._transform(tracks)
        scale = features.std(axis=0, dtype=np.float64)
        scale[scale == 0] = 1.0
        weights = np.ones(len(features)) if sample_weight is None else np.asarray(sample_weight)
        classes, index = np.unique(np.asarray(y), return_inverse=True)
        balance = self.class_weight
        by_class = compute_class_weight(
            balance, classes=classes, y=y, sample_weight=weights if balance else None
        )
        ridge = RidgeClassifierCV(RIDGE_PENALTIES).fit(features / scale, y, weights * by_class[index])
        self.classes_, self.intercept_ = ridge.classes_, np.ravel(ridge.intercept_)
        self.weights_: Array = np.atleast_2d(ridge.coef_) / scale
        self._prepare_streams()
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) numbers that increase with the scores, rows summing to 1, columns as `classes_`.

        Raises:
            DataError: X is malformed or does not have the channels of the training data.
        """
        check_is_fitted(self, "weights_")
        return self._predict(self._transform(check_tracks(X, self.channels_.shape[1])))

    def begin(self, n: int = 1) -> RunningState:
        """Return the state before the first time point of n tracks, for `advance`."""
        check_is_fitted(self, "weights_")
        return self._running.begin(n)

    def advance(self, state: RunningState, points: npt.ArrayLike) -> Array:
        """(n, K) the probabilities after one more time point of n tracks; updates `state` in place.

        The cost of a time point is constant, and the features equal those of `predict_proba` of the tracks so
        far.

        Args:
            points: (n, channels) the next time point of each track, finite.

        Raises:
            DataError: `points` are malformed, or the state belongs to another classifier or to this one
                before it was trained again; the state is unchanged then.
        """
        check_is_fitted(self, "weights_")
        if state.owner is not self._running:
            raise DataError(
                "this state belongs to another classifier, or this one has been trained again since"
            )
        given, shape = to_numbers(points, "the points"), (len(state), self.channels_.shape[1])
        if given.shape != shape or not np.isfinite(given).all():
            raise DataError(f"expected finite points of shape {shape}, one for each track, not {given!r}")
        return self._predict(self._running.advance(state, given.astype(np.float32)))

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The fitted state, for `storage`."""
        check_is_fitted(self, "weights_")
        state = ("dilations", "counts", "channels", "biases", "weights", "intercept")
        return {
            "classes": self.classes_.astype(np.str_),
            **{name: getattr(self, f"{name}_") for name in state},
        }

    def restore_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the state that `to_arrays` returned.

        Raises:
            DataError: the arrays do not match.
        """
        for name, array in arrays.items():
            setattr(self, f"{name}_", array)
        dilations, rows = self.dilations_, 1 if len(self.classes_) == 2 else len(self.classes_)
        features = len(KERNELS) * int(self.counts_.sum())
        if (
            not (dilations.shape == self.counts_.shape == (len(dilations),) and (dilations > 0).all())
            or not (self.counts_ >= 0).all()
            or self.channels_.ndim != 2
            or len(self.channels_) != len(KERNELS) * len(dilations)
            or self.channels_.dtype != np.bool_
            or (self.classes_.ndim, self.biases_.shape) != (1, (features,))
            or (self.weights_.shape, self.intercept_.shape) != ((rows, features), (rows,))
            or not all(np.isfinite(part).all() for part in (self.biases_, self.weights_, self.intercept_))
        ):
            raise DataError("the arrays of a MiniRocket do not match each other")
        self._prepare_streams()
        return self

    def _prepare_streams(self) -> None:
        self._running = RunningConvolutions(self.dilations_, self.counts_, self.channels_, self.biases_)

    def _predict(self, features: Floats) -> Array:
        """(cases, K) the probabilities by the features; case by case, so that no case depends on others."""
        scores = (features[:, None] @ self.weights_.T)[:, 0] + self.intercept_
        return to_probabilities(scores[:, 0] if len(self.classes_) == 2 else scores)

    def _choose_convolutions(self, tracks: Array, rng: np.random.Generator) -> None:
        """Spread the dilations evenly over powers of 2, up to kernels as long as the longest track."""
        channels, longest = tracks.shape[1], int(measure_lengths(tracks).max())
        per_kernel = self.features // len(KERNELS)
        number = min(per_kernel, MAX_DILATIONS)
        exponents = np.linspace(0, np.log2(max((longest - 1) / (N_TAPS - 1), 1)), number)
        self.dilations_, repeats = np.unique((2**exponents).astype(np.int64), return_counts=True)
        self.counts_ = repeats * per_kernel // number
        self.counts_[: per_kernel - self.counts_.sum()] += 1
        convolutions = len(KERNELS) * len(self.dilations_)
        sizes = (2 ** rng.uniform(0, np.log2(min(channels, N_TAPS) + 1), convolutions)).astype(int)
        order = rng.permuted(np.tile(np.arange(channels), (convolutions, 1)), axis=1)
        self.channels_ = order < sizes[:, None]

    def _choose_biases(self, tracks: Array, rng: np.random.Generator) -> None:
        """Take quantiles of each convolution of a random training case."""
        counts = np.repeat(self.counts_, len(KERNELS))
        quantiles = np.split(np.arange(1, counts.sum() + 1) * GOLDEN_RATIO % 1, np.cumsum(counts)[:-1])
        cases, lengths = rng.integers(len(tracks), size=len(counts)), measure_lengths(tracks)
        biases = []
        for number, (case, at) in enumerate(zip(cases, quantiles, strict=True)):
            track = tracks[case : case + 1, :, : lengths[case]].astype(np.float32)
            biases.append(np.quantile(self._convolve(number, track), at))
        self.biases_ = np.concatenate(biases).astype(np.float32)

    def _transform(self, tracks: Array) -> Floats:
        """(cases, features) the fraction of the time in which each convolution exceeds each bias."""
        step = max(1, BLOCK_SIZE // (tracks.shape[2] * int(self.counts_.max())))
        blocks = [tracks[start : start + step] for start in range(0, len(tracks), step)]
        return np.concatenate([self._transform_block(block) for block in blocks])

    def _transform_block(self, tracks: Array) -> Floats:
        ends, times = measure_lengths(tracks)[:, None], np.arange(tracks.shape[2])
        inside, ones = times < ends, np.ones(len(times), dtype=np.float32)
        known = np.nan_to_num(tracks).astype(np.float32)
        biases = np.split(self.biases_, np.cumsum(np.repeat(self.counts_, len(KERNELS)))[:-1])
        features = []
        for number, thresholds in enumerate(biases):
            layer, kernel = divmod(number, len(KERNELS))
            counted = inside
            if not is_padded(layer, kernel):
                reach = self.dilations_[layer] * (N_TAPS // 2)
                counted = (times >= reach) & (times < ends - reach)
            values = np.where(counted, self._convolve(number, known), -np.inf)
            exceeds = (values[:, None] > thresholds[:, None]).astype(np.float32)
            features.append(exceeds @ ones / np.maximum(counted.sum(axis=1, keepdims=True), 1))
        return np.concatenate(features, axis=1, dtype=np.float32)

    def _convolve(self, number: int, tracks: Floats) -> Floats:
        """(cases, time points) a convolution of tracks (cases, channels, time points)."""
        layer, kernel = divmod(number, len(KERNELS))
        dilation, points = int(self.dilations_[layer]), tracks.shape[2]
        reach = dilation * (N_TAPS // 2)
        signal = np.zeros((len(tracks), points + 2 * reach), dtype=tracks.dtype)
        signal[:, reach : reach + points] = tracks[:, self.channels_[number]].sum(axis=1)
        shifted = [signal[:, tap * dilation :][:, :points] for tap in range(N_TAPS)]
        return weigh_taps([shifted[tap] for tap in KERNELS[kernel]], shifted)

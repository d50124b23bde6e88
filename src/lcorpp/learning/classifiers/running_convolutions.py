"""The convolutions of MiniRocket for tracks that grow: a new point changes few of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.values import Flags, Indices

Floats = npt.NDArray[np.float32]

N_TAPS = 9
"""Weights of a kernel: three are 2 and six -1, so that they sum to 0."""

N_SIDE_TAPS = N_TAPS // 2
"""Taps on each side of the point to which a convolution belongs."""

KERNELS = tuple(combinations(range(N_TAPS), 3))
"""The 84 kernels, by the positions of the weights 2."""

BLOCK_SIZE = 2**20
"""Numbers compared at once: larger blocks leave the cache."""


def is_padded(layer: Indices | int, kernel: Indices | int) -> Flags:
    """Whether a convolution sees zeros around the track; the others count only inside it."""
    return np.asarray((layer + kernel) % 2 == 0)


def weigh_taps(high: Iterable[Floats], taps: Sequence[Floats]) -> Floats:
    """Return a convolution: twice the three high taps minus the other six."""
    first, second, third = high
    return np.asarray(3 * (first + second + third) - sum(taps))


@dataclass(frozen=True, eq=False)
class RunningState:
    """The state of n running tracks; `RunningConvolutions.advance` updates it in place.

    owner: the convolutions that created it; no others can advance it.
    recent: (n, points, channels) the last points, as many as the longest kernel; zeros before a track begins.
    lengths: (n,) number of points so far.
    counts: (n, features) the number of points at which each convolution exceeds each of its biases.
    """

    owner: RunningConvolutions
    recent: Floats
    lengths: Indices
    counts: Floats

    def __len__(self) -> int:
        return len(self.lengths)

    def __repr__(self) -> str:
        return f"<RunningState of {len(self)} tracks, {self.counts.shape[1]} features>"

    def take(self, rows: npt.ArrayLike) -> RunningState:
        """Copy the states of some tracks. rows: (k,) indices."""
        return self.select(np.asarray(rows, dtype=np.intp))

    def put(self, rows: npt.ArrayLike, state: RunningState) -> None:
        """Overwrite the states of some tracks in place. rows: (k,) indices for the k tracks of `state`.

        Raises:
            DataError: `state` belongs to another classifier.
        """
        if state.owner is not self.owner:
            raise DataError("states of two classifiers cannot be combined")
        index = np.asarray(rows, dtype=np.intp)
        self.recent[index], self.lengths[index] = state.recent, state.lengths
        self.counts[index] = state.counts

    def select(self, rows: Indices | slice) -> RunningState:
        """Return the states of some tracks: copies by indices, the states themselves by a slice."""
        return RunningState(self.owner, self.recent[rows], self.lengths[rows], self.counts[rows])


class RunningConvolutions:
    """The features of `MiniRocket`, updated by each point of a track: equal to the batch to the last digit.

    A new point changes few convolutions: at the point itself, and at those `N_SIDE_TAPS` taps before it,
    whose kernels saw zeros in its place. So the cost of a point does not depend on the length of the track.

    Args:
        dilations, counts, channels, biases: the attributes of a fitted `MiniRocket`.
    """

    def __init__(
        self,
        dilations: npt.NDArray[np.int64],
        counts: npt.NDArray[np.int64],
        channels: Flags,
        biases: Floats,
    ) -> None:
        self._channels, self._points = channels.shape[1], int((N_TAPS - 1) * dilations.max() + 1)
        layer, kernel = np.divmod(np.arange(len(channels)), len(KERNELS))
        padded = is_padded(layer, kernel)
        number_of = np.repeat(np.arange(len(channels)), np.repeat(counts, len(KERNELS)))
        self._padded, self._inside = (
            _Convolutions(np.flatnonzero(part), positions, dilations, channels, biases, number_of)
            for part, positions in ((padded, N_SIDE_TAPS + 1), (~padded, 1))
        )
        # the counts of a state are those of the padded convolutions, then the others: where is each feature?
        self._order = np.argsort(np.argsort(~padded[number_of], kind="stable"))

    def begin(self, n: int) -> RunningState:
        """Return the state before the first point of n tracks."""
        recent = np.zeros((n, self._points, self._channels), dtype=np.float32)
        counts = np.zeros((n, len(self._order)), dtype=np.float32)
        return RunningState(self, recent, np.zeros(n, dtype=np.intp), counts)

    def advance(self, state: RunningState, points: Floats) -> Floats:
        """(n, features) the features after one more point (n, channels) of n tracks; updates `state`."""
        state.recent[:, :-1] = state.recent[:, 1:]
        state.recent[:, -1] = points
        state.lengths[:] += 1
        step = max(1, BLOCK_SIZE // (len(self._order) * N_SIDE_TAPS))
        starts = range(0, max(1, len(state)), step)
        return np.concatenate([self._update(state.select(slice(start, start + step))) for start in starts])

    def _update(self, state: RunningState) -> Floats:
        padded, inside, split = self._padded, self._inside, len(self._padded.biases)
        lengths = state.lengths[:, None, None]
        signal, is_seen = padded.add_channels(state.recent), lengths > padded.ages
        state.counts[:, :split] += padded.count(signal, is_seen)
        signal[:, N_TAPS - 1], is_seen[:, -1] = 0, False  # as they were before this point
        state.counts[:, :split] -= padded.count(signal, is_seen)
        complete = lengths - 2 * inside.ages  # points at which the whole kernel lies inside the track
        state.counts[:, split:] += inside.count(inside.add_channels(state.recent), complete > 0)
        fractions = [
            state.counts[:, :split] / state.lengths.astype(np.float32)[:, None],
            state.counts[:, split:]
            / np.maximum(complete[:, 0], 1).astype(np.float32).take(inside.columns, axis=1, mode="clip"),
        ]
        return np.concatenate(fractions, axis=1).take(self._order, axis=1, mode="clip")


class _Convolutions:
    """Half of the convolutions at few positions: `N_SIDE_TAPS` taps before the last point, one tap later, ...

    numbers: (W,) of the convolutions, the same kernels of every second layer. positions: how many.
    dilations, channels, biases: as for `RunningConvolutions`. number_of: (features,) convolution of each.

    Attributes:
        biases: (F,) of these convolutions. columns: (F,) the index of the convolution of each.
        ages: (positions, W) number of points from each position to the last point.
    """

    def __init__(
        self,
        numbers: Indices,
        positions: int,
        dilations: npt.NDArray[np.int64],
        channels: Flags,
        biases: Floats,
        number_of: Indices,
    ) -> None:
        layer, kernel = np.divmod(numbers, len(KERNELS))
        starts, width = np.arange(positions)[:, None], len(numbers)
        is_own = np.isin(number_of, numbers)
        self.biases, self.columns = biases[is_own], np.searchsorted(numbers, number_of[is_own])
        self.ages = (N_SIDE_TAPS - starts) * dilations[layer]
        self._taps = -1 - np.arange(N_TAPS - 1, -1, -1)[:, None] * dilations
        self._channels = channels[numbers].T.reshape(-1, len(dilations), width // len(dilations))
        self._high = [
            ((starts + tap) * width + np.arange(width)).ravel() for tap in np.array(KERNELS)[kernel].T
        ]
        self._compared = (starts * width + self.columns).ravel()

    def add_channels(self, recent: Floats) -> Floats:
        """Return (n, N_TAPS + positions - 1, W) the last points at the taps, and zeros for those to come."""
        seen = recent[:, self._taps]
        signal = np.zeros((len(recent), N_TAPS + len(self.ages) - 1, *self._channels.shape[1:]), np.float32)
        for channel, is_added in enumerate(self._channels):
            signal[:, :N_TAPS] += seen[..., channel, None] * is_added
        return signal.reshape(*signal.shape[:2], -1)

    def count(self, signal: Floats, is_counted: Flags) -> npt.NDArray[np.int8]:
        """(n, F) the number of positions, among those counted (n, positions, W), above each bias."""
        n, positions = len(signal), len(self.ages)
        flat = signal.reshape(n, -1)
        high = (flat.take(at, axis=1, mode="clip").reshape(is_counted.shape) for at in self._high)
        values = weigh_taps(high, [signal[:, tap : tap + positions] for tap in range(N_TAPS)])
        values = np.where(is_counted, values, -np.inf).reshape(n, -1)
        exceeds = values.take(self._compared, axis=1, mode="clip").reshape(n, positions, -1) > self.biases
        return np.asarray(exceeds.view(np.int8).sum(axis=1, dtype=np.int8))

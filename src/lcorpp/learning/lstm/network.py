"""The LSTM forward in time: compiled, or its numpy twin where there was no compiler at installation."""

from __future__ import annotations

from functools import cache
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]


class Network(Protocol):
    """What weights make of tracks. All arrays are float32 and contiguous in C order."""

    def scores(self, tracks: Floats, /) -> Floats:
        """(n, O) the scores after the last time point of tracks (n, time points, C)."""

    def step(self, hidden: Floats, cell: Floats, points: Floats, /) -> Floats:
        """(n, O) the scores after one more time point (n, C) of n tracks.

        hidden, cell: (n, U) the state before, and changed in place to the state after.
        """


class NumpyNetwork:
    """The LSTM by its equations, one time point after the other (Hochreiter and Schmidhuber 1997)."""

    def __init__(
        self, inputs: Floats, recurrent: Floats, bias: Floats, dense: Floats, dense_bias: Floats
    ) -> None:
        self._both = np.ascontiguousarray(np.concatenate([inputs, recurrent], axis=1).T)
        self._bias, self._dense, self._dense_bias = bias, np.ascontiguousarray(dense.T), dense_bias
        self._units = recurrent.shape[1]

    def scores(self, tracks: Floats, /) -> Floats:
        """As in `Network`."""
        hidden, cell = np.zeros((2, len(tracks), self._units), dtype=np.float32)
        for points in tracks.transpose(1, 0, 2):
            self._advance(hidden, cell, points)
        return self._scores(hidden)

    def step(self, hidden: Floats, cell: Floats, points: Floats, /) -> Floats:
        """As in `Network`."""
        self._advance(hidden, cell, points)
        return self._scores(hidden)

    def _advance(self, hidden: Floats, cell: Floats, points: Floats) -> None:
        U = self._units
        gates = np.concatenate([points, hidden], axis=1) @ self._both
        gates += self._bias
        new = np.tanh(gates[:, 2 * U : 3 * U])
        gates *= np.float32(0.5)  # sigmoid(x) = (1 + tanh(x / 2)) / 2
        np.tanh(gates, out=gates)
        gates += np.float32(1)
        gates *= np.float32(0.5)
        cell *= gates[:, U : 2 * U]
        cell += gates[:, :U] * new
        np.multiply(gates[:, 3 * U :], np.tanh(cell), out=hidden)

    def _scores(self, hidden: Floats) -> Floats:
        return np.asarray(hidden @ self._dense + self._dense_bias, dtype=np.float32)


def network_of(inputs: Floats, recurrent: Floats, bias: Floats, dense: Floats, dense_bias: Floats) -> Network:
    """The network of some weights, shaped as in `Weights`."""
    kernels = compiled()
    kind = NumpyNetwork if kernels is None else kernels.Network
    network: Network = kind(inputs, recurrent, bias, dense, dense_bias)
    return network


@cache
def compiled() -> Any:
    """The module of the compiled kernels, None where there was no compiler at installation."""
    try:
        from lcorpp.learning.lstm import _kernels
    except ImportError:
        return None
    return _kernels

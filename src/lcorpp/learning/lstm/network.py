"""LSTM network: its weights and its forward pass, by compiled kernels or by numpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache, cached_property
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.values import Lengths

Floats = npt.NDArray[np.float32]


class Network(Protocol):
    """An LSTM with fixed weights. Its scores are logits: the inputs of the sigmoid or the softmax.

    All arrays are float32 and contiguous in C order.
    """

    def scores(self, tracks: Floats, lengths: Lengths, /) -> Floats:
        """(n, O) the scores of tracks (n, time points, C) after the last of their `lengths` (n,) points."""

    def step(self, hidden: Floats, cell: Floats, points: Floats, /) -> Floats:
        """(n, O) the scores after one more time point (n, C) of n tracks.

        hidden, cell: (n, U) the state before the time point; overwritten by the state after it.
        """


@dataclass(frozen=True, eq=False)
class Weights:
    """The weights of an LSTM of U units over C channels with O outputs, all float32 and read-only.

    The 4 U rows are U input gates, U forget gates, U candidates of the cells and U output gates. O is 1 for
    two classes, else the number of classes.

    inputs: (4 U, C).
    recurrent: (4 U, U).
    bias: (4 U,).
    dense: (O, U).
    dense_bias: (O,).
    """

    inputs: Floats
    recurrent: Floats
    bias: Floats
    dense: Floats
    dense_bias: Floats

    def __post_init__(self) -> None:
        for name, weight in self.arrays().items():
            copy = np.array(weight, dtype=np.float32, order="C")
            copy.setflags(write=False)
            object.__setattr__(self, name, copy)
        if [weight.ndim for weight in self.arrays().values()] != [2, 2, 1, 2, 1]:
            raise DataError("the weights of an LSTM are matrices, its biases vectors")
        units, outputs = self.units, len(self.dense)
        expected = {
            "inputs": (4 * units, self.channels),
            "recurrent": (4 * units, units),
            "bias": (4 * units,),
            "dense": (outputs, units),
            "dense_bias": (outputs,),
        }
        shapes = {name: weight.shape for name, weight in self.arrays().items()}
        if shapes != expected or 0 in (units, self.channels, outputs):
            raise DataError(f"an LSTM of {units} units needs weights {expected}, not {shapes}")
        if not all(np.isfinite(weight).all() for weight in self.arrays().values()):
            raise DataError("an LSTM needs finite weights")

    def __repr__(self) -> str:
        return f"<Weights: {self.channels} channels, {self.units} units, {len(self.dense)} outputs>"

    @classmethod
    def initialize(cls, channels: int, units: int, outputs: int, rng: np.random.Generator) -> Self:
        """Draw initial weights as Keras does: Glorot, orthogonal recurrent weights, forget bias 1."""
        bias = np.zeros(4 * units, dtype=np.float32)
        bias[units : 2 * units] = 1.0
        return cls(
            _glorot(4 * units, channels, rng),
            _orthogonal(4 * units, units, rng),
            bias,
            _glorot(outputs, units, rng),
            np.zeros(outputs, dtype=np.float32),
        )

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the weights that `arrays` returned.

        Raises:
            DataError: an array is missing, or the arrays do not match.
        """
        names = {field.name for field in fields(cls)}
        if set(arrays) != names:
            raise DataError(f"an LSTM has the weights {', '.join(sorted(names))}, not {sorted(arrays)}")
        return cls(**arrays)

    def arrays(self) -> dict[str, Floats]:
        """Return the weights by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def units(self) -> int:
        """U."""
        return int(self.recurrent.shape[1])

    @property
    def channels(self) -> int:
        """C."""
        return int(self.inputs.shape[1])

    @cached_property
    def network(self) -> Network:
        """The forward pass with these weights."""
        kernels = load_kernels()
        network: Network = (kernels.Network if kernels else NumpyNetwork)(**self.arrays())
        return network

    def __reduce__(self) -> tuple[type[Self], tuple[Floats, ...]]:
        return type(self), tuple(self.arrays().values())  # without the cached network


class NumpyNetwork:
    """The LSTM equations in numpy, one time point after the other (Hochreiter and Schmidhuber 1997)."""

    def __init__(
        self, inputs: Floats, recurrent: Floats, bias: Floats, dense: Floats, dense_bias: Floats
    ) -> None:
        self._gate_weights = np.ascontiguousarray(np.concatenate([inputs, recurrent], axis=1).T)
        self._bias, self._dense, self._dense_bias = bias, np.ascontiguousarray(dense.T), dense_bias
        self._units = recurrent.shape[1]

    def scores(self, tracks: Floats, lengths: Lengths, /) -> Floats:
        """As `Network.scores`."""
        hidden, cell, last = np.zeros((3, len(tracks), self._units), dtype=np.float32)
        for count, points in enumerate(tracks.transpose(1, 0, 2), start=1):
            self._advance(hidden, cell, points)
            last[lengths == count] = hidden[lengths == count]
        return self._apply_dense(last)

    def step(self, hidden: Floats, cell: Floats, points: Floats, /) -> Floats:
        """As `Network.step`."""
        self._advance(hidden, cell, points)
        return self._apply_dense(hidden)

    def _advance(self, hidden: Floats, cell: Floats, points: Floats) -> None:
        U = self._units
        gates = np.concatenate([points, hidden], axis=1) @ self._gate_weights
        gates += self._bias
        candidate = np.tanh(gates[:, 2 * U : 3 * U])
        gates *= np.float32(0.5)  # sigmoid(x) = (1 + tanh(x / 2)) / 2; the candidates' columns are not used
        np.tanh(gates, out=gates)
        gates += np.float32(1)
        gates *= np.float32(0.5)
        cell *= gates[:, U : 2 * U]
        cell += gates[:, :U] * candidate
        np.multiply(gates[:, 3 * U :], np.tanh(cell), out=hidden)

    def _apply_dense(self, hidden: Floats) -> Floats:
        return np.asarray(hidden @ self._dense + self._dense_bias, dtype=np.float32)


@cache
def load_kernels() -> Any:
    """Import the compiled kernels; None if the compiler at installation was too old for them."""
    try:
        import lcorpp.learning.lstm._kernels as kernels
    except ImportError:
        return None
    return kernels


def _glorot(rows: int, columns: int, rng: np.random.Generator) -> Floats:
    """Uniform weights that preserve the scale of signals (Glorot and Bengio 2010)."""
    limit = np.sqrt(6 / (rows + columns))
    return rng.uniform(-limit, limit, size=(rows, columns)).astype(np.float32)


def _orthogonal(rows: int, columns: int, rng: np.random.Generator) -> Floats:
    """A matrix with orthonormal columns, uniform among all such (Saxe, McClelland and Ganguli 2014)."""
    q, r = np.linalg.qr(rng.normal(size=(rows, columns)))
    return np.asarray(q * np.where(np.diag(r) < 0, -1, 1), dtype=np.float32)

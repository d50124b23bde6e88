"""What an LSTM classifier has learnt: its weights, how they start, and the network they make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.learning.lstm.network import Network, network_of

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Weights:
    """The weights of an LSTM of U units over C channels with O outputs, all float32 and read-only.

    The 4 U rows are the gates: input, forget, cell and output, U each. O is 1 for two classes, else their
    number.

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
        units, outputs = self.units, len(self.dense)
        wanted = {
            "inputs": (4 * units, self.channels),
            "recurrent": (4 * units, units),
            "bias": (4 * units,),
            "dense": (outputs, units),
            "dense_bias": (outputs,),
        }
        found = {name: weight.shape for name, weight in self.arrays().items()}
        if found != wanted or 0 in (units, self.channels, outputs):
            raise DataError(f"an LSTM of {units} units needs weights {wanted}, not {found}")
        if not all(np.isfinite(weight).all() for weight in self.arrays().values()):
            raise DataError("an LSTM needs finite weights")

    @classmethod
    def start(cls, channels: int, units: int, outputs: int, rng: np.random.Generator) -> Self:
        """First weights as in Keras: Glorot, orthogonal between the units, forget gates open."""
        bias = np.zeros(4 * units)
        bias[units : 2 * units] = 1.0
        return cls(
            _glorot(4 * units, channels, rng),
            _orthogonal(4 * units, units, rng),
            bias.astype(np.float32),
            _glorot(outputs, units, rng),
            np.zeros(outputs, dtype=np.float32),
        )

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Take over what `arrays` gave.

        Raises:
            DataError: these are not the weights of an LSTM, or do not fit each other.
        """
        names = {field.name for field in fields(cls)}
        if set(arrays) != names:
            raise DataError(f"an LSTM has the weights {', '.join(sorted(names))}, not {sorted(arrays)}")
        if any(arrays[name].ndim != 1 + (name not in ("bias", "dense_bias")) for name in names):
            raise DataError("the weights of an LSTM are matrices, its biases vectors")
        return cls(**arrays)

    def arrays(self) -> dict[str, Floats]:
        """The weights by their names."""
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
        """The network that these weights make."""
        return network_of(**self.arrays())

    def __getstate__(self) -> dict[str, Floats]:
        return self.arrays()  # the network is made again where it is needed


def _glorot(rows: int, columns: int, rng: np.random.Generator) -> Floats:
    """Uniform, of a width that keeps the size of signals (Glorot and Bengio 2010)."""
    limit = np.sqrt(6 / (rows + columns))
    return rng.uniform(-limit, limit, size=(rows, columns)).astype(np.float32)


def _orthogonal(rows: int, columns: int, rng: np.random.Generator) -> Floats:
    """Orthonormal columns, uniform among all such (Saxe, McClelland and Ganguli 2014)."""
    q, r = np.linalg.qr(rng.normal(size=(rows, columns)))
    return np.asarray(q * np.where(np.diag(r) < 0, -1, 1), dtype=np.float32)

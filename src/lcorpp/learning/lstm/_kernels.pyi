"""
LSTM kernels in C++: training and prediction; see lcorpp.learning.lstm.network and trainer.
"""

import numpy
import numpy.typing
from numpy.typing import NDArray


def instruction_sets() -> list[str]:
    """
    Return the instruction sets that this machine supports, the fastest first.
    """

class Network:
    """The forward pass with fixed weights; see `network.Network`."""

    def __init__(self, inputs: numpy.typing.NDArray[numpy.float32], recurrent: numpy.typing.NDArray[numpy.float32], bias: numpy.typing.NDArray[numpy.float32], dense: numpy.typing.NDArray[numpy.float32], dense_bias: numpy.typing.NDArray[numpy.float32], instruction_set: str | None = None) -> None: ...

    def scores(self, tracks: numpy.typing.NDArray[numpy.float32], lengths: numpy.typing.NDArray[numpy.int64]) -> numpy.typing.NDArray[numpy.float32]:
        """
        Return the scores (n, O) after the last of the `lengths` (n,) time points of tracks (n, time points, C).
        """

    def step(self, hidden: numpy.typing.NDArray[numpy.float32], cell: numpy.typing.NDArray[numpy.float32], points: numpy.typing.NDArray[numpy.float32]) -> numpy.typing.NDArray[numpy.float32]:
        """
        Return the scores (n, O) after one more time point (n, C); updates hidden and cell (n, U) in place.
        """

class Trainer:
    """A training: the current weights and the moments of Adam."""

    def __init__(self, inputs: numpy.typing.NDArray[numpy.float32], recurrent: numpy.typing.NDArray[numpy.float32], bias: numpy.typing.NDArray[numpy.float32], dense: numpy.typing.NDArray[numpy.float32], dense_bias: numpy.typing.NDArray[numpy.float32], tracks: numpy.typing.NDArray[numpy.float32], lengths: numpy.typing.NDArray[numpy.int64], targets: numpy.typing.NDArray[numpy.int32], weights: numpy.typing.NDArray[numpy.float32], batch: int, keep: float, instruction_set: str | None = None) -> None: ...

    def epoch(self, order: numpy.typing.NDArray[numpy.int64], dropout_mask: numpy.typing.NDArray[numpy.bool_], rates: numpy.typing.NDArray[numpy.float64]) -> None:
        """
        Train on all cases once: order (n,), dropout mask (n, U) of the outputs kept, rates (batches,).
        """

    def weights(self) -> tuple[NDArray[numpy.float32], NDArray[numpy.float32], NDArray[numpy.float32], NDArray[numpy.float32], NDArray[numpy.float32]]:
        """
        Return the current weights: inputs, recurrent, bias, dense, dense_bias.
        """

"""LSTM trainer: its training set, configuration and protocol, and the compiled trainer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.learning.lstm.network import Floats, Weights, load_kernels
from lcorpp.values import Array, Flags, Indices, Lengths


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """The training data, n cases.

    inputs: (n, time points, channels), finite. lengths: (n,) the number of time points of each case; numbers
        after them have no effect.
    targets: (n,) the class of each case, 0 to classes - 1. weights: (n,) the weight of each case in the loss.
    """

    inputs: Floats
    lengths: Lengths
    targets: npt.NDArray[np.int32]
    weights: Floats
    classes: int

    def __len__(self) -> int:
        return len(self.inputs)


@dataclass(frozen=True)
class TrainingConfig:
    """The hyperparameters; `LstmClassifier` describes them."""

    units: int
    dropout: float
    epochs: int
    batch_size: int
    learning_rate: float
    schedule: str


class Trainer(Protocol):
    """The state of a training: current weights and the moments of Adam."""

    def run_epoch(self, order: Indices, dropout_mask: Flags, rates: Array) -> None:
        """Train on all cases once.

        order: (n,) of the cases. dropout_mask: (n, units) which outputs of the LSTM are kept, in that order.
        rates: (batches,) the learning rate of each update.
        """

    def weights(self) -> Weights:
        """Return the current weights."""


class CompiledTrainer:
    """A `Trainer` in C++, see native/lstm/trainer.cpp.

    Args:
        instruction_set: one of `_kernels.instruction_sets()`; None selects the best.
    """

    def __init__(
        self,
        start: Weights,
        training_set: TrainingSet,
        config: TrainingConfig,
        *,
        instruction_set: str | None = None,
    ) -> None:
        tracks = training_set.inputs, training_set.lengths
        cases = *tracks, training_set.targets, training_set.weights
        self._trainer = load_kernels().Trainer(
            *start.arrays().values(), *cases, config.batch_size, 1 - config.dropout, instruction_set
        )

    def run_epoch(self, order: Indices, dropout_mask: Flags, rates: Array) -> None:
        """As `Trainer.run_epoch`; Ctrl-C interrupts between two updates."""
        self._trainer.epoch(order, dropout_mask, rates)

    def weights(self) -> Weights:
        """As `Trainer.weights`."""
        return Weights(*self._trainer.weights())

"""Training: what is drawn and how fast it learns, whoever computes the gradients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.learning.lstm.network import compiled
from lcorpp.learning.lstm.weights import Floats, Weights
from lcorpp.values import Array

SCHEDULES = ("constant", "one-cycle")
"""How the learning rate may change."""

RISE, LOWEST = 0.25, 0.04
"""Of "one-cycle": the share of the training in which the rate rises, and where it starts, as a share of the
highest."""


@dataclass(frozen=True, eq=False)
class Cases:
    """What is learnt from.

    inputs: (n, time points, channels) float32.
    targets: (n,) int32, the class of each case, 0 to classes - 1.
    weights: (n,) float32, how much each case counts.
    classes: K.
    """

    inputs: Floats
    targets: npt.NDArray[np.int32]
    weights: Floats
    classes: int

    def __len__(self) -> int:
        return len(self.inputs)


@dataclass(frozen=True)
class Plan:
    """How it is learnt; `LstmClassifier` says what each means."""

    units: int
    dropout: float
    epochs: int
    batch_size: int
    learning_rate: float
    schedule: str


@dataclass(frozen=True, eq=False)
class Draw:
    """What one epoch over n cases leaves to chance.

    order: (n,) int64, in which the cases come.
    kept: (n, units) which outputs of the LSTM are not silenced, in that order.
    """

    order: npt.NDArray[np.int64]
    kept: npt.NDArray[np.bool_]


class Trainer(Protocol):
    """Weights on their way, and Adam's memory of their gradients."""

    def epoch(self, draw: Draw, rates: Array) -> None:
        """Go through all cases once. rates: (batches,) the learning rate of each update."""

    def weights(self) -> Weights:
        """What was learnt so far."""


def train(
    cases: Cases,
    plan: Plan,
    rng: np.random.Generator,
    *,
    device: str,
    progress: Callable[[int, int], None] | None,
) -> Weights:
    """Weights learnt from cases.

    Raises:
        DataError: the device is not there, or neither compiled kernels nor torch are, or the training
            diverged.
    """
    outputs = 1 if cases.classes == 2 else cases.classes
    start = Weights.start(cases.inputs.shape[2], plan.units, outputs, rng)
    trainer = trainer_for(device)(start, cases, plan)
    rates = learning_rates(plan, len(cases))
    keep = 1 - plan.dropout
    for epoch in range(plan.epochs):
        order = rng.permutation(len(cases))
        kept = rng.random((len(cases), plan.units), dtype=np.float32) < keep
        trainer.epoch(Draw(order, kept), rates[epoch])
        if progress is not None:
            progress(epoch + 1, plan.epochs)
    try:
        return trainer.weights()
    except DataError:
        raise DataError(
            f"the training diverged; expected a learning rate below {plan.learning_rate:g}, or smaller inputs"
        ) from None


def learning_rates(plan: Plan, cases: int) -> Array:
    """(epochs, batches) the learning rate of every update."""
    batches = -(-cases // plan.batch_size)
    if plan.schedule == "constant":
        return np.full((plan.epochs, batches), plan.learning_rate)
    done = (np.arange(plan.epochs * batches) + 0.5) / (plan.epochs * batches)
    rising = LOWEST + (1 - LOWEST) * (1 - np.cos(np.pi * done / RISE)) / 2
    falling = (1 + np.cos(np.pi * (done - RISE) / (1 - RISE))) / 2
    shares = np.where(done < RISE, rising, falling)
    return np.asarray(plan.learning_rate * shares.reshape(plan.epochs, batches), dtype=np.float64)


def trainer_for(device: str) -> Callable[[Weights, Cases, Plan], Trainer]:
    """Who computes the gradients on a device: the compiled kernels, or torch.

    Raises:
        DataError: the device is not there, or neither of the two is.
    """
    if device == "cpu" and compiled() is not None:
        from lcorpp.learning.lstm.compiled_trainer import CompiledTrainer

        return CompiledTrainer
    from lcorpp.learning.lstm.torch_trainer import TorchTrainer, check_cuda

    if device == "cuda":
        check_cuda()
    return partial(TorchTrainer, device=device)

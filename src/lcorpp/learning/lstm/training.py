"""LSTM training: the epoch loop, learning rate schedule, class weights and the choice of trainer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.utils.class_weight import compute_class_weight

from lcorpp.errors import DataError
from lcorpp.learning.lstm.network import Weights, load_kernels
from lcorpp.learning.lstm.trainer import CompiledTrainer, Trainer, TrainingConfig, TrainingSet
from lcorpp.values import Array

SCHEDULES = ("constant", "one-cycle")
"""The learning rate schedules."""

WARMUP, START_RATE = 0.25, 0.04
"""Of "one-cycle": the fraction of the training in which the rate rises, and the initial rate as a fraction of
the highest."""


def train(
    training_set: TrainingSet,
    config: TrainingConfig,
    rng: np.random.Generator,
    *,
    device: str,
    progress: Callable[[int, int], None] | None,
) -> Weights:
    """Train an LSTM from random weights.

    Raises:
        DataError: the device is not available, there are neither compiled kernels nor torch, or the training
            diverged.
    """
    outputs = 1 if training_set.classes == 2 else training_set.classes
    start = Weights.initialize(training_set.inputs.shape[2], config.units, outputs, rng)
    trainer = select_trainer(device)(start, training_set, config)
    rates = compute_learning_rates(config, len(training_set))
    for epoch in range(config.epochs):
        order = rng.permutation(len(training_set))
        mask = rng.random((len(training_set), config.units), dtype=np.float32) < 1 - config.dropout
        trainer.run_epoch(order, mask, rates[epoch])
        if progress is not None:
            progress(epoch + 1, config.epochs)
    try:
        return trainer.weights()
    except DataError:
        raise DataError(
            f"the training diverged; expected a learning rate below {config.learning_rate:g},"
            " or smaller inputs"
        ) from None


def compute_learning_rates(config: TrainingConfig, cases: int) -> Array:
    """(epochs, batches) the learning rate of every update."""
    batches = -(-cases // config.batch_size)
    if config.schedule == "constant":
        return np.full((config.epochs, batches), config.learning_rate)
    done = (np.arange(config.epochs * batches) + 0.5) / (config.epochs * batches)
    rising = START_RATE + (1 - START_RATE) * (1 - np.cos(np.pi * done / WARMUP)) / 2
    falling = (1 + np.cos(np.pi * (done - WARMUP) / (1 - WARMUP))) / 2
    factors = np.where(done < WARMUP, rising, falling)
    return np.asarray(config.learning_rate * factors.reshape(config.epochs, batches), dtype=np.float64)


def compute_class_weights(
    weighting: str | Mapping[Any, float] | None,
    classes: npt.NDArray[Any],
    labels: npt.NDArray[Any],
    weights: Array,
) -> Array:
    """(K,) the weight of a case of each class, as in scikit-learn.

    Args:
        weighting: None: 1 for all; "balanced": equal total weight of all classes; or class name -> weight.
        classes: (K,) the class names. labels, weights: (cases,).

    Raises:
        DataError: `weighting` is none of these, has an unknown class, or a weight that is not positive and
            finite.
    """
    given = dict(weighting) if isinstance(weighting, Mapping) else weighting
    try:
        found = compute_class_weight(given, classes=classes, y=labels, sample_weight=weights)
    except ValueError as error:
        raise DataError(f"class_weight: {error}") from None
    if not ((found > 0) & np.isfinite(found)).all():
        raise DataError(f"the weights of class_weight must be positive and finite, not {given}")
    return np.asarray(found, dtype=np.float64)


def select_trainer(device: str) -> Callable[[Weights, TrainingSet, TrainingConfig], Trainer]:
    """Return the trainer for a device: the compiled one, or torch's on a GPU and without kernels.

    Raises:
        DataError: there are neither compiled kernels nor torch.
    """
    if device == "cpu" and load_kernels() is not None:
        return CompiledTrainer
    from lcorpp.learning.lstm.torch_trainer import TorchTrainer

    return partial(TorchTrainer, device=device)

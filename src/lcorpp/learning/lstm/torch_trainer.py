"""LSTM trainer in torch: for a GPU, and for installations without compiled kernels.

This is the only module that imports torch.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.learning.lstm.network import Weights
from lcorpp.learning.lstm.trainer import TrainingConfig, TrainingSet
from lcorpp.values import Array, Flags, Indices

try:
    import torch
    from torch import nn
    from torch.nn import functional
except ModuleNotFoundError:
    raise DataError(
        "to train the LSTM on a GPU, or without the compiled kernels, torch is needed, which is not"
        " installed: pip install 'lcorpp[torch]'"
    ) from None


class TorchTrainer:
    """A `Trainer` with the gradients of torch.

    Raises:
        DataError: the device is "cuda", and torch sees no GPU.
    """

    def __init__(
        self, start: Weights, training_set: TrainingSet, config: TrainingConfig, device: str
    ) -> None:
        if device == "cuda" and not torch.cuda.is_available():
            raise DataError("device 'cuda' is not available here: torch sees no GPU; expected cpu")
        self._config, self._device, self._binary = config, device, training_set.classes == 2
        # Created on "meta", so that torch's global random state is not used.
        lstm = nn.LSTM(start.channels, start.units, batch_first=True, device="meta")
        self._lstm = lstm.to_empty(device=device)
        self._lstm.bias_hh_l0.requires_grad_(False).zero_()  # torch has two biases; one is enough
        self._lstm.weight_ih_l0.data.copy_(_tensor(start.inputs))
        self._lstm.weight_hh_l0.data.copy_(_tensor(start.recurrent))
        self._lstm.bias_ih_l0.data.copy_(_tensor(start.bias))
        self._dense = _tensor(start.dense).to(device).requires_grad_()
        self._dense_bias = _tensor(start.dense_bias).to(device).requires_grad_()
        self._adam = _Adam(self._parameters())
        self._inputs = _tensor(training_set.inputs).to(device)
        self._last_points = _tensor(training_set.lengths - 1).to(device)
        kind = torch.float32 if self._binary else torch.int64
        self._targets = _tensor(training_set.targets).to(device, kind)
        self._weights = _tensor(training_set.weights).to(device)

    def run_epoch(self, order: Indices, dropout_mask: Flags, rates: Array) -> None:
        """As `Trainer.run_epoch`."""
        size = self._config.batch_size
        with _one_thread():
            rows_of = torch.from_numpy(order).to(self._device).split(size)
            masks = torch.from_numpy(dropout_mask) / (1 - self._config.dropout)
            masks_of = masks.to(self._device, torch.float32).split(size)
            for rows, mask, rate in zip(rows_of, masks_of, rates, strict=True):
                for parameter in self._parameters():
                    parameter.grad = None
                self._loss(rows, mask).backward()
                self._adam.step(float(rate))

    def weights(self) -> Weights:
        """As `Trainer.weights`."""
        return Weights(*(parameter.detach().cpu().numpy() for parameter in self._parameters()))

    def _parameters(self) -> list[torch.Tensor]:
        """In the order of `Weights`."""
        lstm = self._lstm
        return [lstm.weight_ih_l0, lstm.weight_hh_l0, lstm.bias_ih_l0, self._dense, self._dense_bias]

    def _loss(self, rows: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        outputs = self._lstm(self._inputs[rows])[0]
        last = outputs[torch.arange(len(rows), device=self._device), self._last_points[rows]]
        scores, targets = functional.linear(last * mask, self._dense, self._dense_bias), self._targets[rows]
        if self._binary:
            losses = functional.binary_cross_entropy_with_logits(scores[:, 0], targets, reduction="none")
        else:
            losses = functional.cross_entropy(scores, targets, reduction="none")
        return (losses * self._weights[rows]).mean()


class _Adam:
    """Adam with the results of torch.optim.Adam, which loads a compiler and so costs every process 2 seconds.

    Source: Kingma and Ba 2015, algorithm 1, with decay rates .9 and .999 and epsilon 1e-8.
    """

    def __init__(self, parameters: list[torch.Tensor]) -> None:
        self.parameters, self.steps = parameters, 0
        self.first = [torch.zeros_like(p) for p in parameters]
        self.second = [torch.zeros_like(p) for p in parameters]

    @torch.no_grad()  # type: ignore[untyped-decorator]
    def step(self, rate: float) -> None:
        """Update every parameter by its gradient."""
        self.steps += 1
        size = rate / (1 - 0.9**self.steps)
        correction = (1 - 0.999**self.steps) ** 0.5
        for parameter, first, second in zip(self.parameters, self.first, self.second, strict=True):
            gradient = parameter.grad
            first.lerp_(gradient, 0.1)
            second.mul_(0.999).addcmul_(gradient, gradient, value=0.001)
            parameter.addcdiv_(first, (second.sqrt() / correction).add_(1e-8), value=-size)


def _tensor(array: npt.NDArray[Any]) -> torch.Tensor:
    return torch.from_numpy(np.array(array))  # a copy: torch rejects read-only arrays


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limit torch to one thread: on matrices this small more threads wait for each other, up to 80 times
    longer on a busy machine. Folds run as processes instead."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)

"""The paper's classifier: an LSTM over motion. This is the only module that imports torch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.validation import check_is_fitted

from lcorpp.errors import DataError
from lcorpp.learning.dataset import checked_tracks
from lcorpp.values import Array

try:
    import torch
    from torch import nn
    from torch.nn import functional
except ModuleNotFoundError:
    raise DataError("the LSTM needs torch, which is not installed: pip install 'lcorpp[torch]'") from None

_ROWS_AT_ONCE = 4096
"""Predictions are made in parts of this many cases, so that memory stays bounded."""

_LARGEST = 1e30
"""Inputs up to here, times any weight, are finite in float32."""


class LstmClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """LSTM, dropout on its last output, one dense layer; a scikit-learn classifier.

    Two classes share one sigmoid unit and binary cross-entropy, more have a softmax and cross-entropy.
    Optimised by Adam. The same `random_state` on the same device gives the same classifier, and torch's
    global random state is neither used nor changed. Weights start as in Keras, which the paper used.

    Args:
        units: memory units of the LSTM.
        dropout: share of its outputs silenced in training.
        epochs: passes over the training data.
        batch_size: cases between two updates.
        learning_rate: of Adam.
        random_state: seed of the first weights, the order of cases and the dropout.
        device: "cpu" or "cuda".
        progress: told (epochs done, epochs in all) after every epoch.

    Attributes:
        classes_: (K,) the class names in order, after `fit`.
        weights_: name -> float32 array, after `fit`.

    Source: Amiri, Shirazi and Zhang, AAAI 2020, section "Learning"; Hochreiter and Schmidhuber 1997.
    """

    def __init__(
        self,
        *,
        units: int = 50,
        dropout: float = 0.2,
        epochs: int = 300,
        batch_size: int = 32,
        learning_rate: float = 1e-3,
        random_state: int = 0,
        device: str = "cpu",
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        self.units = units
        self.dropout = dropout
        self.epochs = epochs
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.random_state = random_state
        self.device = device
        self.progress = progress

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> Self:
        """Train from new weights.

        Args:
            X: (cases, channels, time points).
            y: (cases,) class names.

        Raises:
            DataError: X or y is malformed, there is one class only, a parameter is out of range, or
                the device is not there.
        """
        self._check_parameters()
        tracks = checked_tracks(X)
        self.classes_, index = np.unique(np.asarray(y), return_inverse=True)
        if index.shape != (len(tracks),):
            raise DataError(f"{len(tracks)} tracks need as many labels, not shape {index.shape}")
        if len(self.classes_) < 2:
            raise DataError(
                f"all cases are of class {str(self.classes_[0])!r}; at least two classes are needed"
            )
        with _one_thread():
            network = self._train(tracks, index)
            self.weights_ = {name: value.cpu().numpy().copy() for name, value in network.state_dict().items()}
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) the probability of each of `classes_`, rows summing to 1, for X as in `fit`.

        Raises:
            DataError: X is malformed or has other channels than the training data.
            NotFittedError: before `fit`.
        """
        check_is_fitted(self, "weights_")
        tracks = checked_tracks(X)
        channels = self.weights_["lstm.weight_ih_l0"].shape[1]
        if tracks.shape[1] != channels:
            raise DataError(f"trained on tracks of {channels} channels, given {tracks.shape[1]}")
        self._check_device()
        with _one_thread(), torch.inference_mode():
            network = _Network(channels, self.units, len(self.classes_))
            network.load_state_dict({name: torch.from_numpy(w.copy()) for name, w in self.weights_.items()})
            network.to(self.device)
            inputs = _inputs(tracks, self.device)
            parts = [network(part, None) for part in inputs.split(_ROWS_AT_ONCE)]
            scores = torch.cat(parts).double().cpu()
            if len(self.classes_) == 2:
                one = torch.sigmoid(scores[:, 0])
                return np.stack([1 - one.numpy(), one.numpy()], axis=1)
            return np.asarray(torch.softmax(scores, dim=1).numpy(), dtype=np.float64)

    def predict(self, X: npt.ArrayLike) -> npt.NDArray[Any]:
        """(cases,) the most probable of `classes_`; raises as `predict_proba` does."""
        best = self.predict_proba(X).argmax(axis=1)
        return np.asarray(self.classes_[best])

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """What was fitted, for `storage`: the classes and every weight."""
        check_is_fitted(self, "weights_")
        return {"classes": self.classes_.astype(np.str_), **self.weights_}

    def from_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Take over what `to_arrays` gave.

        Raises:
            DataError: the weights do not fit each other or `units`.
        """
        classes = arrays["classes"]
        weights = {name: np.array(w, dtype=np.float32) for name, w in arrays.items() if name != "classes"}
        first = weights.get("lstm.weight_ih_l0")
        if classes.ndim != 1 or len(classes) < 2 or first is None or first.ndim != 2 or not first.shape[1]:
            raise DataError("these are not the weights of an LSTM classifier")
        wanted = {
            name: tuple(value.shape)
            for name, value in _Network(first.shape[1], self.units, len(classes)).state_dict().items()
        }
        found = {name: weight.shape for name, weight in weights.items()}
        if found != wanted or not all(np.isfinite(weight).all() for weight in weights.values()):
            raise DataError(f"an LSTM of {self.units} units needs finite weights {wanted}, not {found}")
        self.classes_, self.weights_ = classes, weights
        return self

    def _check_parameters(self) -> None:
        for name in ("units", "epochs", "batch_size"):
            if getattr(self, name) < 1:
                raise DataError(f"{name} must be at least 1, not {getattr(self, name)}")
        if not 0 <= self.dropout < 1:
            raise DataError(f"dropout must lie in [0, 1), not {self.dropout}")
        if not 0 < self.learning_rate <= 1:
            raise DataError(f"learning_rate must lie in (0, 1], not {self.learning_rate}")
        self._check_device()

    def _check_device(self) -> None:
        if self.device not in ("cpu", "cuda"):
            raise DataError(f"unknown device {self.device!r}; expected cpu or cuda")
        if self.device == "cuda" and not torch.cuda.is_available():
            raise DataError("device 'cuda' is not available here; expected cpu")

    def _train(self, tracks: Array, index: npt.NDArray[np.intp]) -> _Network:
        random = torch.Generator().manual_seed(self.random_state)  # on the CPU: alike for every device
        network = _Network(tracks.shape[1], self.units, len(self.classes_))
        network.start(random)
        network.to(self.device)
        binary = len(self.classes_) == 2
        inputs = _inputs(tracks, self.device)
        targets = torch.from_numpy(index).to(self.device, torch.float32 if binary else torch.int64)
        optimiser = _Adam(list(network.parameters()), self.learning_rate)
        keep = 1 - self.dropout
        for epoch in range(self.epochs):
            order = torch.randperm(len(inputs), generator=random).to(self.device)
            kept = torch.rand(len(inputs), self.units, generator=random) < keep
            masks = (kept / keep).to(self.device)
            for rows, mask in zip(order.split(self.batch_size), masks.split(self.batch_size), strict=True):
                scores = network(inputs[rows], mask)
                if binary:
                    loss = functional.binary_cross_entropy_with_logits(scores[:, 0], targets[rows])
                else:
                    loss = functional.cross_entropy(scores, targets[rows])
                network.zero_grad(set_to_none=True)
                loss.backward()
                optimiser.step()
            if self.progress is not None:
                self.progress(epoch + 1, self.epochs)
        return network


class _Network(nn.Module):  # type: ignore[misc]  # torch is skipped by mypy
    """(cases, time points, channels) -> (cases, 1 or K) scores. Its weights are empty until `start`."""

    def __init__(self, channels: int, units: int, classes: int) -> None:
        super().__init__()
        self.lstm = nn.LSTM(channels, units, batch_first=True, device="meta")
        self.dense = nn.Linear(units, 1 if classes == 2 else classes, device="meta")
        self.to_empty(device="cpu")  # born on "meta", so that torch's global random state is not touched

    def start(self, random: torch.Generator) -> None:
        """First weights as in Keras: Glorot, orthogonal between the units, forget gates open."""
        units = self.lstm.hidden_size
        with torch.no_grad():
            nn.init.xavier_uniform_(self.lstm.weight_ih_l0, generator=random)
            nn.init.orthogonal_(self.lstm.weight_hh_l0, generator=random)
            nn.init.zeros_(self.lstm.bias_ih_l0)
            nn.init.zeros_(self.lstm.bias_hh_l0)
            self.lstm.bias_ih_l0[units : 2 * units] = (
                1.0  # torch's order of gates: input, forget, cell, output
            )
            nn.init.xavier_uniform_(self.dense.weight, generator=random)
            nn.init.zeros_(self.dense.bias)

    def forward(self, inputs: torch.Tensor, mask: torch.Tensor | None) -> torch.Tensor:
        """mask: (cases, units) factors of dropout on the last output, None when predicting."""
        last = self.lstm(inputs)[0][:, -1]
        return self.dense(last if mask is None else last * mask)


class _Adam:
    """Adam as torch.optim.Adam does it; that one loads the compiler, which costs every process 2 seconds.

    Source: Kingma and Ba 2015, algorithm 1, with its decay rates .9 and .999 and epsilon 1e-8.
    """

    def __init__(self, parameters: list[torch.Tensor], learning_rate: float) -> None:
        self.parameters, self.learning_rate, self.steps = parameters, learning_rate, 0
        self.first = [torch.zeros_like(p) for p in parameters]
        self.second = [torch.zeros_like(p) for p in parameters]

    @torch.no_grad()  # type: ignore[untyped-decorator]
    def step(self) -> None:
        """Move every parameter by its gradient."""
        self.steps += 1
        size = self.learning_rate / (1 - 0.9**self.steps)
        correction = (1 - 0.999**self.steps) ** 0.5
        for parameter, first, second in zip(self.parameters, self.first, self.second, strict=True):
            gradient = parameter.grad
            first.lerp_(gradient, 0.1)
            second.mul_(0.999).addcmul_(gradient, gradient, value=0.001)
            parameter.addcdiv_(first, (second.sqrt() / correction).add_(1e-8), value=-size)


def _inputs(tracks: Array, device: str) -> torch.Tensor:
    """(cases, time points, channels) float32 on `device`, moved once."""
    if np.abs(tracks).max() > _LARGEST:
        raise DataError(f"a track has numbers above {_LARGEST:g}, too large for the LSTM; scale the tracks")
    return torch.from_numpy(np.ascontiguousarray(tracks.transpose(0, 2, 1), dtype=np.float32)).to(device)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Work with one thread: on matrices this small more threads only wait for each other, up to 80 times
    longer on a busy machine. Folds run as processes instead."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)

"""Training by the compiled kernels."""

from __future__ import annotations

from lcorpp.learning.lstm.network import compiled
from lcorpp.learning.lstm.training import Cases, Draw, Plan
from lcorpp.learning.lstm.weights import Weights
from lcorpp.values import Array


class CompiledTrainer:
    """A `Trainer` in C++, see native/lstm/trainer.cpp.

    Args:
        level: the set of instructions, of those that `_kernels.levels()` names; the best by default.
    """

    def __init__(self, start: Weights, cases: Cases, plan: Plan, *, level: str | None = None) -> None:
        self._trainer = compiled().Trainer(
            **start.arrays(),
            tracks=cases.inputs,
            targets=cases.targets,
            weights=cases.weights,
            batch=plan.batch_size,
            keep=1 - plan.dropout,
            level=level,
        )

    def epoch(self, draw: Draw, rates: Array) -> None:
        """As in `Trainer`; Ctrl-C is heard between two updates."""
        self._trainer.epoch(draw.order, draw.kept, rates)

    def weights(self) -> Weights:
        """As in `Trainer`."""
        return Weights(*self._trainer.weights())

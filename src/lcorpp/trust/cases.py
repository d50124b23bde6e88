"""People as distinct cases of context, labels and answers, with weights."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array

MIN_WEIGHT = 0.01
"""A case with less weight, in people, may be removed if weights decay."""

NO_LABEL = -1
"""Index of the label of a sense without one."""


class Cases:
    """Distinct cases of people; n is their number.

    contexts: (n,) index of the context. labels: (n, senses) index of the label of each sense, `NO_LABEL` for
    none. answer_counts: (n, D) how often each answer, a pair of question and observation, was given.
    weights: (n,) number of people; with `memory` each person's weight decays.

    Args:
        memory: number of people after which a person's weight has decayed to 1 / e; None: no decay.
    """

    def __init__(self, n_senses: int, n_answers: int, memory: float | None = None) -> None:
        self.n, self.memory = 0, memory
        self._index = dict[Hashable, int]()
        self._unit = 1.0  # weight of the latest person: this grows, so that others need not decay
        # arrays with spare capacity
        self._contexts = np.zeros(64, np.intp)
        self._labels = np.zeros((64, n_senses), np.intp)
        self._answer_counts = np.zeros((64, n_answers))
        self._weights = np.zeros(64)

    @property
    def contexts(self) -> npt.NDArray[np.intp]:
        return self._contexts[: self.n]

    @property
    def labels(self) -> npt.NDArray[np.intp]:
        return self._labels[: self.n]

    @property
    def answer_counts(self) -> Array:
        return self._answer_counts[: self.n]

    @property
    def weights(self) -> Array:
        return self._weights[: self.n] / self._unit

    def add(self, context: int, labels: Sequence[int], answers: Sequence[int]) -> None:
        """Add a person.

        Args:
            answers: index of each answer, in any order.
        """
        if self.memory is not None:
            self._unit *= np.exp(1 / self.memory)
        case = self._find_or_add(context, labels, answers)  # before `_weights`, which it may replace
        self._weights[case] += self._unit
        if self.memory is not None and (self._unit > 1e100 or self.n > 8 * self.memory):
            self.keep(np.flatnonzero(self.weights >= MIN_WEIGHT))

    def keep(self, kept: npt.NDArray[np.intp]) -> None:
        """Keep the cases of these indices, which increase."""
        size = len(kept)
        for array in (self._contexts, self._labels, self._answer_counts, self._weights):
            array[:size] = array[kept]
        self._weights[:size] /= self._unit
        self._unit = 1.0
        new_index = dict(zip(kept.tolist(), range(size), strict=True))
        self._index = {key: new_index[case] for key, case in self._index.items() if case in new_index}
        self.n = size

    def forget_labels(self, sense: int) -> None:
        """Forget all labels of a sense; cases that do not differ otherwise become one."""
        state = self.state()
        for labels in state["labels"]:
            labels[sense] = NO_LABEL
        self.restore(state)

    def state(self) -> dict[str, Any]:
        """Return the cases as JSON."""
        numbers = np.arange(self._answer_counts.shape[1])
        return {
            "contexts": self.contexts.tolist(),
            "labels": self.labels.tolist(),
            "answers": [np.repeat(numbers, counts.astype(np.intp)).tolist() for counts in self.answer_counts],
            "weights": self._weights[: self.n].tolist(),
            "unit": self._unit,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Replace the cases by those of a state."""
        self.n, self._index, self._unit = 0, {}, float(state["unit"])
        columns = (state[name] for name in ("contexts", "labels", "answers", "weights"))
        for *person, weight in zip(*columns, strict=True):
            case = self._find_or_add(*person)
            self._weights[case] += weight

    def _find_or_add(self, context: int, labels: Sequence[int], answers: Sequence[int]) -> int:
        """Return the index of a case; a new one has the weight 0."""
        key = (context, *labels, *sorted(answers))
        case = self._index.get(key)
        if case is None:
            if self.n == len(self._weights):
                self._double_capacity()
            case = self._index[key] = self.n
            self._contexts[case], self._labels[case], self._weights[case] = context, labels, 0
            self._answer_counts[case] = (
                np.bincount(answers, minlength=self._answer_counts.shape[1]) if answers else 0
            )
            self.n += 1
        return case

    def _double_capacity(self) -> None:
        self._contexts, self._labels, self._answer_counts, self._weights = (
            np.concatenate([array, np.zeros_like(array)])
            for array in (self._contexts, self._labels, self._answer_counts, self._weights)
        )

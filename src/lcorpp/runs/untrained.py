"""The classifier of a sense that cannot be trained yet: random labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.learning.data.dataset import count_groups
from lcorpp.values import Array, ConfusionMatrix, Dataset, Label, Likelihood, track_hash


@dataclass(frozen=True)
class RandomClassifier:
    """A classifier without training; a `protocols.Classifier`.

    Its label is uniform over the classes, and depends on the seed and the signal alone, so that a resumed run
    repeats it. As soft evidence, all classes are equally likely.
    """

    classes: tuple[str, ...]
    seed: int
    soft: bool = False

    def classify(self, signal: Array) -> Label:
        if self.soft:
            return Likelihood(self.classes, np.ones(len(self.classes)))
        digest = int(track_hash(signal).removeprefix("track "), 16)
        return self.classes[int(np.random.default_rng([self.seed, digest]).integers(len(self.classes)))]

    def classify_many(self, signals: Array) -> list[Label]:
        return [self.classify(signal) for signal in signals]

    @property
    def confusion(self) -> ConfusionMatrix:
        """The matrix without counts; its smoothed rates are uniform."""
        classes = tuple(sorted(self.classes))
        return ConfusionMatrix(classes, np.zeros((len(classes), len(classes))))


@check_arguments
def is_trainable(dataset: Dataset, classes: Sequence[str], folds: int) -> bool:
    """Return whether each class has a group for each of `folds` folds, and as much weight in all."""
    labels, groups = np.array(dataset.labels), count_groups(dataset.labels, dataset.groups)
    return all(
        groups.get(name, 0) >= folds and dataset.weights[labels == name].sum() >= folds for name in classes
    )

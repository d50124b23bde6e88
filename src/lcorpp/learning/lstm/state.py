"""What an LSTM carries from one time point to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.learning.lstm.weights import Floats, Weights


@dataclass(frozen=True, eq=False)
class LstmState:
    """What an LSTM remembers of n tracks that it follows; `LstmClassifier.advance` changes it in place.

    weights: of the classifier that began it; no other can go on with it.
    hidden, cell: (n, units) float32.
    """

    weights: Weights
    hidden: Floats
    cell: Floats

    def __len__(self) -> int:
        return len(self.hidden)

    def take(self, rows: npt.ArrayLike) -> LstmState:
        """A copy of the states of some of the tracks. rows: (k,) indices."""
        index = np.asarray(rows, dtype=np.intp)
        return LstmState(self.weights, self.hidden[index], self.cell[index])

    def put(self, rows: npt.ArrayLike, state: LstmState) -> None:
        """Take over the states of some of the tracks, in place. rows: (k,) where the k of `state` belong.

        Raises:
            DataError: `state` was begun by another classifier.
        """
        if state.weights is not self.weights:
            raise DataError("states of two classifiers do not go together")
        index = np.asarray(rows, dtype=np.intp)
        self.hidden[index], self.cell[index] = state.hidden, state.cell

"""Answers about hidden classes from one source: a question to a person, or a classifier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.errors import DataError
from lcorpp.latent_classes import sum_by_group
from lcorpp.values import Array, Indices, freeze


@dataclass(frozen=True, eq=False)
class AnswerSource:
    """A source of answers about the hidden class of each case: a question to a person, a classifier.

    counts: (N, O) how often each case got each answer.
    rows: (K,) for each class the row of the source's matrix; classes that answer alike share a row.
    pseudo_counts: (R, O) answers of each row that count as seen before: a Dirichlet prior. They distinguish
        the classes, which the answers alone leave open up to a permutation, so each row needs a positive one.
    """

    counts: Array
    rows: Indices
    pseudo_counts: Array

    def __post_init__(self) -> None:
        for name in ("counts", "pseudo_counts"):
            values = freeze(getattr(self, name))
            if values.ndim != 2 or not (np.isfinite(values).all() and (values >= 0).all()):
                raise DataError(f"the {name} of answers: expected a matrix of finite numbers from 0")
            object.__setattr__(self, name, values)
        object.__setattr__(self, "rows", np.asarray(self.rows, dtype=np.intp))
        n_rows, n_answers = self.pseudo_counts.shape
        if (
            self.counts.shape[1] != n_answers
            or self.rows.ndim != 1
            or not np.isin(self.rows, range(n_rows)).all()
        ):
            raise DataError(
                f"answers of shape {self.counts.shape} and the rows {self.rows.tolist()} of the classes do"
                f" not fit a matrix of shape {self.pseudo_counts.shape}"
            )
        if not (self.pseudo_counts.sum(axis=1) > 0).all():
            raise DataError(
                "a row of a source's matrix has no pseudo-counts; expected a positive sum in each"
            )

    def count_by_row(self, answers: Array) -> Array:
        """Return the number (R, O) of the answers of each row, from those of each class (K, O)."""
        return sum_by_group(self.rows, answers, len(self.pseudo_counts))

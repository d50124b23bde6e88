"""The learnt confidence of a recogniser, and its bins: observations by answer and confidence."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lcorpp.errors import DataError
from lcorpp.files import read_text, write_atomically
from lcorpp.values import Array, Flags, freeze

NONE = "none"
"""The observation of silence, of other talk, and of answers with too little confidence."""

VERSION = 2
"""Of the file's format."""

SPEECH, ANSWER = "speech", "answer"
"""Factors of a confidence: P(the sound is speech), and P(the answer is right) if it is."""

STRENGTH = 1.0
"""Weight of the data over the penalty of the logistic regression's weights (`C` of scikit-learn)."""

MIN_CASES = 10
"""Minimum numbers of right and of wrong recognitions to learn from."""

Bins = Mapping[str, Sequence[tuple[str, float]]]
"""Answer -> its observations, each with its lowest confidence, from the surest to the least sure."""


@dataclass(frozen=True, eq=False)
class Factor:
    """A logistic regression: the probability of features x is logistic(bias + weights (x - centre) / scale).

    centre, scale, weights: (F,). bias: a number.

    Raises:
        DataError: a shape or number is invalid.
    """

    centre: Array
    scale: Array
    weights: Array
    bias: float

    def __post_init__(self) -> None:
        for name in ("centre", "scale", "weights"):
            array = freeze(getattr(self, name))
            object.__setattr__(self, name, array)
            if array.shape != self.centre.shape or array.ndim != 1 or not np.isfinite(array).all():
                raise DataError(f"confidence: {name} is {array}; expected {len(self.centre)} finite numbers")
        if not np.isfinite(self.bias) or not (self.scale > 0).all():
            raise DataError("confidence: the bias must be finite, and each scale positive")

    def score(self, features: Array) -> Array:
        """Return the probabilities (n,) of features (n, F)."""
        return _logistic(self.bias + (features - self.centre) / self.scale @ self.weights)


@dataclass(frozen=True, eq=False)
class Confidence:
    """The probability that a recognised answer is right, and the observation that it makes.

    It is the product of its factors: that a sound is speech, and that the answer of speech is right. Each is
    learnt from other cases, so that sounds without speech do not change which answers are right.

    features: (F,) their names, for the file.
    factors: name -> factor, `SPEECH` and `ANSWER`; measurements without sounds have `ANSWER` alone.
    bins: see `Bins`; below its last bin an answer becomes the observation `NONE`.

    Raises:
        DataError: a factor has another number of features, or a bin is invalid.
    """

    features: tuple[str, ...]
    factors: Mapping[str, Factor]
    bins: Bins

    def __post_init__(self) -> None:
        for name, factor in self.factors.items():
            if len(factor.centre) != len(self.features):
                raise DataError(
                    f"confidence: the factor {name!r} has {len(factor.centre)} features; expected"
                    f" {len(self.features)}"
                )
        for answer, rows in self.bins.items():
            edges = [edge for _, edge in rows]
            if not edges or edges != sorted(edges, reverse=True) or not all(0 <= edge <= 1 for edge in edges):
                raise DataError(
                    f"confidence: the bins of {answer!r} begin at {edges}; expected numbers from 1 to 0"
                )

    def score(self, features: Array) -> Array:
        """Return the confidences (n,) of features (n, F)."""
        product = np.ones(len(features))
        for factor in self.factors.values():
            product *= factor.score(features)
        return product

    def keep(self, observations: Sequence[str]) -> Confidence:
        """Return the confidence for a model with these observations: other bins become `NONE`."""
        bins = {
            answer: tuple(row for row in rows if row[0] in observations) for answer, rows in self.bins.items()
        }
        return replace(self, bins={answer: rows for answer, rows in bins.items() if rows})

    def observe(self, answer: str, confidence: float) -> str:
        """Return the observation of an answer."""
        return next((name for name, edge in self.bins.get(answer, ()) if confidence >= edge), NONE)


def fit_factor(rows: Array, right: Flags, weights: Array) -> Factor:
    """Learn a factor by logistic regression.

    Args:
        rows: (n, F) features of recognised answers.
        right: (n,) labels of the cases, e.g. whether the recognised answer is the spoken one.
        weights: (n,) of the cases.

    Raises:
        DataError: fewer than `MIN_CASES` are right, or wrong.
    """
    from sklearn.linear_model import LogisticRegression

    if min(right.sum(), (~right).sum()) < MIN_CASES:
        raise DataError(
            f"{int(right.sum())} answers are right and {int((~right).sum())} wrong; expected at least"
            f" {MIN_CASES} of each to learn a confidence from"
        )
    centre, scale = rows.mean(axis=0), rows.std(axis=0)
    scale = np.where(scale > 1e-9, scale, 1.0)
    model = LogisticRegression(C=STRENGTH, max_iter=2000)
    model.fit((rows - centre) / scale, right, sample_weight=weights)
    return Factor(centre, scale, model.coef_[0], float(model.intercept_[0]))


def write_confidence(confidence: Confidence, path: str | Path, *, origin: str) -> None:
    """Write a confidence as JSON; `origin` tells readers what it was learnt from.

    Raises:
        FileError: the file cannot be written.
    """
    factors = {
        factor: {
            "bias": own.bias,
            "features": {
                name: {"centre": c, "scale": s, "weight": w}
                for name, c, s, w in zip(
                    confidence.features,
                    own.centre.tolist(),
                    own.scale.tolist(),
                    own.weights.tolist(),
                    strict=True,
                )
            },
        }
        for factor, own in confidence.factors.items()
    }
    bins = {answer: dict(rows) for answer, rows in confidence.bins.items()}
    table = {"version": VERSION, "origin": origin, "factors": factors, "bins": bins}
    write_atomically(path, json.dumps(table, indent=1) + "\n")


def read_confidence(path: str | Path, features: Sequence[str]) -> Confidence:
    """Read a confidence of these features.

    Raises:
        FileError: the file cannot be read.
        DataError: it is no such file, or has other features.
    """
    try:
        table = json.loads(read_text(path))
        _check(
            table["version"] == VERSION,
            f"version {table['version']!r}; expected {VERSION}, measure again with `lcorpp observe`",
        )
        _check(ANSWER in table["factors"], f"no factor {ANSWER!r}")
        factors = {str(name): _read_factor(own, features) for name, own in table["factors"].items()}
        bins = {
            str(answer): tuple((str(name), _number(edge)) for name, edge in own.items())
            for answer, own in table["bins"].items()
        }
        return Confidence(tuple(features), factors, bins)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise DataError(
            f"{path}: no confidence of a recogniser ({type(error).__name__}: {str(error)[:200]}); expected a"
            " file that `lcorpp observe` wrote"
        ) from None
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def _read_factor(table: Any, features: Sequence[str]) -> Factor:
    rows = table["features"]
    _check(list(rows) == list(features), f"features {', '.join(rows)}; expected {', '.join(features)}")
    centre, scale, weights = (
        np.array([_number(rows[name][key]) for name in features]) for key in ("centre", "scale", "weight")
    )
    return Factor(centre, scale, weights, _number(table["bias"]))


def _check(holds: bool, fault: str) -> None:
    if not holds:
        raise DataError(fault)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is not a number")
    return float(value)


def _logistic(x: Array) -> Array:
    result: Array = 1 / (1 + np.exp(-np.clip(x, -500, 500)))
    return result

"""Discrete distributions, and likelihoods as soft evidence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.notebook import html_table, join_some
from lcorpp.values.arrays import Array, freeze


@dataclass(frozen=True, eq=False, repr=False)
class Distribution:
    """A distribution over named values, e.g. the marginal of one attribute.

    values: (n,) the names, in the order of their declaration; those of a joint distribution of several
        variables are tuples, one name for each variable, the last of which varies fastest.
    probabilities: (n,) non-negative, summing to 1.

    Examples:
        >>> from lcorpp import Distribution
        >>> weather = Distribution(("sun", "rain"), [0.7, 0.3])
        >>> weather["rain"], weather.most_likely()
        (0.3, 'sun')
    """

    values: tuple[Any, ...]
    probabilities: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "probabilities", freeze(self.probabilities))
        p = self.probabilities
        if p.shape != (len(self.values),) or not len(p):
            raise ModelError(f"a distribution over {len(self.values)} values cannot have shape {p.shape}")
        if not np.all(np.isfinite(p)) or p.min() < 0 or abs(p.sum() - 1) > 1e-9:
            raise ModelError(f"{p.tolist()} over {', '.join(map(str, self.values))} is not a distribution")

    @classmethod
    def certain(cls, value: Any, values: tuple[Any, ...]) -> Distribution:
        """Return the distribution with probability 1 on `value`.

        Raises:
            ModelError: `value` is not one of `values`.
        """
        if value not in values:
            raise ModelError(f"unknown value {value!r}; {expected_one_of(values)}")
        return cls(values, np.array([float(v == value) for v in values]))

    @classmethod
    def unchecked(cls, values: tuple[Any, ...], probabilities: Array) -> Distribution:
        """Return a distribution without checks and without a copy of the (read-only) array."""
        distribution = object.__new__(cls)
        object.__setattr__(distribution, "values", values)
        object.__setattr__(distribution, "probabilities", probabilities)
        return distribution

    def __getitem__(self, value: Any) -> float:
        if value not in self.values:
            raise ModelError(f"unknown value {value!r}; {expected_one_of(self.values)}")
        return float(self.probabilities[self.values.index(value)])

    def __iter__(self) -> Iterator[tuple[Any, float]]:
        return iter(zip(self.values, self.probabilities.tolist(), strict=True))

    def __str__(self) -> str:
        return join_some([f"{format_value(value)}: {p:.4g}" for value, p in self])

    def __repr__(self) -> str:
        return f"Distribution({self})"

    def _repr_html_(self) -> str:
        rows = [(format_value(value), f"{p:.4g}") for value, p in self]
        return html_table(("value", "probability"), rows, caption="Distribution")

    def most_likely(self) -> Any:
        """Return the value with the highest probability, the first declared among equals."""
        return self.values[int(np.argmax(self.probabilities))]


SharedValue = str | tuple[str, ...]
"""A value of what reasoner and planner share: of one variable, or a tuple of one value for each variable."""


def format_value(value: SharedValue) -> str:
    """Format a value: ``cup``, or that of a joint distribution, ``(cup, ann)``.

    Examples:
        >>> from lcorpp.values import format_value
        >>> format_value(("cup", "ann"))
        '(cup, ann)'
    """
    return value if isinstance(value, str) else f"({', '.join(value)})"


def read_value(content: Any) -> SharedValue:
    """Return the shared value that JSON represents: a text, or a list of texts for a tuple.

    Examples:
        >>> from lcorpp.values import read_value
        >>> read_value(["cup", "ann"])
        ('cup', 'ann')
    """
    return tuple(content) if isinstance(content, list) else content


@dataclass(frozen=True, eq=False, repr=False)
class Likelihood:
    """Soft evidence about a named value: P(observed | value) up to a common factor.

    values: (n,) the names, all different.
    weights: (n,) finite, not negative, not all zero; scaled to a maximum of 1. Weight 0 rules a value out.
    observed: a description of what was observed, e.g. a prediction set; "" without one.

    Source: Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2 (virtual evidence).

    Examples:
        >>> from lcorpp import Likelihood
        >>> Likelihood(("interested", "not_interested"), [0.6, 0.2])  # only the ratio 3 : 1 counts
        Likelihood(interested: 1, not_interested: 0.3333)
    """

    values: tuple[str, ...]
    weights: Array
    observed: str = ""

    def __post_init__(self) -> None:
        w = np.array(self.weights, dtype=np.float64)
        if w.shape != (len(self.values),) or not len(w) or len(set(self.values)) < len(w):
            raise ModelError(
                f"a likelihood needs one weight for each of {len(self.values)} different values, not shape"
                f" {w.shape}"
            )
        if not np.all(np.isfinite(w)) or w.min() < 0 or w.max() <= 0:
            pairs = ", ".join(f"{value} {weight:g}" for value, weight in zip(self.values, w, strict=True))
            raise ModelError(f"likelihood of {pairs}: expected finite weights, none negative, not all zero")
        object.__setattr__(self, "weights", freeze(w / w.max()))

    def __iter__(self) -> Iterator[tuple[str, float]]:
        return iter(zip(self.values, self.weights.tolist(), strict=True))

    def __str__(self) -> str:
        return ":".join(self.values) + " as " + ":".join(f"{weight:.3g}" for weight in self.weights.tolist())

    def __repr__(self) -> str:
        return f"Likelihood({join_some([f'{value}: {weight:.4g}' for value, weight in self])})"

    def _repr_html_(self) -> str:
        rows = [(value, f"{weight:.4g}") for value, weight in self]
        return html_table(("value", "likelihood"), rows, caption="Likelihood, relative to the largest")

    def rename(self, names: Mapping[str, str]) -> Likelihood:
        """Return this likelihood with other value names: old name -> new name, one for each value."""
        return replace(self, values=tuple(names[value] for value in self.values))

    def most_likely(self) -> str:
        """Return the value with the largest weight, the first among equals."""
        return self.values[int(np.argmax(self.weights))]


Label = str | Likelihood
"""Output of a classifier: a class name, or the likelihood of each class."""

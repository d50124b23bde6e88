"""Upper bounds on the optimal value that solvers attach to policies (`policy.UpperBound`)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array, Belief
from lcorpp.values.probabilities import MIN_NORMAL


@dataclass(frozen=True, eq=False, repr=False)
class PiecewiseLinearBound:
    """The upper bound max over v of v.b + shift of vectors (K, S)."""

    vectors: Array
    shift: float = 0.0

    def __repr__(self) -> str:
        return f"<PiecewiseLinearBound: {len(self.vectors)} vectors + {self.shift:.3g}>"

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""
        return float((self.vectors @ belief).max()) + self.shift


@dataclass(frozen=True, eq=False)
class SawtoothBound:
    """The fast informed bound and the sawtooth interpolation of points.

    bound(b) = min(max over a of Q(a).b, corners.b + min over the points (p, v) of phi(b, p) (v - corners.p)),
    with phi(b, p) = min over the support of p of b(s) / p(s), which is 0 if b does not contain the support of
    p.

    informed: (A, S) the fast informed bound: upper bounds on the Q values.
    corners: (S,) the bound at each corner of the belief simplex, where the state is known.
    begins: (n + 1,) index of the first entry of each point. states, weights: (entries,). values: (n,).

    Source: Hauskrecht, JAIR 2000, section 4.4; Smith and Simmons, UAI 2005, section 4.2.
    """

    informed: Array
    corners: Array
    begins: npt.NDArray[np.int64]
    states: npt.NDArray[np.int32]
    weights: Array
    values: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            array = np.asarray(getattr(self, field.name))
            if array.flags.writeable:  # the points of a large model are in memory only once
                array = array.copy()
                array.setflags(write=False)
            object.__setattr__(self, field.name, array)

    def __repr__(self) -> str:
        return f"<SawtoothBound: {len(self.values)} points, {len(self.corners)} states>"

    def points(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], Array, Array]:
        """begins, states, weights and values of all points, with the lowered corners first."""
        lowered = np.flatnonzero(self.corners < self.informed.max(axis=0))
        begins = np.concatenate([np.arange(len(lowered)), len(lowered) + self.begins])
        states = np.concatenate([lowered.astype(np.int32), self.states])
        weights = np.concatenate([np.ones(len(lowered)), self.weights])
        return begins, states, weights, np.concatenate([self.corners[lowered], self.values])

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""
        belief = np.asarray(belief, dtype=np.float64)
        plane = float(self.corners @ belief)
        if len(self.values):
            ratios = belief[self.states] / np.maximum(self.weights, MIN_NORMAL)
            phi = np.minimum.reduceat(ratios, self.begins[:-1])
            plane += min(0.0, float((phi * self._excess).min()))
        return min(float((self.informed @ belief).max()), plane)

    @cached_property
    def _excess(self) -> Array:
        """(n,) v - corners.p of each point, not above 0."""
        planes = np.add.reduceat(self.corners[self.states] * self.weights, self.begins[:-1])
        return np.minimum(self.values - planes, 0.0)


MIXTURE_TOLERANCE = 1e-9
"""Rounding error of a belief that is a mixture."""


@dataclass(frozen=True, eq=False, repr=False)
class MixtureBound(SawtoothBound):
    """A sawtooth bound, and a closer one at the mixtures of some beliefs.

    The optimal value is convex, so at a mixture of beliefs it is at most the mixture of the values there.

    mixed: (V, S) beliefs. planes: (F, V): the bound at the mixture with weights w (V,) is max over F of
    planes @ w, the lower convex envelope of upper bounds at some mixtures.
    """

    mixed: Array
    planes: Array

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""
        belief = np.asarray(belief, dtype=np.float64)
        weights = belief @ self._inverse
        if np.abs(weights @ self.mixed - belief).max() > MIXTURE_TOLERANCE:
            return super().value(belief)
        return float((self.planes @ weights).max())

    @cached_property
    def _inverse(self) -> Array:
        """(S, V) the weights of a mixture are the belief @ this."""
        return np.linalg.pinv(self.mixed).astype(np.float64)

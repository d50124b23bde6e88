"""Starts of a search for a policy that is good at every mixture of some beliefs, e.g. at every prior.

The gap between the bounds is checked where it can be widest. The lower bound is the maximum of the vectors;
the upper bound is the lower convex envelope of upper bounds at the starts, as the optimal value is convex.
Their difference is convex where one vector is the best, so it is largest at a vertex of such a region.

Source: Cheng, "Algorithms for partially observable Markov decision processes", PhD thesis, University of
British Columbia, 1988 (linear support).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.policy import Policy
from lcorpp.planning.sarsop.bounded_search import BoundedSearch
from lcorpp.planning.upper_bounds import MIXTURE_TOLERANCE, MixtureBound, SawtoothBound
from lcorpp.values import Array

MAX_MIXED = 4
"""Maximum number of beliefs that are mixed: the number of vertices grows exponentially with it."""

MAX_ADDED_STARTS = 20
"""Maximum number of starts that are added at once."""

MIN_GAP_SHARE = 0.3
"""A gap below this share of the widest one waits: most such gaps close together with a wider one."""

MIN_DISTANCE = 1e-7
"""A mixture that is nearer to a start differs from it by rounding."""

MIN_SLOPE = 1e-9
"""A facet whose normal has a smaller last component is vertical: a side of the hull."""


class MixtureStarts:
    """Adds starts to a search until the gap at all mixtures of some beliefs is at most its precision.

    Args:
        search: from any starts. mixed: (V, S) linearly independent beliefs, V from 2 to `MAX_MIXED`.

    Raises:
        ModelError: there are too many or too few beliefs, or one is a mixture of the others.
    """

    def __init__(self, search: BoundedSearch, mixed: Array) -> None:
        if not 2 <= len(mixed) <= MAX_MIXED:
            raise ModelError(f"there are {len(mixed)} beliefs to mix; expected 2 to {MAX_MIXED}")
        if np.linalg.matrix_rank(mixed) < len(mixed):
            raise ModelError("one of the beliefs to mix is a mixture of the others")
        self._search, self._mixed = search, mixed
        starts = np.array([search.bounds.tree.belief(root) for root in search.roots])
        weights = starts @ np.linalg.pinv(mixed)
        are_mixtures = np.abs(weights @ mixed - starts).max(axis=1) <= MIXTURE_TOLERANCE
        # starts that are mixtures: their numbers among all starts, and the weights (n, V)
        self._numbers: list[int] = np.flatnonzero(are_mixtures).tolist()
        self._weights: Array = weights[are_mixtures]
        self._add(np.eye(len(mixed)))

    def add_wide(self) -> bool:
        """Add the vertices with the widest gaps to the starts; return whether there are any.

        The bounds at the present starts have reached the precision, and a gap is wide if it has not.
        """
        vectors = self._project_vectors()
        if not len(vectors):
            return False
        planes = find_envelope(self._weights, self._find_upper_bounds())
        vertices = np.array([self._separate(vertex) for vertex in find_vertices(vectors)])
        values = vertices @ planes.T
        gaps = values.max(axis=1) - (vertices @ vectors.T).max(axis=1)
        gaps[[self._is_start(vertex) for vertex in vertices]] = 0
        min_gap, facets = max(self._search.precision, MIN_GAP_SHARE * gaps.max()), values.argmax(axis=1)
        chosen = dict[int, int]()  # facet of the envelope -> vertex: the others below it are near
        for i in np.argsort(-gaps, kind="stable").tolist():
            if gaps[i] <= min_gap or len(chosen) == MAX_ADDED_STARTS:
                break
            chosen.setdefault(int(facets[i]), i)
        if chosen:
            self._add(vertices[list(chosen.values())])
        return bool(chosen)

    def _separate(self, vertex: Array) -> Array:
        """Return a vertex (V,), or if it is a start, the first mixture on the way to it that is none.

        The bounds have met at a start, but if its belief lies within one block and other mixtures do not, the
        vectors of their group may be far below the upper bound everywhere around it.
        """
        step = (np.full(len(vertex), 1 / len(vertex)) - vertex) / 2
        separate = vertex
        while self._is_start(separate) and np.abs(step).max() > MIN_DISTANCE:
            separate, step = vertex + step, step / 2
        return separate

    def _is_start(self, weights: Array) -> bool:
        return bool(np.abs(weights - self._weights).max(axis=1).min() < MIN_DISTANCE)

    def tighten(self, policy: Policy) -> Policy:
        """Return a policy of the search with the convex envelope in its upper bound."""
        upper = policy.upper_bound
        assert isinstance(upper, SawtoothBound)
        parts = {field.name: getattr(upper, field.name) for field in fields(SawtoothBound)}
        planes = find_envelope(self._weights, self._find_upper_bounds())
        return replace(policy, upper_bound=MixtureBound(**parts, mixed=self._mixed, planes=planes))

    def _add(self, weights: Array) -> None:
        self._search.add_starts(weights @ self._mixed)
        self._numbers += range(len(self._search.roots) - len(weights), len(self._search.roots))
        self._weights = np.vstack([self._weights, weights])

    def _find_upper_bounds(self) -> Array:
        tree = self._search.bounds.tree
        return np.array([tree.upper_bound(self._search.roots[number]) for number in self._numbers])

    def _project_vectors(self) -> Array:
        """Return (K, V) the values of the vectors at the mixed beliefs."""
        tree = self._search.bounds.tree
        projected = [np.zeros((0, len(self._mixed)))]
        for group in range(tree.group_count):
            states, vectors, _ = tree.vectors(group)
            inside = self._mixed[:, states]
            if np.count_nonzero(inside) == np.count_nonzero(self._mixed):
                projected.append(vectors @ inside.T)
        return np.vstack(projected)


def find_vertices(vectors: Array) -> Array:
    """Find the mixtures at which the best vectors change, and the corners.

    Args:
        vectors: (K, V); the value at weights w (V,) is the maximum of vectors @ w.

    Returns:
        (n, V) the weights at the vertices of the epigraph of the maximum.
    """
    from scipy.spatial import HalfspaceIntersection  # it takes .2 s to import

    n = vectors.shape[1] - 1  # the last weight is 1 minus the sum of the others
    low, high = vectors.min(), vectors.max()
    scaled = (vectors - low) / max(high - low, 1e-300)
    above = np.column_stack([scaled[:, :-1] - scaled[:, -1:], np.full(len(scaled), -1.0), scaled[:, -1]])
    limits = np.zeros((n + 2, n + 2))  # rows of A (w, value) + b <= 0
    limits[:n, :n] = -np.eye(n)
    limits[n] = [*np.ones(n), 0, -1]
    limits[n + 1] = [*np.zeros(n), 1, -3]
    inside = np.array([*np.full(n, 1 / (n + 1)), 2.0])
    found = _run_qhull(HalfspaceIntersection, np.vstack([above, limits]), inside).intersections
    found = found[np.isfinite(found).all(axis=1)]
    found = found[found[:, -1] < 2.5]
    weights = np.column_stack([found[:, :-1], 1 - found[:, :-1].sum(axis=1)]).clip(0, 1)
    vertices: Array = np.unique(np.round(weights / weights.sum(axis=1, keepdims=True), 12), axis=0)
    return vertices


def find_envelope(weights: Array, values: Array) -> Array:
    """Find the lower convex envelope of values (n,) at mixtures (n, V), the corners among them.

    Returns:
        (F, V) the envelope at weights w (V,) is the maximum of the rows @ w.
    """
    from scipy.spatial import ConvexHull

    low, high = values.min(), values.max()
    points = np.column_stack([weights[:, :-1], (values - low) / max(high - low, 1e-300)])
    apex = np.append(np.full(points.shape[1] - 1, 1 / points.shape[1]), 2.0)  # else the points may be flat
    hull = _run_qhull(ConvexHull, np.vstack([points, apex]))
    facets = hull.simplices[hull.equations[:, -2] < -MIN_SLOPE]
    return np.linalg.solve(weights[facets], values[facets][:, :, None])[:, :, 0].astype(np.float64)


def _run_qhull(function: Callable[..., Any], *arrays: Array) -> Any:
    """Call a function of qhull; if rounding defeats it, on numbers that are changed in their last digits."""
    from scipy.spatial import QhullError

    try:
        return function(*arrays)
    except QhullError:
        return function(*arrays, qhull_options="QJ")

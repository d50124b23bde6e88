"""An upper bound by interpolation on regular grids of beliefs, for models with few states.

The optimal value is convex in the belief, so that linear interpolation between the corners of a simplex of
the grid is at least as large. Grid and interpolation do not depend on the multipliers of the limits. Steps
are counted, so that each criterion has its own discount.

A grid over all states is coarse if limits count events. A second bound takes the counts as observed, so that
its grids are over the states with equal counts.

Source: Lovejoy, "Computationally feasible bounds for partially observed Markov decision processes",
Operations Research 1991, with the triangulation of Freudenthal.
"""

from __future__ import annotations

from itertools import combinations
from math import ceil, comb, log
from typing import Any

import numpy as np

from lcorpp.planning.evaluation.mdp import bound_above
from lcorpp.planning.limits.limited_model import LimitedModel
from lcorpp.values import Array, Indices

MAX_POINTS, MAX_ENTRIES = 10_000, 4_000_000
"""Maximum number of points, and of entries of the interpolation of all of them; a refined grid has
`REFINEMENT` times as many."""

REFINEMENT = 6

MAX_CORNERS, MAX_KEY = 30_000_000, 2**63
"""Maximum number of coordinates of corners that are in memory at once, and of the number of a point."""

MIN_RESOLUTION = 3
"""Coarser grids are not worth their time."""

MAX_LEAVES = 5_000
"""Maximum number of beliefs at which the bound is interpolated below a start."""

REST, MAX_STEPS = 1e-4, 1_000
"""Steps are counted until the discount of the return is this small; their maximum number."""

MAX_SWEEPS = 300
"""Maximum number of further steps in which costs without discount are counted."""

ROUNDING = 1e-9
"""Of the cumulated probabilities in units of the grid."""


class SimplexGrid:
    """The distributions over some states whose probabilities are multiples of 1 / resolution.

    points: (n, states).
    """

    def __init__(self, n_states: int, resolution: int) -> None:
        self._resolution = resolution
        cuts = np.array(list(combinations(range(resolution + n_states - 1), n_states - 1)), np.intp)
        first, last = np.full((len(cuts), 1), -1), np.full((len(cuts), 1), resolution + n_states - 1)
        counts = np.diff(np.hstack([first, cuts, last]), axis=1) - 1
        keys = self._encode(counts)
        order = np.argsort(keys)
        self._keys, self.points = keys[order], counts[order] / resolution

    def interpolate(self, beliefs: Array) -> tuple[Array, Indices]:
        """Return (n, states) weights, with the sum of each belief, and the points between which it lies.

        Args:
            beliefs: (n, states), not normalised.
        """
        mass = beliefs.sum(axis=1)
        scaled = self._resolution * beliefs / np.where(mass > 0, mass, 1.0)[:, None]
        cumulated = np.flip(np.cumsum(np.flip(scaled, axis=1), axis=1), axis=1)
        cumulated[:, 0] = np.where(mass > 0, self._resolution, 0.0)
        lower = np.floor(cumulated + ROUNDING)
        rest = np.maximum(cumulated - lower, 0.0)[:, 1:]
        order = np.argsort(-rest, axis=1, kind="stable")
        ordered = np.take_along_axis(rest, order, axis=1)
        one, zero = np.ones((len(beliefs), 1)), np.zeros((len(beliefs), 1))
        weights = np.hstack([one, ordered]) - np.hstack([ordered, zero])
        corners = np.repeat(lower[:, None, :], beliefs.shape[1], axis=1)  # (n, corners, states)
        rank = np.argsort(order, axis=1) + 1  # the corner from which a cumulated probability is raised
        corners[:, :, 1:] += np.arange(beliefs.shape[1])[:, None] >= rank[:, None, :]
        counts = corners.astype(np.int64)
        counts[:, :, :-1] -= corners[:, :, 1:].astype(np.int64)
        counts[mass <= 0] = 0
        counts[mass <= 0, :, 0] = self._resolution
        keys = self._encode(counts)
        rows = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        # where probabilities tie, a corner with weight 0 may be no point
        outside = (self._keys[rows] != keys) | (counts.min(axis=2) < 0)
        assert weights[outside].max(initial=0.0) <= ROUNDING, "a belief lies outside of its simplex"
        return np.where(outside, 0.0, weights) * mass[:, None], np.where(outside, 0, rows)

    def _encode(self, counts: Indices) -> Indices:
        """Return a number for each point, from its probabilities (..., states) in units of the grid."""
        powers = (self._resolution + 1) ** np.arange(counts.shape[-1], dtype=np.int64)
        return np.asarray(counts @ powers)


class GridBound:
    """Upper bounds of sums of the criteria at the starts.

    Args:
        parts: the states (m,) of each part; in which part the state is, is taken as observed.
        resolutions: of the grid of each part.
    """

    def __init__(self, model: LimitedModel, parts: list[Indices], resolutions: list[int]) -> None:
        self._model, self._parts = model, parts
        self._grids = [SimplexGrid(len(own), r) for own, r in zip(parts, resolutions, strict=True)]
        self._begins = np.cumsum([0, *(len(own.points) for own in self._grids)])
        self._points = np.zeros((self._begins[-1], len(model.base)))
        for part, grid, begin in zip(parts, self._grids, self._begins, strict=False):
            self._points[begin : begin + len(grid.points), part] = grid.points
        stated = model.stated
        earned = bound_above(stated, stated.reward)[model.base]
        self._rest = self._points @ np.where(model.model == model.first, model.n_models * earned, 0.0)
        self._steps = [self._interpolate_after(a) for a in range(len(model.transitions))]

    def __len__(self) -> int:
        """The number of points."""
        return len(self._points)

    def bound(self, factors: Array) -> Array:
        """Return (N,) an upper bound of the sum of the criteria at each start; factors: (1 + K,)."""
        model = self._model
        rewards = model.criteria @ self._points.T  # (1 + K, A, points)
        discount, branching = float(model.discounts[0]), len(model.transitions) * self._n_observations
        n_steps = min(MAX_STEPS, ceil(log(REST) / log(discount)) if discount > 0 else 1)
        depth = min(n_steps, int(log(MAX_LEAVES) / log(branching)) if branching > 1 else 1)
        value = self._bound_costs(factors, rewards)
        value = value + factors[0] * discount**n_steps * self._rest
        for t in range(n_steps - 1, depth - 1, -1):
            reward = np.tensordot(factors * model.discounts**t, rewards, axes=1)
            value = np.max([r + own @ value for r, own in zip(reward, self._steps, strict=True)], axis=0)
        return np.array(
            [self._look_ahead(start[None], 0, depth, factors, value)[0] for start in model.starts]
        )

    def _bound_costs(self, factors: Array, rewards: Array) -> Array:
        """Return (points,) an upper bound of the costs alone, after many steps: at best 0."""
        value = np.zeros(len(self._points))
        endless = factors * (self._model.discounts == 1)
        endless[0] = 0
        reward = np.tensordot(endless, rewards, axes=1)
        for _ in range(MAX_SWEEPS if endless.any() else 0):
            before = value
            value = np.max([r + own @ value for r, own in zip(reward, self._steps, strict=True)], axis=0)
            if np.abs(value - before).max() <= REST * np.abs(value).max():
                break
        return value

    @property
    def _n_observations(self) -> int:
        return int(self._model.observations[0].shape[1])

    def _look_ahead(self, beliefs: Array, t: int, depth: int, factors: Array, value: Array) -> Array:
        """Return (n,) the bound at beliefs (n, X), not normalised, after t steps."""
        if t == depth:
            weights, rows = self._interpolate(beliefs)
            own: Array = (weights * value[rows]).sum(axis=1)
            return own
        model = self._model
        reward = np.tensordot(factors * model.discounts**t, model.criteria, axes=1) @ beliefs.T  # (A, n)
        for a in range(len(reward)):
            after = self._follow(a, beliefs)
            shape = len(beliefs), self._n_observations
            following = self._look_ahead(after.reshape(-1, beliefs.shape[1]), t + 1, depth, factors, value)
            reward[a] += following.reshape(shape).sum(axis=1)
        best: Array = reward.max(axis=0)
        return best

    def _follow(self, action: int, beliefs: Array) -> Array:
        """Return (n, O, X) the joint probabilities of observation and state after an action in beliefs."""
        moved = (self._model.transitions[action].T @ beliefs.T).T
        joint: Array = moved[:, None, :] * self._model.observations[action].toarray().T
        return joint

    def _interpolate_after(self, action: int) -> Any:
        """Return the matrix from values at the points to their expectation after an action in each point."""
        from scipy.sparse import csr_array

        n, size = self._points.shape
        weights, rows = self._interpolate(self._follow(action, self._points).reshape(-1, size))
        begins = np.arange(n + 1) * (weights.size // n)
        matrix = csr_array((weights.ravel(), rows.ravel(), begins), shape=(n, n))
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
        return matrix

    def _interpolate(self, beliefs: Array) -> tuple[Array, Indices]:
        """Return (n, X) weights, with the sum of each belief (n, X), and rows of points."""
        found = [
            grid.interpolate(beliefs[:, part]) for grid, part in zip(self._grids, self._parts, strict=True)
        ]
        weights = np.hstack([own for own, _ in found])
        return weights, np.hstack([rows + b for (_, rows), b in zip(found, self._begins, strict=False)])


def make_grid_bounds(model: LimitedModel, *, refinement: int = 1) -> list[GridBound]:
    """Return the bounds by grids that are fine enough: over all states, and with the counts as observed.

    Args:
        refinement: factor of the maximum number of points.
    """
    if model.discounts[0] == 1:
        return []
    divisions = [[np.arange(len(model.base))]]
    if model.count.max() > 0:
        divisions.append([np.flatnonzero(model.count == c) for c in np.unique(model.count)])
    bounds = []
    for parts in divisions:
        resolutions = [_find_resolution(model, len(part), len(parts), refinement) for part in parts]
        if min(resolutions) >= MIN_RESOLUTION:
            bounds.append(GridBound(model, parts, resolutions))
    return bounds


def _find_resolution(model: LimitedModel, n_states: int, n_parts: int, refinement: int) -> int:
    """Return the finest resolution of a part within the limits of the grids."""
    width = len(model.base) * sum(own.shape[1] for own in model.observations)
    max_points = refinement * min(MAX_POINTS, MAX_ENTRIES // width) // n_parts
    if n_states == 1:
        return MIN_RESOLUTION
    resolution = 0
    observations = max(own.shape[1] for own in model.observations)
    max_points = min(max_points, MAX_CORNERS // (observations * n_states**2))
    while comb(resolution + n_states, n_states - 1) <= max_points and (resolution + 2) ** n_states < MAX_KEY:
        resolution += 1
    return resolution

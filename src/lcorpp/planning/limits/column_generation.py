"""The best randomised policy within limits, by column generation: a linear program mixes controllers.

For multipliers of the limits, the Lagrangian (return minus multipliers times costs) is the value of an
ordinary POMDP. A solver's policy for it becomes a controller, a column, with its exact return and costs; its
upper bound, plus multipliers times bounds, is an upper bound of what any policy within the limits earns. The
linear program over all columns gives the best mixture and the next multipliers.

Source: Walraven and Spaan, "Column generation algorithms for constrained POMDPs", JAIR 2018, with SARSOP's
two bounds in place of their finite-horizon solver.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from time import monotonic

import numpy as np

from lcorpp.planning.evaluation.mdp import bound_above
from lcorpp.planning.limits.controller import start_values
from lcorpp.planning.limits.extraction import Pool, add_policy
from lcorpp.planning.limits.grid_bound import REFINEMENT, make_grid_bounds
from lcorpp.planning.limits.limited_model import LimitedModel
from lcorpp.planning.limits.mixture import Mixture, mix
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import MAX_DISCOUNT, Pomdp
from lcorpp.planning.sarsop import solve
from lcorpp.planning.solution import CONVERGED, Solution
from lcorpp.planning.solvers.table_policy import compute_informed_bound
from lcorpp.planning.upper_bounds import SawtoothBound
from lcorpp.values import Array, Indices

SHARE, REPEATED_SHARE, MIN_SECONDS = 0.1, 0.5, 0.1
"""Share of the remaining time of a search, of one that continues another, and its least time in seconds."""

GRID_SHARE = 0.4
"""Factor of these shares if grids bound the return, so that a search is for plans only."""

FIRST_PRECISION = 0.02
"""Precision of the first searches, relative to the range of rewards."""

PRECISION_SHARE = 0.2
"""Precision of a search, relative to the gap that is left."""

MIN_PROGRESS = 0.2
"""Least share of the gap that a search closes; otherwise grids are refined, or the next search is."""

SAME = 1e-7
"""Relative difference of multipliers that are the same."""

SECONDS = 1.0
"""Time limit of the fast informed bound."""

ROUNDING = 1e-8
"""By how much values of nodes are lowered before another search begins with them, relative to the largest."""

CROSSING_TOLERANCE = 1e-6
"""Largest difference by which rounding may make the bounds cross, relative to return and rewards."""

MAX_MULTIPLIER = 1e4
"""Largest multiplier, in units of the range of returns over the largest cost."""

ENDLESS = 1e4
"""Cost of a plan without end, in units of the largest other cost or bound."""

MAX_EXCESS = 1e-9
"""Excess over the limits that is a rounding error, relative to their largest costs."""

MIN_PRECISION = 1e-7
"""Smallest precision of the search for plans within the limits, relative to their largest costs."""

MAX_STARTS = 1
"""With at most this many starts, all nodes of a column are candidates, with more its start nodes."""


class ColumnGeneration:
    """A running search for the best mixture of controllers within limits.

    pool: of all plans so far. best: mixture of the last linear program. upper: bound on the return within the
    limits. min_excess: lower bound of the excess of every policy over the limits, scaled as in `mix`.
    history: (seconds, return, upper bound, plans) after each search within the limits.
    """

    def __init__(
        self,
        model: LimitedModel,
        *,
        precision: float,
        time_limit: float,
        pool: Pool | None = None,
        use_grids: bool = True,
    ) -> None:
        self.model, self._precision = model, precision
        self._began = monotonic()
        self._end = self._began + time_limit
        n_limits = len(model.limits)
        self.upper, self.min_excess = inf, 0.0
        self.history: list[tuple[float, float, float, int]] = []
        self.pool = Pool.of(model) if pool is None else pool
        self._plans = np.arange(len(self.pool))
        self._values = start_values(model, self.pool.values)
        self._searches: list[tuple[Array, Solution]] = []
        self.best: Mixture | None = None
        self._zero = np.zeros(n_limits)
        self._grids, self._is_refined = make_grid_bounds(model) if use_grids else [], False
        self._grid_seconds = self.seconds
        self._span = float(np.ptp(model.stated.reward)) or 1.0
        self._largest: dict[tuple[int, float], Array] = {}
        self._start = model.weights @ model.place(model.starts)

    @property
    def seconds(self) -> float:
        """Wall-clock seconds so far."""
        return monotonic() - self._began

    @property
    def seconds_left(self) -> float:
        """Wall-clock seconds until the time limit."""
        return self._end - monotonic()

    def run(self, callback: Callable[[float, float, float, int], None] | None = None) -> str:
        """Search until the gap is at most the precision; return why the search ended."""
        try:
            reason = self._keep_limits()
            if reason is not None:
                return reason
            multipliers, precision = self._zero, FIRST_PRECISION * self._span
            while True:
                assert self.best is not None
                gap = self.upper - float(self.best.values[0])
                converged = self._search(1.0, multipliers, precision)
                before, self.best = self.best, self._mix()
                lower = float(self.best.values[0])
                self._check_bounds(lower)
                self.history.append((self.seconds, lower, self.upper, len(self._plans)))
                if callback is not None:
                    callback(*self.history[-1])
                if self.upper - lower <= self._precision:
                    return CONVERGED
                if self.seconds_left <= 0:
                    return "time limit"
                following, finest = np.minimum(self._find_multipliers(), self._cap), self._precision / 4
                change = float(np.abs(following - multipliers).max(initial=0.0))  # maybe of no limits
                same = change <= SAME * max(1.0, float(following.max(initial=0.0)))
                stays = self.upper - lower > (1 - MIN_PROGRESS) * gap
                if same and stays and not self._refine():
                    if converged and precision <= finest and lower <= float(before.values[0]) + 1e-12:
                        return "controllers limit"
                    precision = max(precision / 8, finest)
                precision = max(finest, min(precision, PRECISION_SHARE * (self.upper - lower)))
                multipliers = following
        except KeyboardInterrupt:
            if self.best is None:
                raise
            return "interrupted"

    def _check_bounds(self, lower: float) -> None:
        """Lift the upper bound to a return that is larger by rounding only."""
        if self.upper < lower - CROSSING_TOLERANCE * max(1.0, abs(lower), self._span):
            raise RuntimeError(f"the bounds cross by {lower - self.upper}; this is a bug in lcorpp")
        self.upper = max(self.upper, lower)

    def _keep_limits(self) -> str | None:
        """Find a mixture within the limits; return why there is none."""
        previous: Array | None = None
        precision = FIRST_PRECISION  # the multipliers make the costs relative to the largest
        if not self._is_finite():  # a total without end
            self._search(0.0, 1 / self.model.criteria[1:].max(axis=(1, 2), initial=1e-6), precision)
            if not self._is_finite():
                return "infinite"
        while True:
            mixture = self._mix(minimise_excess=True)
            if mixture.excess <= MAX_EXCESS:
                self.best = self._mix()
                return None
            self.best = mixture
            if self.min_excess > 0:
                return "infeasible"
            if self.seconds_left <= 0:
                return "time limit"
            multipliers = mixture.multipliers
            converged = self._search(0.0, multipliers, precision)
            if previous is not None and np.allclose(previous, multipliers, rtol=SAME, atol=0):
                if converged and precision <= MIN_PRECISION:
                    return "controllers limit"
                precision = max(precision / 8, MIN_PRECISION)
            previous = multipliers

    @property
    def _cap(self) -> Array:
        """(K,) the largest multipliers: those of an infeasible bound would grow without end."""
        finite = self._values[:, np.isfinite(self._values).all(axis=0)]
        range_ = float(np.ptp(finite[0])) or self._span
        cap: Array = MAX_MULTIPLIER * range_ / np.maximum(finite[1:].max(axis=1), 1e-9)
        return cap

    @property
    def plans(self) -> tuple[Indices, Array]:
        """(m,) nodes of the pool that may be mixed, and their values (1 + K, N, m) at the starts."""
        return self._plans, self._values

    def add_plans(self, multipliers: Array) -> None:
        """Add the plans of a search with multipliers (K,) of the limits."""
        self._search(1.0, multipliers, FIRST_PRECISION * self._span)

    def _is_finite(self) -> bool:
        """Whether each start has a plan with finite costs."""
        finite = np.isfinite(self._values).all(axis=0)
        return bool((finite.sum(axis=1) > 0).all())

    def _refine(self) -> bool:
        """Refine the grids once; return whether they were refined."""
        needed = 4 * REFINEMENT * self._grid_seconds  # to make them, and for some searches
        if self._is_refined or not self._grids or self.seconds_left < needed:
            return False
        self._grids, self._is_refined = make_grid_bounds(self.model, refinement=REFINEMENT), True
        return True

    def _find_multipliers(self) -> Array:
        """Return (K,) the multipliers of the next search.

        Plans whose costs have no end are not mixed. To avoid them, the next plans must know their price: here
        their costs are large numbers.
        """
        assert self.best is not None
        infinite = np.isinf(self._values)
        if not infinite.any():
            return self.best.multipliers
        finite = np.where(np.isfinite(self._values), self._values, 0.0)[1:].max(axis=(1, 2))
        large = ENDLESS * np.maximum(np.maximum(finite, self.model.bounds), 1.0)
        values = self._values.copy()
        values[1:] = np.where(infinite[1:], large[:, None, None], values[1:])
        return mix(self.model, self._plans, values).multipliers

    def _mix(self, *, minimise_excess: bool = False) -> Mixture:
        return mix(self.model, self._plans, self._values, minimise_excess=minimise_excess)

    def _search(self, factor: float, multipliers: Array, precision: float) -> bool:
        """Solve a Lagrangian and add the plans of its policy; return whether its bounds are close enough.

        Args:
            factor: of the return. multipliers: (K,) of the costs.
        """
        model = self.model
        factors = np.concatenate([[factor], -multipliers])
        problem = model.make_problem(factors)
        previous = self._find_previous(problem, factors, precision)
        known = previous is not None and previous.seconds > 0
        share = (REPEATED_SHARE if known else SHARE) * (GRID_SHARE if self._grids else 1.0)
        seconds = max(MIN_SECONDS, share * self.seconds_left)
        solution = solve(
            problem,
            model.place(model.starts),
            precision=precision,
            time_limit=seconds,
            previous=previous,
        )
        if solution.reason == "interrupted":
            raise KeyboardInterrupt
        self._searches.append((factors, solution))
        begin = len(self.pool)
        self.pool = add_policy(model, self.pool, problem, solution.policy, factors)
        values = start_values(model, self.pool.values[:, begin:])
        kept = np.arange(values.shape[2])
        if len(model.weights) > MAX_STARTS:  # the best for each start
            sums = np.nan_to_num(np.tensordot(factors, values, axes=1), nan=-inf)
            kept = np.unique(sums.argmax(axis=1))
        self._plans = np.concatenate([self._plans, begin + kept])
        self._values = np.concatenate([self._values, values[:, :, kept]], axis=2)
        bound = solution.policy.upper_bound
        assert bound is not None
        uppers = np.array([bound.value(start) for start in model.place(model.starts)])
        began = monotonic()
        for grid in [] if solution.reason == CONVERGED else self._grids:
            uppers = np.minimum(uppers, grid.bound(factors))
        self._grid_seconds = max(self._grid_seconds, monotonic() - began)
        upper = float(model.weights @ uppers) + float(multipliers @ model.bounds)
        if factor:
            self.upper = min(self.upper, upper)
        else:  # the multipliers times the scales of the costs sum to 1
            self.min_excess = max(self.min_excess, -upper)
        return solution.reason == CONVERGED

    def _find_previous(self, problem: Pomdp, factors: Array, precision: float) -> Solution | None:
        """Return what earlier searches know of a problem: vectors of the columns, and a raised upper bound.

        Whatever the multipliers are, a column earns the sum of its criteria. An upper bound for other
        multipliers is raised by the most that the difference of the multipliers can earn in each state.
        """
        best, min_rise, raised = None, inf, np.zeros(0)
        for own, solution in reversed(self._searches):
            bound = solution.policy.upper_bound
            if own[0] != factors[0] or not isinstance(bound, SawtoothBound):
                continue
            if np.array_equal(own, factors):
                return replace(solution, pomdp=problem)
            change = self._bound_change(factors - own)
            rise = float(self._start @ change.max(axis=0))
            if rise < min_rise:
                best, min_rise, raised = bound, rise, change
        if best is None:
            return None
        informed = np.minimum(best.informed + raised, compute_informed_bound(problem, precision, SECONDS))
        corner = raised.max(axis=0)
        corners = np.minimum(best.corners + corner, informed.max(axis=0))
        points = (
            np.add.reduceat(best.weights * corner[best.states], best.begins[:-1]) if len(best.values) else 0
        )
        bound = SawtoothBound(informed, corners, best.begins, best.states, best.weights, best.values + points)
        policy = Policy.of_sets(problem, [self._choose_vectors(problem, factors, best)], bound)
        start = self.model.place(self.model.starts)[0]
        return Solution(problem, policy, -inf, inf, 0.0, "", (), 0, 0, start)

    def _choose_vectors(self, problem: Pomdp, factors: Array, bound: SawtoothBound) -> AlphaVectors:
        """Return the vectors of nodes of the pool that are best at a start or a point of a bound."""
        from scipy.sparse import csr_array

        vectors = self.model.combine(factors, self.pool.values)
        actions = self.pool.controller.actions
        # where a value is not known, the least of all policies takes its place
        floor = float(np.minimum(problem.reward.min(), 0.0)) / (1 - min(problem.discount, MAX_DISCOUNT))
        kept = np.isfinite(vectors).any(axis=1) & ~np.isinf(vectors).any(axis=1)
        vectors, actions = np.nan_to_num(vectors[kept], nan=floor), actions[kept]
        shape = (len(bound.values), vectors.shape[1])
        points = csr_array((bound.weights, bound.states, bound.begins), shape=shape)
        beliefs = (points @ vectors.T, self.model.place(self.model.starts) @ vectors.T)
        chosen = np.unique(np.concatenate([np.asarray(own).argmax(axis=1) for own in beliefs]))
        slack = ROUNDING * max(1.0, float(np.abs(vectors[chosen]).max()))
        return AlphaVectors(np.arange(vectors.shape[1]), vectors[chosen] - slack, actions[chosen])

    def _bound_change(self, change: Array) -> Array:
        """Return (A, S) the most that a sum of the criteria can earn after each action in each state."""
        model, total = self.model, 0.0
        for i in np.flatnonzero(change):
            one = np.zeros(len(change))
            one[i] = np.sign(change[i])
            if (int(i), float(one[i])) not in self._largest:
                problem = model.make_problem(one)
                values = bound_above(problem, problem.reward)
                after = np.array(
                    [problem.transition.backward(a, values) for a in range(len(problem.actions))]
                )
                self._largest[int(i), float(one[i])] = problem.reward + problem.discount * after
            total = total + abs(change[i]) * self._largest[int(i), float(one[i])]
        return np.asarray(total)

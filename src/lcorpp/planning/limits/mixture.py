"""The linear program that mixes controllers within limits, and its deterministic counterpart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.limits.controller import Controller
from lcorpp.planning.limits.extraction import Pool
from lcorpp.planning.limits.limited_model import LimitedModel
from lcorpp.values import Array, Indices

MIN_PROBABILITY = 1e-12
"""Smaller probabilities of the mixture are rounding errors."""

MARGIN = 1e-9
"""Share by which the bounds of the linear program are smaller, so that rounding breaks none."""

PRECISE = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
"""Options of the linear program, whose own tolerance is 1e-7."""

ROUNDING, SLACK = 1e-8, 2e-7
"""Changes of the bounds, relative to the largest cost: the tolerance of the smallest feasible one, and a
margin without these options."""

MILP_SECONDS = 10.0
"""Time limit of the search for the best deterministic mixture."""


@dataclass(frozen=True, eq=False)
class Mixture:
    """Probabilities of plans within limits.

    plans: (m,) nodes of the pool. shares: (N, m) their probabilities, for each start.
    values: (1 + K,) return and costs. multipliers: (K,) dual prices of the limits.
    excess: the smallest by which limits are exceeded, see `mix`.
    """

    plans: Indices
    shares: Array
    values: Array
    multipliers: Array
    excess: float = 0.0

    def make_controller(self, pool: Pool) -> tuple[Controller, Array]:
        """Return the controller of the plans with a share, and (N, n) probabilities of its start nodes."""
        used = np.flatnonzero(self.shares.max(axis=0) > 0)
        kept, starts = pool.controller.keep(self.plans[used])
        controller, number = kept.minimise()
        probabilities = np.zeros((len(self.shares), len(controller)))
        for node, own in zip(number[starts].tolist(), self.shares[:, used].T, strict=True):
            probabilities[:, node] += own
        return controller, probabilities


def mix(model: LimitedModel, plans: Indices, values: Array, *, minimise_excess: bool = False) -> Mixture:
    """Return the mixture with the largest return within the limits.

    Args:
        plans: (m,) distinct nodes of the pool. values: (1 + K, N, m) theirs at the starts.
        minimise_excess: the smallest t such that no cost is more than its bound plus t times its largest cost
            takes the place of the return; the mixture's excess is t.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, hstack

    program = _Program.of(model, plans, values)
    prices, costs, bounds = program.prices, program.costs, program.bounds
    ones, rights = program.choices, np.ones(program.n_starts)
    if minimise_excess:
        prices = np.append(np.zeros(len(prices)), 1.0)
        costs = hstack([costs, csr_array(-np.ones((len(bounds), 1)))], format="csr")
        ones = hstack([ones, csr_array((program.n_starts, 1))], format="csr")
    solver: Any = linprog
    # Rounding can miss the smallest feasible bounds. The precise solver fails on some programs; with
    # its own tolerance the bounds are a little tighter.
    for options, slack in ((PRECISE, 0.0), (PRECISE, ROUNDING), ({}, -SLACK), ({}, ROUNDING)):
        own = np.maximum(bounds + slack, np.minimum(bounds, 0.0))
        found = solver(prices, costs, own, ones, rights, bounds=(0, None), method="highs", options=options)
        if found.status == 0:
            break
    else:
        raise ModelError(f"the linear program of the limits ended with: {found.message}")
    multipliers = np.maximum(-np.asarray(found.ineqlin.marginals), 0.0) / program.scales
    excess = float(found.x[-1]) if minimise_excess else 0.0
    return program.make_mixture(found.x, multipliers, excess)


def choose_plans(model: LimitedModel, plans: Indices, values: Array) -> Mixture | None:
    """Return the best mixture with a single plan for each start; None if no plans keep the limits.

    Arguments as of `mix`.
    """
    from scipy.optimize import LinearConstraint, milp

    program = _Program.of(model, plans, values)
    constraints = [
        LinearConstraint(program.costs, -np.inf, program.bounds),
        LinearConstraint(program.choices, 1.0, 1.0),
    ]
    solver: Any = milp
    found = solver(
        program.prices,
        constraints=constraints,
        integrality=np.ones(len(program.prices)),
        bounds=(0, 1),
        options={"time_limit": MILP_SECONDS},
    )
    if found.x is None:
        return None
    mixture = program.make_mixture(np.round(found.x), np.zeros(len(program.bounds)))
    keeps = mixture.values[1:] <= model.bounds + 1e-9 * program.scales  # plans were rounded to 0 and 1
    return mixture if keeps.all() else None


@dataclass(frozen=True, eq=False)
class _Program:
    """The linear program: a variable for each start and each plan with finite values there.

    prices: (v,) minus the return. costs: (K, v), divided by the scales. choices: (N, v). bounds: (K,) scaled.
    places: (2, v) start and plan. scales: (K,) the largest costs. plans: (m,).
    """

    prices: Array
    costs: Any
    choices: Any
    bounds: Array
    places: Indices
    scales: Array
    plans: Indices
    n_starts: int

    @classmethod
    def of(cls, model: LimitedModel, plans: Indices, values: Array) -> _Program:
        from scipy.sparse import csr_array

        starts, places = np.nonzero(np.isfinite(values).all(axis=0))
        own = values[:, starts, places] * model.weights[starts]
        scales = np.maximum(values[1:, starts, places].max(axis=1), 1e-6)
        choices = csr_array((np.ones(len(starts)), (starts, np.arange(len(starts)))))
        bounds = (1 - MARGIN) * model.bounds / scales
        costs = csr_array(own[1:] / scales[:, None])
        return cls(
            -own[0], costs, choices, bounds, np.array([starts, places]), scales, plans, len(model.weights)
        )

    def make_mixture(self, solution: Array, multipliers: Array, excess: float = 0.0) -> Mixture:
        starts, places = self.places
        shares = np.zeros((self.n_starts, len(self.plans)))
        shares[starts, places] = np.maximum(solution[: len(starts)], 0.0)
        shares[shares < MIN_PROBABILITY] = 0.0
        shares /= shares.sum(axis=1, keepdims=True)
        own = shares[starts, places]
        values = np.concatenate([[-self.prices @ own], (self.costs @ own) * self.scales])
        return Mixture(self.plans, shares, values, multipliers, excess)

"""`solve_limited`: the best randomised policy within limits, and what to say if there is none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.errors import InfeasibleError, ModelError
from lcorpp.notebook import html_table
from lcorpp.planning.arguments import check_solver_arguments, check_type
from lcorpp.planning.limits.column_generation import MAX_EXCESS, ColumnGeneration
from lcorpp.planning.limits.extraction import Pool
from lcorpp.planning.limits.limit import Limit
from lcorpp.planning.limits.limited_model import LimitedModel, build_limited_model
from lcorpp.planning.limits.mixture import Mixture, choose_plans
from lcorpp.planning.limits.randomised_policy import RandomisedPolicy
from lcorpp.planning.pomdp import SUM_TOLERANCE, Pomdp
from lcorpp.planning.solution import CONVERGED
from lcorpp.values import Array

SMALLEST_BOUND_SHARE = 0.5
"""Share of the time limit for the search of the smallest feasible bound of each limit."""

DETERMINISTIC_STEPS = 6
"""Searches with larger multipliers, whose plans keep the limits without mixing."""


@dataclass(frozen=True, eq=False)
class LimitedProgress:
    """The state of a running search within limits.

    seconds: wall-clock time. lower: return of the best policy. upper: bound for all. plans: their number.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_limit, solve_limited
        >>> pomdp, steps = load_domain("intention").pomdp, []
        >>> limit = read_limit(pomdp, "greet <= 0")
        >>> solution = solve_limited(pomdp, [limit], precision=1, callback=steps.append)
        >>> steps[-1].lower == solution.value
        True
    """

    seconds: float
    lower: float
    upper: float
    plans: int


@dataclass(frozen=True, eq=False)
class LimitedSolution:
    """A policy within limits, and a bound on the return of all such policies.

    pomdp: the problem. limits: each once for each model for which it holds.
    policy: keeps the limits. value: its return. costs: (K,) its costs or probabilities of the limits.
    upper: no policy within the limits earns more.
    multipliers: (K,) what one more unit of a bound is worth to a randomised policy, in reward units.
    seconds, reason: of the search, as of `Solution`; "controllers limit" if more nodes would be needed.
    history: (seconds, return, upper bound, plans) after each search.
    model: with the counts of the limits in its states.
    pool: of all plans, to continue with other bounds.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_limit, solve_limited
        >>> pomdp = load_domain("intention").pomdp
        >>> solution = solve_limited(pomdp, [read_limit(pomdp, "total(*) <= 1")], precision=0.1)
        >>> round(float(solution.costs[0]), 6), round(solution.value)  # a report at once
        (1.0, 0)
    """

    pomdp: Pomdp
    limits: tuple[Limit, ...]
    policy: RandomisedPolicy
    value: float
    costs: Array
    upper: float
    multipliers: Array
    seconds: float
    reason: str
    history: tuple[tuple[float, float, float, int], ...]
    model: LimitedModel
    pool: Pool

    @property
    def converged(self) -> bool:
        """Whether the bounds are as close as requested."""
        return self.reason == CONVERGED

    @property
    def gap(self) -> float:
        """The most that another policy within the limits may earn more, in reward units."""
        return self.upper - self.value

    def summary(self) -> str:
        """Return the result in one line of text."""
        costs = ", ".join(
            f"{limit.name} {cost:.6g} of {limit.bound:g}"
            for limit, cost in zip(self.limits, self.costs, strict=True)
        )
        return (
            f"{self.reason} after {self.seconds:.2f} s: value in [{self.value:.6g}, {self.upper:.6g}],"
            f" {costs}; {len(self.policy.controller)} nodes"
        )

    def __repr__(self) -> str:
        return f"<LimitedSolution {self.summary()}>"

    def _repr_html_(self) -> str:
        rows = [
            ("return", f"{self.value:.6g}"),
            ("upper bound", f"{self.upper:.6g}"),
            *[
                (limit.name, f"{cost:.6g}, at most {limit.bound:g}")
                for limit, cost in zip(self.limits, self.costs, strict=True)
            ],
            ("nodes", f"{len(self.policy.controller)}"),
            ("search", f"{self.reason} after {self.seconds:.2f} s"),
        ]
        return html_table(("quantity", "value"), rows, caption="Policy within limits")


def solve_limited(
    pomdp: Pomdp,
    limits: Sequence[Limit],
    start: npt.ArrayLike | None = None,
    *,
    weights: npt.ArrayLike | None = None,
    models: Sequence[Pomdp] = (),
    factors: npt.ArrayLike | None = None,
    deterministic: bool = False,
    precision: float = 5e-4,
    time_limit: float = 60.0,
    previous: LimitedSolution | None = None,
    callback: Callable[[LimitedProgress], None] | None = None,
) -> LimitedSolution:
    """Find the policy with the largest return among those within limits, and a bound for all of them.

    The policy is in general randomised: it draws one of several plans at the start of a decision. The limits
    hold for the expectation over these draws, exactly up to rounding.

    Args:
        limits: of the model, see `read_limit`.
        start: (S,) or (N, S) beliefs from which decisions begin; the model's own when None.
        weights: (N,) their probabilities; equal by default.
        models: the limits hold for each of these models, which may be true in place of the stated one, whose
            return is the objective; by default for the stated one.
        factors: (K, N, S) of the costs in a decision that begins from a belief in a state.
        deterministic: whether the policy is a single plan for each start. `upper` is that of all policies.
        precision: stop when the gap between return and upper bound is at most this, in reward units.
        time_limit: wall-clock seconds.
        previous: a solution for the same model, starts and limits with other bounds, whose plans are used.
        callback: called after each search.

    Raises:
        ModelError: an argument is wrong.
        InfeasibleError: no policy keeps the limits, or none was found in time; the message has the smallest
            feasible bounds.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_limit, solve_limited
        >>> pomdp = load_domain("intention").pomdp
        >>> limit = read_limit(pomdp, "move_forward,greet|not_interested <= .1")
        >>> solution = solve_limited(pomdp, [limit])
        >>> bool(solution.costs[0] <= 0.1), solution.gap < 0.05
        (True, True)
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    shares = np.full(len(starts), 1 / len(starts))
    if weights is not None:
        shares = _read_numbers(weights, "weights")
        if shares.shape != starts.shape[:1] or not abs(shares.sum() - 1) <= SUM_TOLERANCE:
            raise ModelError(f"the weights of {len(starts)} starts are as many probabilities that sum to 1")
    for name, given in (("limits", limits), ("models", models)):
        check_type(name, given, Sequence)
    if factors is not None:
        factors = _read_numbers(factors, "factors")
        if factors.shape != (len(limits), *starts.shape):
            raise ModelError(f"factors have shape {factors.shape}; expected {(len(limits), *starts.shape)}")
    model = build_limited_model(
        pomdp,
        limits,
        starts,
        shares,
        models=models,
        factors=factors,
    )
    began = monotonic()
    pool = None
    if previous is not None:
        check_type("previous", previous, LimitedSolution)
        if not _is_same_problem(previous.model, model):
            raise ModelError("the previous solution is for another model, other starts or other limits")
        pool = previous.pool
    search = ColumnGeneration(model, precision=precision, time_limit=time_limit, pool=pool)
    show = None if callback is None else lambda *now: callback(LimitedProgress(*now))
    reason = search.run(show)
    if search.best is None or search.best.excess > MAX_EXCESS:
        raise InfeasibleError(_describe_excess(model, search, reason, time_limit))
    mixture: Mixture | None = search.best
    if deterministic:
        mixture = (
            find_deterministic(search) if reason != "interrupted" else choose_plans(model, *search.plans)
        )
        if mixture is None:
            raise InfeasibleError(
                "no deterministic policy within the limits was found; expected larger bounds, or a randomised"
                " one"
            )
    assert mixture is not None
    controller, probabilities = mixture.make_controller(search.pool)
    return LimitedSolution(
        pomdp=pomdp,
        limits=model.limits,
        policy=RandomisedPolicy.of(pomdp, controller, starts, probabilities),
        value=float(mixture.values[0]),
        costs=mixture.values[1:],
        upper=max(search.upper, float(mixture.values[0])),
        multipliers=search.best.multipliers,
        seconds=monotonic() - began,
        reason=reason,
        history=tuple(search.history),
        model=model,
        pool=search.pool,
    )


def _read_numbers(numbers: npt.ArrayLike, name: str) -> Array:
    """Return numbers that are finite and not negative."""
    try:
        found = np.asarray(numbers, dtype=np.float64)
    except (TypeError, ValueError):
        raise ModelError(f"{name} are not numbers") from None
    if not (np.isfinite(found) & (found >= 0)).all():
        raise ModelError(f"{name} are finite numbers from 0")
    return found


def _is_same_problem(one: LimitedModel, other: LimitedModel) -> bool:
    """Whether two models differ at most in the bounds of their limits."""
    prints = [[own.stated.fingerprint, *(truth.fingerprint for truth in own.truths)] for own in (one, other)]
    fields = ("criteria", "discounts", "starts", "weights", "base", "count", "model")
    return prints[0] == prints[1] and all(
        np.array_equal(getattr(one, field), getattr(other, field)) for field in fields
    )


def find_deterministic(search: ColumnGeneration) -> Mixture | None:
    """Return the best mixture of a single plan for each start; None if there is none.

    Plans for larger multipliers are added, which keep the limits alone.
    """
    assert search.best is not None
    multipliers = search.best.multipliers
    for _ in range(DETERMINISTIC_STEPS if multipliers.any() else 0):
        multipliers = 1.5 * multipliers
        search.add_plans(multipliers)
    return choose_plans(search.model, *search.plans)


def _describe_excess(model: LimitedModel, search: ColumnGeneration, reason: str, time_limit: float) -> str:
    """Return the message that the limits cannot be kept, with the smallest bound of each."""
    names = ", ".join(f"{limit.name} <= {limit.bound:g}" for limit in model.limits)
    if search.best is None:
        return f"no policy with finite costs was found for the limits {names}; expected discounted(...)"
    if reason != "infeasible":
        costs = ", ".join(
            f"{limit.name} {cost:.4g}"
            for limit, cost in zip(model.limits, search.best.values[1:], strict=True)
        )
        return (
            f"no policy within the limits {names} was found in {search.seconds:.1f} s, but there may be one;"
            f" the nearest has {costs}; give more time or larger bounds"
        )
    parts = []
    for k, limit in enumerate(model.limits):
        found = find_smallest_bound(model, k, SMALLEST_BOUND_SHARE * time_limit / len(model.limits))
        if found is None:
            parts.append(f"{limit.name}: none was found while the others hold")
        elif found[0] > limit.bound:
            is_close = found[0] - found[1] <= 1e-3 * found[0]
            certain = "" if is_close else f", certainly more than {max(found[1], limit.bound):.4g}"
            parts.append(f"{limit.name} <= {_round_up(found[0])}{certain}")
    if not parts:
        return f"no policy keeps the limits {names}"
    others = " while the others hold" if len(model.limits) > 1 else ""
    return f"no policy keeps the limits {names}; the smallest feasible bound{others}: {'; '.join(parts)}"


def _round_up(number: float) -> str:
    """Return a number with four digits, not less than it."""
    digits = 10.0 ** (3 - int(np.floor(np.log10(max(number, 1e-12)))))
    return f"{np.ceil(number * digits) / digits:.4g}"


def find_smallest_bound(model: LimitedModel, k: int, seconds: float) -> tuple[float, float] | None:
    """Return the smallest cost of limit k that was found while the others hold, and a certain lower bound.

    Returns:
        None if the others cannot be kept.
    """
    cost, others = model.criteria[k + 1], np.delete(np.arange(len(model.limits)), k)
    swapped = replace(
        model,
        limits=tuple(model.limits[j] for j in others),
        criteria=np.concatenate([-cost[None], model.criteria[others + 1]]),
        discounts=np.concatenate([model.discounts[k + 1 : k + 2], model.discounts[others + 1]]),
    )
    precision = 1e-4 * float(cost.max(initial=1e-6))
    search = ColumnGeneration(swapped, precision=precision, time_limit=seconds, use_grids=False)
    search.run()
    if search.best is None or search.best.excess > MAX_EXCESS:
        return None
    return -float(search.best.values[0]), -search.upper

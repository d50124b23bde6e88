"""The check of a randomised policy: its return and the costs of its limits, independent of the solver.

The controller is followed forward from the starts, step by step, in the model as stated. An event is counted
here, not in the states of a larger model. What is left after the last step has a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from time import monotonic
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import PolicyError
from lcorpp.notebook import html_table
from lcorpp.planning.arguments import check_positive
from lcorpp.planning.evaluation.certificate import TOLERANCE, Verdict
from lcorpp.planning.evaluation.mdp import mdp_value_bounds
from lcorpp.planning.limits.limit import Limit
from lcorpp.planning.limits.limited_model import check_names, name_limit
from lcorpp.planning.limits.randomised_policy import RandomisedPolicy
from lcorpp.planning.limits.solver import LimitedSolution
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

REST_SHARE = 0.01
"""Steps end when the bound of what is left is at most this share of the tolerance."""

MAX_STEPS = 100_000
"""Maximum number of steps that are followed."""

MAX_HALF_LIFE = 10_000
"""Largest number of steps after which a total is certain to have a bound."""

CHECK_EVERY = 10
"""The time limit is checked after this many steps."""


class Check(NamedTuple):
    """A number that was checked: what it is, (low, high) bounds from the check, and what was claimed.

    verdict: "confirmed", "refuted", or "open" if the bounds are not close enough.
    """

    what: str
    low: float
    high: float
    claim: str
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class LimitsCertificate:
    """The check of the claims about a randomised policy: its return, and that each limit is kept.

    checks: of the return, then of the limits. tolerance: of the claims.
    verdict: "refuted" if one check is, else "open" if one is, else "confirmed".
    """

    checks: tuple[Check, ...]
    tolerance: float
    seconds: float

    @property
    def verdict(self) -> Verdict:
        """Of all checks."""
        found = [own.verdict for own in self.checks]
        return "refuted" if "refuted" in found else "open" if "open" in found else "confirmed"

    @property
    def text(self) -> str:
        """The certificate, with a line for each check and one for the verdict."""
        lines = [f"{own.what}: {_show(own)}, {own.claim}: {own.verdict}" for own in self.checks]
        return "\n".join(
            [
                *lines,
                f"verdict: {self.verdict} (followed forward, tolerance {self.tolerance:.2g} of the return)",
            ]
        )

    def __repr__(self) -> str:
        return f"<LimitsCertificate\n{self.text}>"

    def _repr_html_(self) -> str:
        rows = [(own.what, f"{_show(own)}, {own.claim}: {own.verdict}") for own in self.checks]
        return html_table(("quantity", "check"), rows, caption="Certificate of limits")


def _show(check: Check) -> str:
    close = check.high - check.low <= 1e-9 * max(1.0, abs(check.high))
    return f"{check.high:.8g}" if close else f"{check.low:.8g} to {check.high:.8g}"


def verify_limits(
    solution: LimitedSolution,
    policy: RandomisedPolicy | None = None,
    *,
    models: Sequence[Pomdp] = (),
    tolerance: float | None = None,
    time_limit: float = 60.0,
    callback: Callable[[float, str], None] | None = None,
) -> LimitsCertificate:
    """Check return and limits of a solution by following its policy.

    Args:
        solution: of `solve_limited`. policy: as written to a file; that of the solution by default.
        models: in which the limits are checked; those of the solution by default.
        tolerance: of the return; 1e-6 times the claimed values when None. That of a limit is 1e-6.
        time_limit: seconds; the bounds so far determine the verdict, which may be "open".
        callback: called with the share of the checks that are done, and a text.

    Raises:
        PolicyError: the policy is for another model.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import read_limit, solve_limited, verify_limits
        >>> pomdp = load_domain("intention").pomdp
        >>> limit = read_limit(pomdp, "move_forward,greet|not_interested <= .1")
        >>> verify_limits(solve_limited(pomdp, [limit])).verdict
        'confirmed'
    """
    began = monotonic()
    own = solution.policy if policy is None else policy
    pomdp, model = solution.pomdp, solution.model
    own.check_model(pomdp)
    if tolerance is None:
        tolerance = TOLERANCE * max(1.0, abs(solution.value), abs(solution.upper))
    check_positive("tolerance", tolerance)
    check_positive("time limit", time_limit)
    if (
        own.starts.shape != solution.policy.starts.shape
        or np.abs(own.starts - solution.policy.starts).max() > 1e-9
    ):
        raise PolicyError("the policy begins from other beliefs than the solution")
    shares = model.weights
    truths = list(models) or list(model.truths)
    check_names(truths, pomdp)
    limits = model.stated_limits
    todo = 1 + len(truths) * len(limits)
    deadline = began + time_limit
    walk = _Walk(own, pomdp, deadline, tolerance, pomdp.discount)
    low, high = walk.sum_rewards(shares)
    verdict = _compare(low, high, solution.value - tolerance, solution.upper + tolerance)
    claim = f"claimed {solution.value:.8g}, at most {solution.upper:.8g}"
    checks = [Check("return", low, high, claim, verdict)]
    for m, truth in enumerate(truths):
        walk = _Walk(own, truth, deadline, tolerance, pomdp.discount)
        for k, limit in enumerate(limits):
            if callback is not None:
                callback(len(checks) / todo, limit.name)
            low, high = walk.sum_costs(limit, shares, model.factors[k])
            name, top = name_limit(limit, m, len(truths)), limit.bound + TOLERANCE * max(1.0, limit.bound)
            checks.append(
                Check(name, low, high, f"at most {limit.bound:g}", _compare(low, high, -np.inf, top))
            )
    return LimitsCertificate(tuple(checks), tolerance, monotonic() - began)


def _compare(low: float, high: float, min_value: float, max_value: float) -> Verdict:
    """Return whether a number between low and high is between two limits."""
    if high < min_value or low > max_value:
        return "refuted"
    return "confirmed" if min_value <= low and high <= max_value else "open"


class _Walk:
    """The joint probabilities of node and state under a policy in a model, step by step."""

    def __init__(
        self, policy: RandomisedPolicy, pomdp: Pomdp, deadline: float, tolerance: float, discount: float
    ) -> None:
        self._policy, self._pomdp, self._deadline, self._tolerance = policy, pomdp, deadline, tolerance
        self._discount = discount
        self._moves = [pomdp.transition.matrix(a) for a in range(len(pomdp.actions))]
        # for each action the observations that it may have, and their likelihoods (S,)
        self._seen = []
        for a in range(len(pomdp.actions)):
            own = pomdp.observation[a]
            self._seen.append([(o, own[:, o].copy()) for o in np.flatnonzero(own.any(axis=0))])
        actions = policy.controller.actions
        self._nodes = [(a, np.flatnonzero(actions == a)) for a in np.unique(actions).tolist()]

    def sum_rewards(self, weights: Array) -> tuple[float, float]:
        """Return bounds on the return, discounted as the model."""
        pomdp, discount = self._pomdp, self._discount
        joint = (self._policy.probabilities * weights[:, None]).T @ self._policy.starts  # (n, S)
        if discount < 1:
            min_value, max_value = mdp_value_bounds(pomdp)
            low_rest, high_rest = (
                np.broadcast_to(min_value, joint.shape),
                np.broadcast_to(max_value, joint.shape),
            )
        else:
            possible = self._find_possible(np.abs(pomdp.reward))
            ahead = 2 * float(np.abs(pomdp.reward).max()) * self._find_half_life(possible)
            high_rest = np.where(possible, ahead, 0.0)
            low_rest = -high_rest
        total, factor, low, high = 0.0, 1.0, -np.inf, np.inf
        for step in range(MAX_STEPS):
            used = joint > 0
            low = factor * float((joint[used] * low_rest[used]).sum())
            high = factor * float((joint[used] * high_rest[used]).sum())
            if high - low <= REST_SHARE * self._tolerance or self._is_late(step):
                return total + low, total + high
            total += factor * float((joint * pomdp.reward[self._policy.controller.actions]).sum())
            joint, factor = self._move(joint), factor * discount
        return -np.inf, np.inf

    def sum_costs(self, limit: Limit, weights: Array, factors: Array) -> tuple[float, float]:
        """Return bounds on the cost or the probability of a limit; factors: (N, S) of the costs."""
        starts = self._policy.starts * factors
        joint = (self._policy.probabilities * weights[:, None]).T @ starts
        cost = limit.cost[self._policy.controller.actions]  # (n, S)
        if limit.kind != "probability":
            discount = self._discount if limit.kind == "discounted" else 1.0
            return self._add_costs(joint, cost, discount)
        happens = cost > 0
        can_happen = self._find_possible(limit.cost)
        # counts[c]: joint probabilities of node and state after the event has happened c times
        counts = [joint, *[np.zeros_like(joint)] * limit.more_than]
        total, rest = 0.0, np.inf
        for step in range(MAX_STEPS):
            rest = float(sum((own * can_happen).sum() for own in counts))
            if rest <= REST_SHARE * TOLERANCE or self._is_late(step):
                break
            total += float((counts[-1] * happens).sum())
            stays = [np.where(happens, 0.0, own) for own in counts]
            raised = [np.zeros_like(joint), *(np.where(happens, own, 0.0) for own in counts[:-1])]
            counts = [self._move(a + b) for a, b in zip(stays, raised, strict=True)]
        return total, total + rest

    def _add_costs(self, joint: Array, cost: Array, discount: float) -> tuple[float, float]:
        """Return bounds on an expected cost."""
        can_happen = self._find_possible(self._cost_of_actions(cost))
        largest = float(cost.max(initial=0.0))
        # the largest expected cost of what is left: without discount, that of halves of its probability
        ahead = largest / (1 - discount) if discount < 1 else 2 * largest * self._find_half_life(can_happen)
        total, factor, rest = 0.0, 1.0, np.inf
        for step in range(MAX_STEPS):
            mass = float((joint * can_happen).sum())
            rest = factor * mass * ahead if mass > 0 else 0.0
            if rest <= REST_SHARE * TOLERANCE or self._is_late(step):
                break
            total += factor * float((joint * cost).sum())
            joint, factor = self._move(joint), factor * discount
        return total, total + rest

    def _find_half_life(self, possible: npt.NDArray[np.bool_]) -> float:
        """Return a number of steps after which costs are possible with at most half the probability.

        It holds from each node and state that the policy reaches; infinity if it is more than
        `MAX_HALF_LIFE`.
        """
        possible = possible & self._reached
        left, steps = possible.astype(np.float64), 0
        while left.max(initial=0.0) > 0.5:
            if steps == MAX_HALF_LIFE or self._is_late(steps):
                return np.inf
            left, steps = np.where(possible, self._expect(left), 0.0), steps + 1
        return max(steps, 1)

    def _cost_of_actions(self, cost: Array) -> Array:
        found = np.zeros(self._pomdp.reward.shape)
        np.maximum.at(found, self._policy.controller.actions, cost)
        return found

    def _find_possible(self, cost: Array) -> npt.NDArray[np.bool_]:
        """Return (n, S) whether the policy may come from a node and state to one with a cost."""
        controller = self._policy.controller
        possible = cost[controller.actions] > 0
        while True:
            found = possible | (self._expect(possible.astype(np.float64)) > 0)
            if (found == possible).all():
                return possible
            possible = found

    @cached_property
    def _reached(self) -> npt.NDArray[np.bool_]:
        """(n, S) whether the policy reaches a node and state from its starts."""
        reached = (self._policy.probabilities.T @ self._policy.starts) > 0
        while True:
            found = reached | (self._move(reached.astype(np.float64)) > 0)
            if (found == reached).all():
                return reached
            reached = found

    def _expect(self, values: Array) -> Array:
        """Return (n, S) the expectation of values (n, S) after a step from each node and state."""
        controller = self._policy.controller
        before = np.zeros_like(values)
        for a, nodes in self._nodes:
            later = np.zeros((len(nodes), len(self._pomdp.states)))
            for o, seen in self._seen[a]:
                later += values[controller.successors[nodes, o]] * seen
            before[nodes] = (self._moves[a] @ later.T).T
        return before

    def _move(self, joint: Array) -> Array:
        """Return (n, S) the joint probabilities after a step."""
        controller = self._policy.controller
        after = np.zeros_like(joint)
        for a, nodes in self._nodes:
            moved = (self._moves[a].T @ joint[nodes].T).T
            for o, seen in self._seen[a]:
                np.add.at(after, controller.successors[nodes, o], moved * seen)
        return after

    def _is_late(self, step: int) -> bool:
        return step % CHECK_EVERY == 0 and monotonic() > self._deadline

"""The check of a randomised policy: its return and the costs of its limits, independent of the solver.

The controller is followed forward from the starts, step by step, in the model as stated. An event is counted
here, not in the states of a larger model. What is left after the last step has a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.notebook import html_table
from lcorpp.planning.evaluation.mdp import mdp_value_bounds
from lcorpp.planning.limits.limit import Limit
from lcorpp.planning.limits.randomised_policy import RandomisedPolicy
from lcorpp.planning.limits.solver import LimitedSolution
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

TOLERANCE = 1e-6
"""Of a claim, relative to the largest claimed value, which counts as at least 1."""

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
    verdict: Literal["confirmed", "refuted", "open"]


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
    def verdict(self) -> Literal["confirmed", "refuted", "open"]:
        """Of all checks."""
        found = [own.verdict for own in self.checks]
        return "refuted" if "refuted" in found else "open" if "open" in found else "confirmed"

    @property
    def text(self) -> str:
        """The certificate, with a line for each check and one for the verdict."""
        lines = [f"{own.what}: {_show(own)}, {own.claim}: {own.verdict}" for own in self.checks]
        return "\n".join(
            [*lines, f"verdict: {self.verdict} (followed forward, tolerance {self.tolerance:.2g})"]
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
    weights: npt.ArrayLike | None = None,
    tolerance: float | None = None,
    time_limit: float = 60.0,
    callback: Callable[[float, str], None] | None = None,
) -> LimitsCertificate:
    """Check return and limits of a solution by following its policy.

    Args:
        solution: of `solve_limited`. policy: as written to a file; that of the solution by default.
        models: in which the limits are checked; those of the solution by default.
        tolerance: 1e-6 times the claimed values when None.
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
    shares = model.weights if weights is None else np.asarray(weights, dtype=np.float64)
    truths = list(models) or list(model.truths)
    limits = model.stated_limits
    todo = 1 + len(truths) * len(limits)
    deadline = began + time_limit
    walk = _Walk(own, pomdp, deadline, tolerance)
    low, high = walk.sum_rewards(shares)
    verdict: Any = _compare(low, high, solution.value - tolerance, solution.upper + tolerance)
    claim = f"claimed {solution.value:.8g}, at most {solution.upper:.8g}"
    checks = [Check("return", low, high, claim, verdict)]
    for m, truth in enumerate(truths):
        walk = _Walk(own, truth, deadline, tolerance)
        for k, limit in enumerate(limits):
            if callback is not None:
                callback(len(checks) / todo, limit.name)
            low, high = walk.sum_costs(limit, shares, model.factors[k])
            name = limit.name if len(truths) == 1 else f"{limit.name} in model {m + 1}"
            top = limit.bound + TOLERANCE * max(1.0, limit.bound)
            checks.append(
                Check(name, low, high, f"at most {limit.bound:g}", _compare(low, high, -np.inf, top))
            )
    return LimitsCertificate(tuple(checks), tolerance, monotonic() - began)


def _compare(low: float, high: float, least: float, most: float) -> Literal["confirmed", "refuted", "open"]:
    """Return whether a number between low and high is between least and most."""
    if high < least or low > most:
        return "refuted"
    return "confirmed" if least <= low and high <= most else "open"


class _Walk:
    """The joint probabilities of node and state under a policy in a model, step by step."""

    def __init__(self, policy: RandomisedPolicy, pomdp: Pomdp, deadline: float, tolerance: float) -> None:
        from scipy.sparse import csr_array

        self._policy, self._pomdp, self._deadline, self._tolerance = policy, pomdp, deadline, tolerance
        T, O = pomdp.transition, pomdp.observation  # noqa: E741
        S = len(pomdp.states)
        self._moves = [
            csr_array(
                (
                    T.values[T.action_slice(a)],
                    T.columns[T.action_slice(a)],
                    T.begins[a * S : a * S + S + 1] - T.begins[a * S],
                ),
                shape=(S, S),
            )
            for a in range(len(pomdp.actions))
        ]
        dense = [
            csr_array(
                (
                    O.values[O.action_slice(a)],
                    O.columns[O.action_slice(a)],
                    O.begins[a * S : a * S + S + 1] - O.begins[a * S],
                ),
                shape=(S, O.shape[2]),
            ).toarray()
            for a in range(len(pomdp.actions))
        ]
        # for each action the observations that it may have, and their likelihoods (S,)
        self._seen = [[(o, own[:, o].copy()) for o in np.flatnonzero(own.any(axis=0))] for own in dense]
        actions = policy.controller.actions
        self._nodes = [(a, np.flatnonzero(actions == a)) for a in np.unique(actions).tolist()]

    def sum_rewards(self, weights: Array) -> tuple[float, float]:
        """Return bounds on the return, discounted as the model."""
        pomdp = self._pomdp
        least, most = mdp_value_bounds(pomdp) if pomdp.discount < 1 else (None, None)
        joint = (self._policy.probabilities * weights[:, None]).T @ self._policy.starts  # (n, S)
        total, factor = 0.0, 1.0
        low = high = 0.0
        for step in range(MAX_STEPS):
            if least is not None and most is not None:
                mass = joint.sum(axis=0)
                low, high = factor * float(mass @ least), factor * float(mass @ most)
            else:
                earning = joint[:, (pomdp.reward != 0).any(axis=0)].sum()
                low = high = 0.0
                if earning > 0:
                    low, high = -np.inf, np.inf
            if high - low <= REST_SHARE * self._tolerance or self._is_late(step):
                break
            total += factor * float((joint * pomdp.reward[self._policy.controller.actions]).sum())
            joint, factor = self._move(joint), factor * pomdp.discount
        return total + low, total + high

    def sum_costs(self, limit: Limit, weights: Array, factors: Array) -> tuple[float, float]:
        """Return bounds on the cost or the probability of a limit; factors: (N, S) of the costs."""
        starts = self._policy.starts * factors
        joint = (self._policy.probabilities * weights[:, None]).T @ starts
        cost = limit.cost[self._policy.controller.actions]  # (n, S)
        if limit.kind != "probability":
            discount = self._pomdp.discount if limit.kind == "discounted" else 1.0
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

        It holds from each node and state; infinity if it is more than `MAX_HALF_LIFE`.
        """
        left, steps = possible.astype(np.float64), 0
        while left.max(initial=0.0) > 0.5:
            if steps == MAX_HALF_LIFE:
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

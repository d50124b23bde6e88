"""Comparison of a policy's vectors with what any policy of the model can earn."""

from __future__ import annotations

from math import inf

import numpy as np

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning.evaluation.mdp import bound_above
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.undiscounted import DiscountedForm
from lcorpp.values import Array

MAX_PRODUCTS = 2**27
"""Maximal number of multiplications for the bound, some tenths of a second."""

RELATIVE_TOLERANCE = 1e-5
"""Tolerance of a value, relative to it: other tools write six digits."""

ROUNDING = 1e-9
"""Rounding error of a value, relative to the largest value in the model."""


def check_claims(pomdp: Pomdp, policy: Policy, file: str, *, finite: bool = False) -> None:
    """Reject vectors that promise more than any policy earns, or less than the worst one does.

    A vector has the value of a plan for each initial state. The optimal value of the MDP, in which the state
    is observed, is at least that of every plan; the smallest reward in every step, or 0, where solvers begin,
    is at most that. The best vector of each state is compared with both: a low vector beside better ones
    changes nothing. Tables of one vector for each action (QMDP, FIB) may be lower, see `_lower_for_tables`.

    Args:
        file: of the policy, for messages.
        finite: whether the vectors may be those of a finite number of steps. `Policy.horizon` states it, too.

    Raises:
        PolicyError: a value is out of these bounds; the message names file, vector and state.
    """
    highest, lowest = _bound_values(pomdp, finite=finite or policy.horizon is not None)
    if policy.horizon is not None and pomdp.discount == 1:
        highest = np.minimum(highest, policy.horizon * max(0.0, float(pomdp.reward.max())))
        lowest = max(lowest, policy.horizon * min(0.0, float(pomdp.reward.min())))
    scale = max(abs(lowest), float(np.abs(highest).max()))
    scale = scale if scale < inf else 0.0
    if len(np.unique(policy.actions)) == len(policy) == len(pomdp.actions):
        lowest = _lower_for_tables(pomdp, highest, lowest)
    first = 1  # number of the first vector of a set, counted from 1
    for part in policy.vector_sets:
        best, bound = part.vectors.max(axis=0), highest[part.states]
        tolerance = RELATIVE_TOLERANCE * np.maximum(np.abs(best), np.where(bound < inf, np.abs(bound), 0.0))
        tolerance += ROUNDING * scale
        above, below = best - bound - tolerance, lowest - best - tolerance
        for excess, what in ((above, "no policy earns more than"), (below, "no policy earns less than")):
            state = int(excess.argmax())
            if excess[state] > 0:
                limit = bound[state] if excess is above else lowest
                raise PolicyError(
                    f"{file}: {_describe(pomdp, part, state, first)}, where {what} {limit:.6g};"
                    f" the rewards of {pomdp.file or 'the model'} are {pomdp.reward.min():g} to"
                    f" {pomdp.reward.max():g}, the discount {pomdp.discount:g}"
                )
        first += len(part.actions)


def _describe(pomdp: Pomdp, part: AlphaVectors, state: int, first: int) -> str:
    vector = int(part.vectors[:, state].argmax())
    return (
        f"vector {first + vector} of action {pomdp.actions[part.actions[vector]]!r} promises"
        f" {part.vectors[vector, state]:.6g} in state {pomdp.states[part.states[state]]!r}"
    )


def _lower_for_tables(pomdp: Pomdp, highest: Array, lowest: float) -> float:
    """Return the lower bound for a table Q(a, s) - c(s), proven to be a lower bound on its policy's value.

    c is at most the largest excess of Q over one step divided by 1 - gamma, and the excess at most gamma
    times the range of values (`lcorpp.planning.solvers.table_policy`).
    """
    if pomdp.discount == 1:
        return -inf
    return lowest - pomdp.discount / (1 - pomdp.discount) * (float(highest.max()) - lowest)


def _bound_values(pomdp: Pomdp, *, finite: bool) -> tuple[Array, float]:
    """Return (S,) an upper bound on the value of any policy, and a lower bound in all states.

    Both are infinite if the discount is 1 and a policy may never end.
    """
    if pomdp.discount < 1:
        highest = bound_above(pomdp, pomdp.reward, may_stop=finite, max_products=MAX_PRODUCTS)
        return highest, min(0.0, float(pomdp.reward.min()) / (1 - pomdp.discount))
    try:
        form = DiscountedForm.of(pomdp)
    except ModelError:
        return np.full(len(pomdp.states), inf), -inf
    values, lowest = _bound_values(form.pomdp, finite=finite)
    return form.weights * values, lowest * float(form.weights.max())

"""What the page shows of a belief: the values of the actions, what an answer changes, the policy's fan."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.planning import Policy
from lcorpp.planning.belief import observation_probabilities, update
from lcorpp.values import Array, Belief, freeze
from lcorpp.values.probabilities import MIN_BRANCH

GRID = 40
"""Steps of the triangular grid at which alpha vectors over three values are compared."""


def view_belief(domain: Domain, policy: Policy, belief: Belief) -> dict[str, Any]:
    """Return what the page shows of a belief (S,) before the action that the policy chooses there.

    A terminal belief, to which a question may lead in some models, has no action.
    """
    pomdp = domain.pomdp
    known = {
        "belief": list_belief(domain, belief),
        "shared": domain.marginal(belief).probabilities.tolist(),
    }
    if domain.is_terminal(belief):
        return known | {
            "action": None,
            "done": True,
            "report": None,
            "values": [],
            "outcomes": [],
            "fan": None,
        }
    chosen = policy.action(belief)
    action = pomdp.actions[chosen]
    reported = domain.reported_value(action)
    values, outcomes = list[tuple[str, float]](), list[dict[str, Any]]()
    for a, name in enumerate(pomdp.actions):
        value = float(belief @ pomdp.reward[a])
        for o, p in enumerate(observation_probabilities(pomdp, belief, a).tolist()):
            if p < MIN_BRANCH:
                continue
            after = update(pomdp, belief, a, o)
            if domain.is_terminal(after):
                continue
            future, following = policy.value_and_action(after)
            value += pomdp.discount * p * future
            if a == chosen and reported is None:
                outcomes.append(
                    {
                        "observation": pomdp.observations[o],
                        "probability": p,
                        "action": pomdp.actions[following],
                        "shared": domain.marginal(after).probabilities.tolist(),
                    }
                )
        values.append((name, value))
    values.sort(key=lambda pair: -pair[1])
    return known | {
        "action": action,
        "done": reported is not None,
        "report": None if reported is None else list(domain.reasoning.split(reported).values()),
        "values": [{"action": name, "value": value} for name, value in values],
        "outcomes": outcomes,
        "fan": draw_fan(domain, policy, belief),
    }


def list_belief(domain: Domain, belief: Belief) -> dict[str, float]:
    """Return the states of positive probability."""
    return {state: p for state, p in zip(domain.pomdp.states, belief.tolist(), strict=True) if p}


def draw_fan(domain: Domain, policy: Policy, belief: Belief) -> list[dict[str, Any]] | None:
    """Return the alpha vectors over the shared values that are best somewhere; None for other than 2 or 3.

    The planner's own variables have the distribution that they have in the belief, given each value.
    """
    corners = find_corners(domain, belief)
    if len(corners) not in (2, 3):
        return None
    heights, actions = evaluate_vectors(policy, corners)
    best = np.unique((make_grid(len(corners)) @ heights.T).argmax(axis=1))
    return [{"action": domain.pomdp.actions[actions[k]], "values": heights[k].tolist()} for k in best]


def find_corners(domain: Domain, belief: Belief) -> Array:
    """Return (V, S) the belief given each shared value; the initial one for a value of probability 0."""
    joint = domain.planning.state_values.T * belief
    totals = joint.sum(axis=1, keepdims=True)
    return np.where(totals > 0, joint / np.where(totals > 0, totals, 1), domain.planning.initial_states)


def evaluate_vectors(policy: Policy, corners: Array) -> tuple[Array, list[int]]:
    """Return the values (K, V) of the alpha vectors at the corners, and their actions.

    Vectors over some of the states alone are left out if the corners have others.
    """
    heights, actions = list[Array](), list[int]()
    needed = np.flatnonzero(corners.any(axis=0))
    for part in policy.vector_sets:
        if np.isin(needed, part.states).all():
            heights.append(part.vectors @ corners[:, part.states].T)
            actions += part.actions.tolist()
    return np.concatenate(heights), actions


def make_grid(n_values: int) -> Array:
    """Return (N, V) distributions over two or three values: 4000 on a line, or a triangle of `GRID` steps."""
    if n_values == 2:
        p = np.arange(4001) / 4000
        return freeze(np.stack([1 - p, p], axis=1))
    points = [(i, j, GRID - i - j) for i in range(GRID + 1) for j in range(GRID + 1 - i)]
    return freeze(np.array(points) / GRID)

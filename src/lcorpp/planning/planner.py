"""A policy and its model behind names: the planner of the decision loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import overload

import numpy as np

from lcorpp.errors import PolicyError
from lcorpp.planning.arguments import check_type
from lcorpp.planning.belief import update, update_many
from lcorpp.planning.policy import Policy, check_same_model
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Solution
from lcorpp.values import Array, Belief


class ModelPlanner:
    """The part that all planners of a known model share: its start belief, and the belief update by names."""

    pomdp: Pomdp

    @property
    def start(self) -> Belief:
        """(S,) the model's start belief."""
        return self.pomdp.start

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """Return the belief (S,) after a named action and observation.

        Raises:
            ModelError: a name is unknown.
            ObservationError: the observation is impossible.
        """
        pomdp = self.pomdp
        return update(pomdp, belief, pomdp.action_index(action), pomdp.observation_index(observation))

    def update_many(self, beliefs: Array, actions: Sequence[str], observations: Sequence[str]) -> Array:
        """Return the beliefs (n, S) after an action in each of n beliefs, and the observation there.

        They equal those of `update` up to rounding errors, faster. Errors are those of `update`.
        """
        action_index = {name: self.pomdp.action_index(name) for name in set(actions)}
        observation_index = {name: self.pomdp.observation_index(name) for name in set(observations)}
        done = np.array([action_index[name] for name in actions], np.intp)
        seen = np.array([observation_index[name] for name in observations], np.intp)
        return update_many(self.pomdp, beliefs, done, seen)


class Planner(ModelPlanner):
    """pi of Algorithm 2 (`lcorpp.protocols.Planner`): actions and observations by name.

        Planner(solve(pomdp))
        Planner(read_policy("tiger.policy", pomdp), pomdp)

    Args:
        policy: a solution, which contains its model, or a policy alone.
        pomdp: the model of a policy alone; for a solution, an equal model may replace its own.

    Raises:
        ModelError: an argument has a wrong type.
        PolicyError: the policy belongs to another model, or a policy alone has no model beside it.

    Examples:
        >>> from lcorpp import Planner, load_domain, solve
        >>> planner = Planner(solve(load_domain("intention").pomdp))
        >>> planner.action(planner.start)
        'move_forward'
        >>> belief = planner.update(planner.start, "move_forward", "pos")
        >>> planner.action(planner.update(belief, "move_forward", "pos"))
        'report_interested'
    """

    @overload
    def __init__(self, policy: Solution) -> None: ...
    @overload
    def __init__(self, policy: Policy, pomdp: Pomdp) -> None: ...
    def __init__(self, policy: Solution | Policy, pomdp: Pomdp | None = None) -> None:
        check_type("policy", policy, Solution, Policy)
        if isinstance(policy, Solution):
            pomdp = pomdp or policy.pomdp
            policy = policy.policy
        if pomdp is None:
            raise PolicyError("a planner for a policy needs its model: Planner(policy, pomdp)")
        check_same_model(pomdp, policy)
        self.pomdp, self.policy = pomdp, policy

    def __repr__(self) -> str:
        return f"<Planner {self.policy!r}>"

    def action(self, belief: Belief) -> str:
        """Return the name of the policy's action at a belief (S,)."""
        return self.pomdp.actions[self.policy.action(belief)]

    def actions_at(self, beliefs: Array) -> list[str]:
        """Return the name of the policy's action at each of n beliefs (n, S)."""
        return [self.pomdp.actions[action] for action in self.policy.actions_at(beliefs).tolist()]


class TransferPlanner(ModelPlanner):
    """A planner whose policy was computed for another model of the same states, actions and observations.

    The beliefs are those of the model; the policy acts on them as if its own model had led to them.

    Raises:
        PolicyError: states or actions have other names.
    """

    def __init__(self, policy: Policy, pomdp: Pomdp) -> None:
        check_same_model(pomdp, replace(policy, fingerprint=""))
        self.pomdp, self.policy = pomdp, policy

    def __repr__(self) -> str:
        return f"<TransferPlanner {self.policy!r}>"

    def action(self, belief: Belief) -> str:
        """Return the name of the policy's action at a belief (S,)."""
        return self.pomdp.actions[self.policy.action(belief)]

"""A model and a policy for it, behind names: what the decision loop talks to."""

from __future__ import annotations

from lcorpp.errors import PolicyError
from lcorpp.planning.belief import update
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Belief


class Planner:
    """pi of Algorithm 2 (`lcorpp.protocols.Planner`): actions and observations by name.

    Raises:
        PolicyError: the policy was made for another model.
    """

    def __init__(self, pomdp: Pomdp, policy: Policy) -> None:
        check_same_model(pomdp, policy)
        self.pomdp, self.policy = pomdp, policy

    @property
    def start(self) -> Belief:
        """(S,) the model's own start belief."""
        return self.pomdp.start

    def action(self, belief: Belief) -> str:
        """The name of the action to take at a belief (S,)."""
        return self.pomdp.actions[self.policy.action(belief)]

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """(S,) the belief after a named action and observation.

        Raises:
            ModelError: a name is unknown.
            ObservationError: the observation is impossible.
        """
        pomdp = self.pomdp
        return update(pomdp, belief, pomdp.action_index(action), pomdp.observation_index(observation))


def check_same_model(pomdp: Pomdp, policy: Policy) -> None:
    """Refuse a policy that was made for another model.

    Raises:
        PolicyError: names differ, or the fingerprint kept with the policy does.
    """
    if policy.state_names != pomdp.states or policy.action_names != pomdp.actions:
        raise PolicyError("the policy is for another model: its states or actions have other names")
    if policy.fingerprint and policy.fingerprint != pomdp.fingerprint:
        raise PolicyError(
            "the policy is for another model: names are the same, but its transitions, observations,"
            " rewards or discount have changed since; solve again"
        )

"""What is found for a given number of steps: what to do with each number of them to go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.policy import AlphaVectors, Policy, UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Belief


@dataclass(frozen=True, eq=False)
class FiniteSolution:
    """Policies for a number of steps, and what they are worth together.

    policies: the one with k steps to go is policies[k - 1]; its value is what is earned in those k steps.
    lower, upper: bounds on the optimal value with all steps to go, at the start belief; of several, at the
        one with the widest gap. The policies earn at least `lower`.
    seconds: wall-clock time used.
    reason: why it stopped: "precision reached", "time limit", "interrupted".
    history: (seconds, lower, upper, vectors) over time.
    """

    policies: tuple[Policy, ...]
    lower: float
    upper: float
    seconds: float
    reason: str
    history: tuple[tuple[float, float, float, int], ...]

    @property
    def horizon(self) -> int:
        """The number of steps."""
        return len(self.policies)

    def policy(self, to_go: int) -> Policy:
        """The policy with a number of steps to go.

        Raises:
            ModelError: there is none for so many.
        """
        if not 1 <= to_go <= self.horizon:
            raise ModelError(f"there are 1 to {self.horizon} steps to go, not {to_go}")
        return self.policies[to_go - 1]

    def action(self, belief: Belief, to_go: int) -> int:
        """Index of the action to take at a belief (S,) with a number of steps to go."""
        return self.policy(to_go).action(belief)

    def summary(self) -> str:
        """One line for people."""
        vectors = sum(len(policy) for policy in self.policies)
        return (
            f"{self.reason} after {self.seconds:.2f} s: value of {self.horizon} steps from the start in"
            f" [{self.lower:.6g}, {self.upper:.6g}], {vectors} vectors"
        )


def finite_policy(
    pomdp: Pomdp, pieces: Sequence[AlphaVectors], to_go: int, discount: float, above: UpperBound | None
) -> Policy:
    """A policy for a number of steps to go; what any plan earns in them at least is its floor."""
    floor = float(pomdp.reward.min()) * float((discount ** np.arange(to_go)).sum())
    names = pomdp.states, pomdp.actions
    return Policy(tuple(pieces), *names, pomdp.fingerprint, pomdp.file, floor, above)

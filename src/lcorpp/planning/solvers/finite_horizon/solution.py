"""Finite-horizon solution: one policy per number of remaining steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.policy import AlphaVectors, Policy, UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import describe_start
from lcorpp.values import Belief


@dataclass(frozen=True, eq=False, repr=False)
class FiniteHorizonSolution:
    """Policies for a number of steps, with bounds on their value.

    policies: policies[k - 1] is for k remaining steps; its value is the reward of those k steps.
    lower, upper: bounds on the optimal value of all steps at the start belief; of several, at the one with
        the widest gap. The policies earn at least `lower`.
    seconds: wall-clock time.
    reason: why the search stopped: "precision reached", "time limit", "interrupted".
    history: (seconds, lower, upper, vectors) over time.
    start_count: number of start beliefs.
    """

    policies: tuple[Policy, ...]
    lower: float
    upper: float
    seconds: float
    reason: str
    history: tuple[tuple[float, float, float, int], ...]
    start_count: int = 1

    def __repr__(self) -> str:
        return f"<FiniteHorizonSolution {self.summary()}>"

    @property
    def horizon(self) -> int:
        """The number of steps."""
        return len(self.policies)

    def policy(self, remaining: int) -> Policy:
        """Return the policy for a number of remaining steps.

        Raises:
            ModelError: the number is outside 1 to `horizon`.
        """
        if not 1 <= remaining <= self.horizon:
            raise ModelError(f"the number of remaining steps must be 1 to {self.horizon}, not {remaining}")
        return self.policies[remaining - 1]

    def action(self, belief: Belief, remaining: int) -> int:
        """Return the index of the action to take at a belief (S,) with a number of remaining steps."""
        return self.policy(remaining).action(belief)

    def summary(self) -> str:
        """Return the result in one line of text."""
        vectors = sum(len(policy) for policy in self.policies)
        return (
            f"{self.reason} after {self.seconds:.2f} s: value of {self.horizon} steps from"
            f" {describe_start(self.start_count)} in [{self.lower:.6g}, {self.upper:.6g}], {vectors} vectors"
        )


def make_finite_policy(
    pomdp: Pomdp, sets: Sequence[AlphaVectors], remaining: int, discount: float, upper: UpperBound | None
) -> Policy:
    """Make a policy for a number of remaining steps; its floor is the smallest reward in each of them."""
    floor = float(pomdp.reward.min()) * float((discount ** np.arange(remaining)).sum())
    names = pomdp.states, pomdp.actions
    return Policy(tuple(sets), *names, pomdp.fingerprint, pomdp.file, floor, upper, remaining)

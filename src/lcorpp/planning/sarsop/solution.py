"""What the solver hands back: a policy, how good it is, and how that came about."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.planning.policy import Policy
from lcorpp.planning.sarsop.upper import Sawtooth
from lcorpp.values import Belief


@dataclass(frozen=True)
class Progress:
    """The state of the search after a trial.

    seconds: since the call. lower, upper: bounds at the start belief. vectors, beliefs, trials: so far.
    """

    seconds: float
    lower: float
    upper: float
    vectors: int
    beliefs: int
    trials: int


@dataclass(frozen=True, eq=False)
class Solution:
    """A policy with its certificate.

    policy: earns at least `lower` from the start belief.
    lower, upper: bounds on the optimal value at the start belief; of several, at the one with the widest gap.
    seconds: wall-clock time used.
    reason: "precision reached", "time limit" or "interrupted".
    history: (seconds, lower, upper, vectors) before the first and after each trial.
    beliefs: nodes of the belief tree. trials: paths sampled.
    upper_bound: the upper bound at any belief.
    """

    policy: Policy
    lower: float
    upper: float
    seconds: float
    reason: str
    history: tuple[tuple[float, float, float, int], ...]
    beliefs: int
    trials: int
    upper_bound: Sawtooth

    @property
    def vectors(self) -> int:
        """The number of alpha vectors."""
        return len(self.policy.vectors)

    def gap(self, belief: Belief) -> float:
        """Upper minus lower bound at a belief (S,), in reward units: the most a new search could gain."""
        return max(0.0, self.upper_bound.value(belief) - self.policy.value(belief))

    def summary(self) -> str:
        """One line for people."""
        return (
            f"{self.reason} after {self.seconds:.2f} s: value at the start in"
            f" [{self.lower:.6g}, {self.upper:.6g}], {self.vectors} vectors, {self.beliefs} beliefs"
        )

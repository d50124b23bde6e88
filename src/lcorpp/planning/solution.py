"""What the solver hands back: a policy, how good it is, and how that came about."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.planning.policy import Policy
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
    reason: why it stopped: "precision reached", "time limit", "interrupted".
    history: (seconds, lower, upper, vectors) before the first trial and whenever a trial moved a bound.
    beliefs: nodes of the belief tree. trials: paths sampled.
    start: (S,) the belief that `lower` and `upper` are about; the model's own when None.
    """

    policy: Policy
    lower: float
    upper: float
    seconds: float
    reason: str
    history: tuple[tuple[float, float, float, int], ...]
    beliefs: int
    trials: int
    start: Belief | None = None

    @property
    def vectors(self) -> int:
        """The number of alpha vectors."""
        return len(self.policy)

    def gap(self, belief: Belief) -> float:
        """Upper minus lower bound at a belief (S,), in reward units: the most a new search could gain."""
        return self.policy.gap(belief)

    def summary(self) -> str:
        """One line for people."""
        return (
            f"{self.reason} after {self.seconds:.2f} s: value at the start in"
            f" [{self.lower:.6g}, {self.upper:.6g}], {self.vectors} vectors, {self.beliefs} beliefs"
        )

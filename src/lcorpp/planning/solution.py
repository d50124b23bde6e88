"""The result of a solver: a policy, bounds on the optimal value, and how the search ended."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.notebook import html_table
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Belief


@dataclass(frozen=True)
class Progress:
    """The state of a running search, as a solver passes it to its callback.

    seconds: wall-clock time since the call.
    lower, upper: bounds on the optimal value at the start belief, in reward units.
    vectors, beliefs, trials: their numbers so far, as in `Solution`.
    """

    seconds: float
    lower: float
    upper: float
    vectors: int
    beliefs: int
    trials: int


@dataclass(frozen=True, eq=False)
class Solution:
    """A policy for a POMDP with bounds on the optimal value. `Planner(solution)` acts on it.

    pomdp: the problem that was solved.
    policy: its expected discounted reward from the start belief is at least `lower`.
    lower, upper: bounds on the optimal value at the start belief; of several, at the one with the widest gap.
    seconds: wall-clock time.
    reason: why the search stopped: "precision reached", "time limit", "interrupted".
    history: (seconds, lower, upper, vectors) before the first trial and after each trial that moved a bound.
    beliefs: number of nodes of the belief tree.
    trials: number of sampled paths (trials) of SARSOP, of backups or steps of other solvers.
    start: (S,) the belief of `lower` and `upper`; the model's own when None.
    """

    pomdp: Pomdp
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
        """Return upper minus lower bound at a belief (S,), in reward units: the most a search can gain."""
        return self.policy.gap(belief)

    def summary(self) -> str:
        """Return the result in one line of text."""
        return (
            f"{self.reason} after {self.seconds:.2f} s: value at the start in"
            f" [{self.lower:.6g}, {self.upper:.6g}], {self.vectors} vectors, {self.beliefs} beliefs"
        )

    def __repr__(self) -> str:
        return f"<Solution {self.summary()}>"

    def _repr_html_(self) -> str:
        rows = [
            ("lower bound", f"{self.lower:.6g}"),
            ("upper bound", f"{self.upper:.6g}"),
            ("gap", f"{self.upper - self.lower:.3g}"),
            ("vectors", f"{self.vectors}"),
            ("beliefs", f"{self.beliefs}"),
            ("search", f"{self.reason} after {self.seconds:.2f} s"),
        ]
        return html_table(("solution", self.pomdp.file), rows)

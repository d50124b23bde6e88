"""The result of a solver: a policy, bounds on the optimal value, and how the search ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from operator import sub
from pathlib import Path
from time import monotonic

from lcorpp.notebook import html_table
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief

CONVERGED = "precision reached"
"""The reason of a solution whose bounds are as close as requested."""


@dataclass(frozen=True)
class Progress:
    """The state of a running search, as a solver passes it to its callback.

    seconds: wall-clock time since the call.
    lower, upper: bounds on the optimal value at the start belief, in reward units.
    vectors, beliefs, trials: their numbers so far, as in `Solution`.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> steps = []
        >>> solution = solve(load_domain("intention").pomdp, callback=steps.append)
        >>> steps[-1].lower == solution.lower, steps[-1].trials == solution.trials
        (True, True)
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
    reason: why the search stopped: "precision reached", "time limit", "memory limit", "interrupted".
    history: (seconds, lower, upper, vectors) before the first trial and after each trial that moved a bound.
    beliefs: number of nodes of the belief tree.
    trials: number of sampled paths (trials) of SARSOP, of backups or steps of other solvers.
    start: (S,) the belief of `lower` and `upper`; the model's own when None.
    start_count: number of start beliefs.
    solver: its name, if it was chosen by `SolverOptions`. cached: whether it is from the cache of policies.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> solution = solve(load_domain("intention").pomdp)
        >>> solution.converged, solution.gap(solution.pomdp.start) <= 5e-4
        (True, True)
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
    start_count: int = 1
    solver: str = ""
    cached: bool = False

    @property
    def converged(self) -> bool:
        """Whether the bounds are as close as requested."""
        return self.reason == CONVERGED

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
            f"{self.reason} after {self.seconds:.2f} s: value at {describe_start(self.start_count)} in"
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
            ("start beliefs", f"{self.start_count}{'; bounds at the widest gap' * (self.start_count > 1)}"),
            ("search", f"{self.reason} after {self.seconds:.2f} s"),
        ]
        return html_table(("quantity", "value"), rows, caption=f"Solution of {Path(self.pomdp.file).name}")


def describe_start(count: int) -> str:
    """Return the name of the belief to which reported bounds belong, of `count` start beliefs."""
    return "the start" if count == 1 else f"the start with the widest gap (of {count})"


class BoundsRecord:
    """The bounds of a running search at its start beliefs.

    starts: N beliefs (S,). began: start time on the monotonic clock.
    widest: index of the start with the widest gap. lower, upper: the bounds there.
    history: as in `Solution`.
    """

    def __init__(self, pomdp: Pomdp, starts: Sequence[Belief] | Array, began: float) -> None:
        self.pomdp, self.starts, self.began = pomdp, starts, began
        self.history: list[tuple[float, float, float, int]] = []
        self.widest, self.lower, self.upper = 0, -inf, inf

    @property
    def seconds(self) -> float:
        """Wall-clock seconds so far."""
        return monotonic() - self.began

    def update(
        self, lower: Sequence[float], upper: Sequence[float], vectors: int, *, tolerance: float = inf
    ) -> None:
        """Record the bounds (N,) at the starts.

        Args:
            tolerance: largest difference by which rounding may make them cross.
        """
        gaps = list(map(sub, upper, lower))  # N is small, numpy would be slow
        if min(gaps) < -tolerance:
            raise RuntimeError(f"the bounds cross by {-min(gaps)}; this is a bug in lcorpp")
        widest = gaps.index(max(gaps))
        low = lower[widest]
        high = max(low, upper[widest])
        if not self.history or low != self.lower or high != self.upper:
            self.history.append((self.seconds, low, high, vectors))
        self.widest, self.lower, self.upper = widest, low, high

    def make_progress(self, *, vectors: int, beliefs: int, trials: int) -> Progress:
        """Return the current state for a callback."""
        return Progress(self.seconds, self.lower, self.upper, vectors, beliefs, trials)

    def make_solution(self, policy: Policy, reason: str, *, beliefs: int, trials: int) -> Solution:
        """Return the result with the bounds of the last update."""
        return Solution(
            pomdp=self.pomdp,
            policy=policy,
            lower=self.lower,
            upper=self.upper,
            seconds=self.seconds,
            reason=reason,
            history=tuple(self.history),
            beliefs=beliefs,
            trials=trials,
            start=self.starts[self.widest],
            start_count=len(self.starts),
        )

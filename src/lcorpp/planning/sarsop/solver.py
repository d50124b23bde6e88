"""SARSOP: point-based value iteration on the beliefs that optimal policies reach.

Source: Kurniawati, Hsu and Lee, "SARSOP: Efficient point-based POMDP planning by approximating optimally
reachable belief spaces", RSS 2008, Algorithm 1.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import checked_belief
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.backup import backup
from lcorpp.planning.sarsop.bounds import blind_policies, fast_informed_bound, mdp_bound
from lcorpp.planning.sarsop.dynamics import Dynamics
from lcorpp.planning.sarsop.lower import AlphaVectors
from lcorpp.planning.sarsop.prediction import Prediction
from lcorpp.planning.sarsop.pruning import prune_points, prune_vectors
from lcorpp.planning.sarsop.sampling import sample
from lcorpp.planning.sarsop.solution import Progress, Solution
from lcorpp.planning.sarsop.tree import Node, Tree
from lcorpp.planning.sarsop.upper import Sawtooth

TRIAL_SHARE = 0.5
"""A trial aims at this share of the gap it finds: trials stay short while the gap is wide."""

MAX_DEPTH = 200
"""The longest trial. The bounds are valid at any length; what is missed is sampled by a later trial."""

INITIAL_SHARE = 0.2
"""Share of the time limit that the initial upper bound may take."""

DELTA = 1e-3
"""Radius of delta-dominance, in the space of beliefs."""

CAP = 3.0
"""Vectors kept by delta-dominance, as a multiple of those that are best somewhere."""

GROWTH = 1.3
"""Vectors are pruned when they are this many times those the last pruning left."""

SLACK = 1e-9
"""How far rounding may push the bounds past each other, as a share of the largest value in the model."""


def solve(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 5e-4,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find a policy and bounds on the optimal value with SARSOP.

    At the time limit, or at an interrupt from the keyboard, it returns the best so far.

    Args:
        pomdp: the problem.
        start: (S,) belief the policy is optimised for, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        callback: called after each trial.

    Returns:
        The policy, both bounds, the seconds used and why the search stopped.

    Raises:
        ModelError: `start` is not a distribution over the states, or precision or limit are not positive.

    Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 1.
    """
    if not precision > 0 or not time_limit > 0:
        raise ModelError(f"precision {precision} and time limit {time_limit} must be positive")
    given = np.atleast_2d(np.asarray(pomdp.start if start is None else start))
    search = _Search(pomdp, [checked_belief(pomdp, belief) for belief in given], precision, time_limit)
    try:
        reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    return search.solution(reason)


class _Search:
    """The state of one run: the tree with its two bounds, and the history."""

    def __init__(
        self, pomdp: Pomdp, starts: list[npt.NDArray[np.float64]], precision: float, limit: float
    ) -> None:
        self.began = monotonic()
        self.deadline = self.began + limit
        self.pomdp, self.precision = pomdp, precision
        dynamics = Dynamics(pomdp)
        blind = blind_policies(dynamics)
        informed = fast_informed_bound(
            dynamics,
            mdp_bound(dynamics),
            # a sweep changes at most tolerance * gamma / (1 - gamma) more after this
            tolerance=0.01 * precision * (1 - dynamics.discount),
            deadline=self.began + INITIAL_SHARE * limit,
        )
        self.scale = max(1.0, float(np.abs(blind).max()), float(np.abs(informed).max()))
        self.tree = Tree(dynamics, AlphaVectors(blind, np.arange(dynamics.actions)), Sawtooth(informed))
        self.prediction = Prediction(informed)
        self.roots = [self.tree.node(belief) for belief in starts]
        self.kept = len(blind)
        self.trials = 0
        self.history: list[tuple[float, float, float, int]] = []
        self.root = self._measure()

    def run(self, callback: Callable[[Progress], None] | None) -> str:
        """Sample and back up until a reason to stop; the reason."""
        while True:
            root = self.root
            if root.high - root.low <= self.precision:
                return "precision reached"
            if monotonic() >= self.deadline:
                return "time limit"
            self._trial(root)
            self._prune()
            self.trials += 1
            self.root = self._measure()
            if callback is not None:
                callback(self._progress())

    def _trial(self, root: Node) -> None:
        gap = root.high - root.low
        path = sample(
            self.tree,
            root,
            self.prediction,
            target=max(TRIAL_SHARE * gap, 0.5 * self.precision),
            depth=MAX_DEPTH,
            deadline=self.deadline,
            greedy_below=self.trials % 2 == 1,
        )
        for node in reversed(path):
            backup(self.tree, node, self.scale)
            if monotonic() >= self.deadline:
                break

    def _prune(self) -> None:
        if self.tree.alphas.count > GROWTH * self.kept + 32:
            prune_vectors(self.tree, self.roots, DELTA, CAP)
            self.kept = self.tree.alphas.count
        if len(self.tree.outdated) > 0.3 * self.tree.sawtooth.count + 32:
            prune_points(self.tree)

    def _measure(self) -> Node:
        """The start belief with the widest gap, its bounds as policy and points give them; also noted."""
        for root in self.roots:
            root.low = self.tree.alphas.value(root.belief)
            root.high = min(root.high, self.tree.sawtooth.value(root.belief))
            if root.low > root.high + SLACK * self.scale:
                raise RuntimeError(
                    f"the bounds have crossed: {root.low!r} > {root.high!r}; this is a bug in lcorpp"
                )
        widest = max(self.roots, key=lambda node: node.high - node.low)
        seconds = monotonic() - self.began
        self.history.append((seconds, widest.low, widest.high, self.tree.alphas.count))
        return widest

    def _progress(self) -> Progress:
        seconds, lower, upper, vectors = self.history[-1]
        return Progress(seconds, lower, upper, vectors, len(self.tree.nodes), self.trials)

    def solution(self, reason: str) -> Solution:
        """The best so far."""
        tree = self.tree
        root = self._measure()
        return Solution(
            policy=Policy.of(self.pomdp, tree.alphas.vectors, tree.alphas.actions),
            lower=root.low,
            upper=max(root.low, root.high),  # apart by rounding at most, as _measure has checked
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history),
            beliefs=len(tree.nodes),
            trials=self.trials,
            upper_bound=tree.sawtooth,
        )

"""SARSOP: point-based value iteration on the beliefs that optimal policies reach.

Source: Kurniawati, Hsu and Lee, "SARSOP: Efficient point-based POMDP planning by approximating optimally
reachable belief spaces", RSS 2008, Algorithm 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import Engine, Tree, engine, model_of
from lcorpp.planning.sarsop.upper_bound import SawtoothBound
from lcorpp.planning.solution import Progress, Solution
from lcorpp.values import Belief

LOOK_AHEAD = 10
"""A trial aims at the gap that this many steps of discounting would leave of the gap it finds: under a slow
discount a wider aim is met only far below the root, and the trial learns little for all its steps."""

MAX_DEPTH = 1000
"""The longest trial. The bounds are valid at any length; what is missed is sampled by a later trial."""

INITIAL_SHARE = 0.1
"""Share of the time limit that each of the initial bounds may take."""

DELTA = 1e-3
"""Radius of delta-dominance, in the space of beliefs."""

CAP = 3.0
"""Vectors kept by delta-dominance, as a multiple of those that are best somewhere."""

GROWTH = 1.3
"""Vectors are pruned when they are this many times those the last pruning left."""

SLACK = 1e-9
"""How far rounding may push the bounds past each other, as a share of the largest value in the model."""

Trial = Callable[..., int]
"""One path from a root and the backups along it, as `lcorpp.planning.sarsop.sampling.trial`."""


def solve(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 5e-4,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
    previous: Solution | None = None,
    trial: Trial | None = None,
    using: Engine | None = None,
) -> Solution:
    """Find a policy and bounds on the optimal value with SARSOP.

    At the time limit, or at an interrupt from the keyboard, it returns the best so far.

    Args:
        pomdp: the problem.
        start: (S,) belief the policy is optimised for, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        callback: called after each trial.
        previous: what was found for other starts of the same model. Its vectors and points hold anywhere, so
            that the search goes on from them, and ends at once where its gap is narrow enough already.
        trial: another search than SARSOP's, see `lcorpp.planning.sarsop.sampling`.
        using: the kernels; the compiled ones where they are, when None.

    Returns:
        The policy, both bounds, the seconds used and why the search stopped.

    Raises:
        ModelError: `start` is not a distribution over the states, or precision or limit are not positive.
        PolicyError: `previous` is for another model.

    Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 1.
    """
    if not precision > 0 or not time_limit > 0:
        raise ModelError(f"precision {precision} and time limit {time_limit} must be positive")
    if previous is not None and previous.policy.fingerprint != pomdp.fingerprint:
        raise PolicyError("the previous solution is for another model")
    given = np.atleast_2d(np.asarray(pomdp.start if start is None else start))
    starts = [check_belief(pomdp, belief) for belief in given]
    search = _Search(using or engine(), pomdp, starts, precision, time_limit, previous)
    try:
        reason = search.run(callback, trial)
    except KeyboardInterrupt:
        reason = "interrupted"
    return search.solution(reason)


class _Search:
    """The state of one run: the tree with its two bounds, and the history."""

    def __init__(
        self,
        kernels: Engine,
        pomdp: Pomdp,
        starts: Sequence[Belief],
        precision: float,
        limit: float,
        previous: Solution | None,
    ) -> None:
        self.began = monotonic()
        self.deadline = self.began + limit
        self.pomdp, self.precision = pomdp, precision
        model = model_of(kernels, pomdp)
        share = INITIAL_SHARE * limit
        blind = kernels.blind_policies(model, 1e-3 * precision, share)
        known = previous.policy.upper_bound if previous else None
        if isinstance(known, SawtoothBound):
            self.informed = known.informed
        else:
            fully_seen = kernels.mdp_bound(model, 1e-3 * precision, share)
            self.informed = kernels.fast_informed_bound(model, fully_seen, 1e-2 * precision, share)
        self.scale = max(1.0, float(np.abs(blind).max()), float(np.abs(self.informed).max()))
        self.tree: Tree = kernels.Tree(model, self.informed, blind)
        if previous is not None:
            self._take_over(previous)
        self.prediction = kernels.Prediction(self.informed.max(axis=0))
        self.roots = [self.tree.node(belief) for belief in starts]
        self.trials = 0
        self.history: list[tuple[float, float, float, int]] = []
        self.bounds = self._measure()

    def _take_over(self, previous: Solution) -> None:
        """Put the vectors and points of an earlier search into the tree."""
        held = [(self.tree.vectors(group), group) for group in range(self.tree.groups)]
        groups = {states.tobytes(): group for (states, _, actions), group in held if len(actions)}
        for piece in previous.policy.vector_sets:
            group = groups.get(piece.states.astype(np.int32).tobytes())
            if group is not None:
                self.tree.add_vectors(group, piece.vectors, piece.actions.astype(np.int32))
        known = previous.policy.upper_bound
        if isinstance(known, SawtoothBound):
            self.tree.add_points(*known.points())

    def run(self, callback: Callable[[Progress], None] | None, trial: Trial | None) -> str:
        """Sample and back up until a reason to stop; the reason."""
        aim = self.pomdp.discount**LOOK_AHEAD
        while True:
            root, low, high = self.bounds
            if high - low <= self.precision:
                return "precision reached"
            seconds = self.deadline - monotonic()
            if seconds <= 0:
                return "time limit"
            target = max(aim * (high - low), 0.5 * self.precision)
            # every other trial follows what is best in the lower bound
            arguments = self.prediction, root, target, MAX_DEPTH, seconds, self.trials % 2 == 1
            if trial is None:
                self.tree.trial(*arguments)
            else:
                trial(self.tree, *arguments)
            self.tree.prune(self.roots, DELTA, CAP, GROWTH)
            self.trials += 1
            self.bounds = self._measure()
            if callback is not None:
                callback(self._progress())

    def _measure(self) -> tuple[int, float, float]:
        """The start with the widest gap and its bounds, as vectors and points give them; also noted."""
        widest = (-1, 0.0, -np.inf)
        for root in self.roots:
            low, high = self.tree.lower_at(root), self.tree.upper_at(root)
            if low > high + SLACK * self.scale:
                raise RuntimeError(f"the bounds have crossed: {low!r} > {high!r}; this is a bug in lcorpp")
            if widest[0] < 0 or high - low > widest[2] - widest[1]:
                widest = root, low, max(low, high)  # apart by rounding at most, as was just checked
        _, low, high = widest
        if not self.history or (low, high) != self.history[-1][1:3]:
            self.history.append((monotonic() - self.began, low, high, self.tree.vector_count))
        return widest

    def _progress(self) -> Progress:
        _, low, high = self.bounds
        seconds = monotonic() - self.began
        return Progress(seconds, low, high, self.tree.vector_count, self.tree.node_count, self.trials)

    def solution(self, reason: str) -> Solution:
        """The best so far."""
        tree = self.tree
        widest, low, high = self._measure()
        for root in self.roots:  # a node may know more than the points say: so should the bound that is left
            belief = tree.belief(root)
            states = np.flatnonzero(belief).astype(np.int32)
            value = np.array([tree.upper_at(root)])
            tree.add_points(np.array([0, len(states)]), states, belief[states], value)
        pieces = []
        for group in range(tree.groups):
            states, vectors, actions = tree.vectors(group)
            # without those they go on with, the policy could earn less than its vectors promise
            table, first = tree.origins(group)
            table, first = np.concatenate([vectors, table]), np.concatenate([actions, first])
            if len(first):
                pieces.append(AlphaVectors(states.astype(np.intp), table, first.astype(np.intp)))
        above = SawtoothBound(self.informed, *tree.points())
        return Solution(
            pomdp=self.pomdp,
            policy=Policy.of_sets(self.pomdp, pieces, above),
            lower=low,
            upper=high,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history),
            beliefs=tree.node_count,
            trials=self.trials,
            start=tree.belief(widest),
        )

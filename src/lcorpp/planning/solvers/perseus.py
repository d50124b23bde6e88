"""Perseus: value iteration at beliefs met by chance, each backup serving as many of them as it can.

Source: Spaan and Vlassis, Perseus: randomized point-based value iteration for POMDPs, JAIR 2005.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.belief import observation_probabilities, update
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import engine, model_of
from lcorpp.planning.sarsop.upper_bound import SawtoothBound
from lcorpp.planning.solution import Progress, Solution
from lcorpp.planning.solvers.arguments import checked_count, checked_limits, checked_starts
from lcorpp.values import Array

INITIAL_SHARE = 0.1
"""Share of the time limit that each of the initial bounds may take."""

SLOW = 0.02
"""Beliefs are added after a stage that narrows the gap by less than this share of it."""

MOST_WALK = 100
"""The longest walk by chance from a start."""

MOST_IDLE = 2000
"""Steps in a row that meet no new belief before it is held that there is none."""

DELTA, CAP, GROWTH = 1e-3, 3.0, 1.3
"""When vectors are pruned, and which: see `lcorpp.planning.sarsop.solver`."""


def solve_perseus(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
    beliefs: int = 500,
    seed: int = 0,
) -> Solution:
    """Find a policy and bounds by randomised point-based value iteration.

    A set of beliefs is met by walking from the start at random. A stage goes through them in a random order
    and backs up those that no backup of the stage has made better yet. Stages go on until the bounds meet at
    the start. There are three departures from the paper: a backup serves at once and not in the next stage;
    it lowers an upper bound as well (the fast informed bound with the sawtooth interpolation, as in SARSOP);
    and whenever the bounds move slowly as many beliefs are added, met by walks that do what looks best, each
    more or less often, so that more time gives a better policy. At the time limit, or at an interrupt from
    the keyboard, it returns the best so far.

    Args:
        pomdp: the problem.
        start: (S,) belief the policy is optimised for, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        callback: called after each stage.
        beliefs: how many are met at first, and added at a time.
        seed: of the walks and orders, a whole number from 0.

    Returns:
        The policy, both bounds, the seconds used and why the search stopped: "all beliefs done" where no
        further one can be met and no backup gains any more. `trials` counts the backups.

    Raises:
        ModelError: `start` is not a distribution over the states, or a number is out of range.

    Source: Spaan and Vlassis, JAIR 2005, Table 1.
    """
    checked_limits(precision, time_limit)
    checked_count("beliefs", beliefs, 1)
    checked_count("seed", seed, 0)
    starts = checked_starts(pomdp, start)
    search = _Stages(pomdp, starts, precision, time_limit, np.random.default_rng(seed))
    try:
        reason = search.run(beliefs, callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    return search.solution(reason)


class _Stages:
    """The tree with its two bounds, and which of its nodes are backed up."""

    def __init__(
        self, pomdp: Pomdp, starts: Array, precision: float, limit: float, rng: np.random.Generator
    ) -> None:
        self.began = monotonic()
        self.deadline = self.began + limit
        self.pomdp, self.starts, self.precision, self.rng = pomdp, starts, precision, rng
        kernels, share = engine(), INITIAL_SHARE * limit
        model = model_of(kernels, pomdp)
        blind = kernels.blind_policies(model, 1e-3 * precision, share)
        fully_seen = kernels.mdp_bound(model, 1e-3 * precision, share)
        self.informed = kernels.fast_informed_bound(model, fully_seen, 1e-2 * precision, share)
        self.tree = kernels.Tree(model, self.informed, blind)
        self.roots = [self.tree.node(belief) for belief in starts]
        self.nodes = dict.fromkeys(self.roots)  # in the order they were met
        self.outcomes: dict[tuple[int, int], tuple[Array, dict[int, int]]] = {}
        self.backups = self.stages = 0
        self.history: list[tuple[float, float, float, int]] = []
        self._note()

    def run(self, beliefs: int, callback: Callable[[Progress], None] | None) -> str:
        """Go through stages until a reason to stop; the reason."""
        _, low, high = self._note()
        met = self._meet(beliefs, following=False)
        while high - low > self.precision:
            gained = self._stage()
            gap = high - low
            _, low, high = self._note()
            if callback is not None:
                seconds, vectors = self.history[-1][0], self.tree.vector_count
                callback(Progress(seconds, low, high, vectors, len(self.nodes), self.backups))
            if high - low <= self.precision:
                break
            if monotonic() >= self.deadline:
                return "time limit"
            # where no belief was left the last time, the policy must first have got as good as it gets
            if not gained or (met and gap - (high - low) < SLOW * gap):
                met = self._meet(beliefs, following=True)
                if not met and not gained:
                    return "all beliefs done"
        return "precision reached"

    def _stage(self) -> bool:
        """Back up beliefs in a random order unless another's backup made them better; whether one was.

        Every other stage passes over a belief only if both of its bounds were: a backup elsewhere moves the
        upper bound little.
        """
        tree, nodes = self.tree, list(self.nodes)
        before = [(tree.lower_at(node), tree.upper_at(node)) for node in nodes]
        enough = all if self.stages % 2 else any
        for k in self.rng.permutation(len(nodes)).tolist():
            if monotonic() >= self.deadline:
                break
            low, high = before[k]
            if not enough((tree.lower_at(nodes[k]) > low, tree.upper_at(nodes[k]) < high)):
                tree.backup(nodes[k])
                self.backups += 1
        self.stages += 1
        gained = any(
            tree.lower_at(node) > low or tree.upper_at(node) < high
            for node, (low, high) in zip(nodes, before, strict=True)
        )
        tree.prune(nodes, DELTA, CAP, GROWTH)
        return gained

    def _meet(self, count: int, *, following: bool) -> int:
        """Walk until `count` further beliefs are met, or no more are found; how many were.

        Args:
            following: whether walks do what looks best, each more or less often; otherwise any action alike.
        """
        before, steps, found, rng = len(self.nodes), 0, 0, self.rng
        while len(self.nodes) < before + count and steps - found < MOST_IDLE and monotonic() < self.deadline:
            node = self.roots[rng.integers(len(self.roots))]
            often, below = rng.random() if following else 0.0, bool(rng.integers(2))
            for _ in range(MOST_WALK):
                if rng.random() < often:
                    action = self.tree.look(node, below)
                else:
                    action = int(rng.integers(len(self.pomdp.actions)))
                node, steps = self._step(node, action), steps + 1
                if node not in self.nodes:
                    self.nodes[node], found = None, steps
                if len(self.nodes) >= before + count or rng.random() >= self.pomdp.discount:
                    break
        return len(self.nodes) - before

    def _step(self, node: int, action: int) -> int:
        """The node that an action and an observation by chance lead to."""
        sums, links = self.outcomes.get((node, action), (None, {}))
        if sums is None:
            chances = observation_probabilities(self.pomdp, self.tree.belief(node), action)
            sums = np.cumsum(chances)
            sums /= sums[-1]
            self.outcomes[node, action] = sums, links
        observation = int(np.searchsorted(sums, self.rng.random(), side="right"))
        if observation not in links:
            after = update(self.pomdp, self.tree.belief(node), action, observation)
            links[observation] = self.tree.node(after)
        return links[observation]

    def _note(self) -> tuple[int, float, float]:
        """The start where the bounds are furthest apart, and the bounds there."""
        tree = self.tree
        bounds = [(root, tree.lower_at(root), tree.upper_at(root)) for root in self.roots]
        widest, low, high = max(bounds, key=lambda bound: bound[2] - bound[1])
        self.history.append((monotonic() - self.began, low, max(low, high), tree.vector_count))
        return widest, low, max(low, high)

    def solution(self, reason: str) -> Solution:
        """The best so far."""
        tree = self.tree
        widest, low, high = self._note()
        for root in self.roots:  # a node may know more than the points: so should the bound that is left
            belief = tree.belief(root)
            states = np.flatnonzero(belief).astype(np.int32)
            value = np.array([tree.upper_at(root)])
            tree.add_points(np.array([0, len(states)]), states, belief[states], value)
        pieces = []
        for group in range(tree.groups):
            states, vectors, actions = tree.vectors(group)
            if len(actions):
                pieces.append(AlphaVectors(states.astype(np.intp), vectors, actions.astype(np.intp)))
        above = SawtoothBound(self.informed, *tree.points())
        return Solution(
            pomdp=self.pomdp,
            policy=Policy.of_sets(self.pomdp, pieces, above),
            lower=low,
            upper=high,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history[:-1]),
            beliefs=len(self.nodes),
            trials=self.backups,
            start=tree.belief(widest),
        )

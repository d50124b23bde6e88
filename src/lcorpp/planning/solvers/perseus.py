"""Perseus: value iteration at randomly collected beliefs, with backups that improve many of them at once.

Source: Spaan and Vlassis, Perseus: randomized point-based value iteration for POMDPs, JAIR 2005.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.any_discount import accept_undiscounted
from lcorpp.planning.arguments import check_count, check_solver_arguments
from lcorpp.planning.belief import observation_probabilities, update
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.bounded_search import BoundedSearch
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from lcorpp.planning.solution import Progress, Solution
from lcorpp.values import Array

INITIAL_SHARE = 0.1
"""Share of the time limit for each of the initial bounds."""

MIN_PROGRESS = 0.02
"""Beliefs are added after a stage that narrows the gap by less than this share of it."""

MAX_WALK = 100
"""Largest number of steps of a random walk."""

MAX_IDLE = 2000
"""Collection ends after this many consecutive steps without a new belief."""


@accept_undiscounted
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

    Random walks from the start collect a set of beliefs. A stage visits them in a random order and backs up
    those that no backup of the stage has improved yet. Stages are repeated until the bounds meet at the
    start. There are three departures from the paper: a backup takes effect at once instead of in the next
    stage; it also lowers an upper bound (the fast informed bound with the sawtooth interpolation, as in
    SARSOP); and whenever the bounds move slowly, as many beliefs are added, from walks that follow the
    current policy more or less often, so that more time gives a better policy. At the time limit or after
    Ctrl-C, the result is the best policy so far.

    Args:
        pomdp: the problem.
        start: (S,) belief for which the policy is optimised, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        callback: called after each stage.
        beliefs: how many beliefs are collected at first, and added each time.
        seed: of the walks and orders, an integer of at least 0.

    Returns:
        The policy, both bounds, the seconds used and why the search stopped: "all beliefs done" if no new
        belief can be collected and no backup improves a bound. `trials` counts the backups.

    Raises:
        ModelError: `start` is not a distribution over the states, or a number is out of range.

    Source: Spaan and Vlassis, JAIR 2005, Table 1.
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    check_count("beliefs", beliefs, 1)
    check_count("seed", seed, 0)
    began = monotonic()
    bounds = BoundedTree(pomdp, list(starts), precision=precision, seconds=INITIAL_SHARE * time_limit)
    search = BoundedSearch(bounds, starts, precision=precision, began=began, time_limit=time_limit)
    backups = _PointBasedBackups(search, beliefs, np.random.default_rng(seed))
    return search.make_solution(search.run(backups.step, callback))


class _PointBasedBackups:
    """The collected beliefs, as nodes of the search's tree, and the stages of backups at them."""

    def __init__(self, search: BoundedSearch, beliefs: int, rng: np.random.Generator) -> None:
        self.search, self.tree, self.pomdp = search, search.bounds.tree, search.bounds.pomdp
        self.beliefs, self.rng = beliefs, rng
        self.nodes = dict.fromkeys(search.roots)  # in order of collection
        self.successors: dict[tuple[int, int], tuple[Array, dict[int, int]]] = {}
        self.stages = self.added = 0
        self.improved, self.last_gap = False, np.inf

    def step(self) -> str | None:
        """Add beliefs if necessary and run a stage; return the reason to stop if neither helps."""
        if self.stages == 0:
            self.added = self._collect(use_policy=False)
        # if the last collection found no belief, the policy must first become as good as it can at the others
        elif not self.improved or (
            self.added and self.last_gap - self.search.gap < MIN_PROGRESS * self.last_gap
        ):
            self.added = self._collect(use_policy=True)
            if not self.added and not self.improved:
                return "all beliefs done"
        self.last_gap = self.search.gap
        self.improved = self._run_stage()
        return None

    def _run_stage(self) -> bool:
        """Back up beliefs in a random order, except those that an earlier backup improved.

        Return whether a bound improved. Every second stage skips a belief only if both of its
        bounds were improved, because a backup elsewhere moves the upper bound little.
        """
        tree, nodes = self.tree, list(self.nodes)
        before = [(tree.lower_bound(node), tree.upper_bound(node)) for node in nodes]
        enough = all if self.stages % 2 else any
        for k in self.rng.permutation(len(nodes)).tolist():
            if self.search.seconds_left <= 0:
                break
            low, high = before[k]
            if not enough((tree.lower_bound(nodes[k]) > low, tree.upper_bound(nodes[k]) < high)):
                tree.backup(nodes[k])
                self.search.trials += 1
        self.stages += 1
        improved = any(
            tree.lower_bound(node) > low or tree.upper_bound(node) < high
            for node, (low, high) in zip(nodes, before, strict=True)
        )
        self.search.prune(nodes)
        return improved

    def _collect(self, *, use_policy: bool) -> int:
        """Collect up to `beliefs` new beliefs on random walks; return their number.

        Args:
            use_policy: whether a walk takes the best action with a probability that is drawn for each walk.
                Otherwise all actions are random.
        """
        before, steps, last_new, rng = len(self.nodes), 0, 0, self.rng
        wanted = before + self.beliefs
        while len(self.nodes) < wanted and steps - last_new < MAX_IDLE and self.search.seconds_left > 0:
            node = self.search.roots[rng.integers(len(self.search.roots))]
            share, use_lower_bound = rng.random() if use_policy else 0.0, bool(rng.integers(2))
            for _ in range(MAX_WALK):
                if rng.random() < share:
                    action = self.tree.select_action(node, use_lower_bound)
                else:
                    action = int(rng.integers(len(self.pomdp.actions)))
                node, steps = self._sample_successor(node, action), steps + 1
                if node not in self.nodes:
                    self.nodes[node], last_new = None, steps
                if len(self.nodes) >= wanted or rng.random() >= self.pomdp.discount:
                    break
        return len(self.nodes) - before

    def _sample_successor(self, node: int, action: int) -> int:
        """Return the node after an action and a random observation."""
        sums, links = self.successors.get((node, action), (None, {}))
        if sums is None:
            probabilities = observation_probabilities(self.pomdp, self.tree.belief(node), action)
            sums = np.cumsum(probabilities)
            sums /= sums[-1]
            self.successors[node, action] = sums, links
        observation = int(np.searchsorted(sums, self.rng.random(), side="right"))
        if observation not in links:
            after = update(self.pomdp, self.tree.belief(node), action, observation)
            links[observation] = self.tree.find_or_add_node(after)
        return links[observation]

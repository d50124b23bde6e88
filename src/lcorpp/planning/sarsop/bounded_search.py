"""Search with bounds: the loop and the result that SARSOP, Perseus and the online planner share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import monotonic

import numpy as np

from lcorpp.interrupts import delay_sigint
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from lcorpp.planning.solution import BoundsRecord, Progress, Solution
from lcorpp.values import Belief

WORK_PER_TRIAL = 1000
"""Work of a trial beside that for the vectors; a trial of few vectors takes some 50 microseconds."""

PRUNING_RADIUS = 1e-3
"""Radius of delta-dominance, in the space of beliefs."""

PRUNING_RATIO = 3.0
"""Pruning keeps at most this many times the vectors that are best at a belief."""

PRUNING_GROWTH = 1.3
"""Vectors are pruned if there are this many times those after the last pruning."""

COMPRESSION_GROWTH = 0.5
"""The vectors are compressed when this share of those made until the last attempt has been added."""

MIN_BACKUPS = 100
"""Vectors made before the first attempt to compress them, and beside the growth before others."""

EVALUATIONS_PER_BACKUP = 20
"""Vectors that an attempt may compute for each vector made since the last one; about a tenth of its time."""

MAX_KEPT_SHARE = 0.75
"""Maximal share of the memory limit that is in use after nodes and points have been removed."""

CROSSING_TOLERANCE = 1e-9
"""Largest difference by which rounding may make the bounds cross, relative to the largest value."""

EPSILON = 4e-16
"""Rounding error of a number. The initial bounds begin at the largest reward over 1 - discount, and each
sweep multiplies the change of a value, hence its error, by 1 / (1 - discount)."""

SampleFunction = Callable[..., int]
"""Takes the tree and the arguments of `lcorpp.planning._native.Tree.sample`, and has its result."""


class BoundedSearch:
    """One search from some start beliefs: limits, loop and result.

    Args:
        bounds: the tree, which the search improves.
        precision: stop when upper - lower is at most this at every root, in reward units.
        began: start time on the monotonic clock. time_limit: wall-clock seconds from `began`.

    roots: the nodes of the start beliefs.
    record: of the bounds at the roots that were added last. trials: steps so far, in the unit of the solver.
    work: summed over the sampled paths so far: the numbers in all vectors, what pruning compares, and a
        constant; time grows with it.
    """

    def __init__(
        self,
        bounds: BoundedTree,
        starts: Iterable[Belief],
        *,
        precision: float,
        began: float,
        time_limit: float,
    ) -> None:
        self.bounds, self.precision = bounds, precision
        self._began, self._deadline = began, began + time_limit
        largest, ahead = float(np.abs(bounds.pomdp.reward).max()), 1 / (1 - bounds.pomdp.discount)
        self._tolerance = CROSSING_TOLERANCE * bounds.max_abs_value + EPSILON * largest * ahead**2
        self.roots, self.trials, self.work = list[int](), 0, 0
        self._aims = self.roots
        self._compressed_at, self._patience = 0, 1
        self.record = BoundsRecord(bounds.pomdp, [], began)
        self.add_starts(starts)

    def add_starts(self, starts: Iterable[Belief]) -> None:
        """Aim the next steps at these beliefs; the bounds that were reached at earlier ones remain."""
        added = [self.bounds.tree.find_or_add_node(belief) for belief in starts]
        self.roots = [*self.roots, *added]
        self._aim(added)

    @property
    def gap(self) -> float:
        """The widest gap between the bounds at a root, in reward units."""
        return self.record.upper - self.record.lower

    @property
    def widest(self) -> int:
        """The root with the widest gap."""
        return self._aims[self.record.widest]

    @property
    def seconds_left(self) -> float:
        """Wall-clock seconds to the time limit, negative after it."""
        return self._deadline - monotonic()

    def run(self, step: Callable[[], str | None], callback: Callable[[Progress], None] | None = None) -> str:
        """Repeat a step until the bounds meet, time is up or the user interrupts.

        Args:
            step: improves the bounds, or returns a reason to stop.
            callback: called after each step.

        Returns:
            Why the search stopped: "precision reached", "time limit", "interrupted" or the step's reason.
        """
        try:
            while True:
                if self.gap <= self.precision:
                    return "precision reached"
                if self.seconds_left <= 0:
                    return "time limit"
                reason = step()
                if reason is not None:
                    return reason
                self.refresh_record()
                if callback is not None:
                    tree = self.bounds.tree
                    callback(
                        self.record.make_progress(
                            vectors=tree.vector_count, beliefs=tree.node_count, trials=self.trials
                        )
                    )
        except KeyboardInterrupt:
            return "interrupted"

    def refresh_record(self) -> None:
        """Record the bounds at the roots that the search aims at."""
        tree, roots = self.bounds.tree, self._aims
        lower = [tree.lower_bound(root) for root in roots]
        upper = [tree.upper_bound(root) for root in roots]
        self.record.update(lower, upper, tree.vector_count, tolerance=self._tolerance)

    def sample(self, share: float, max_depth: int, function: SampleFunction | None = None) -> int:
        """Sample one path from the root with the widest gap and prune; return the number of its nodes.

        Every second path follows the lower instead of the upper bound.

        Args:
            share: of the gap; the path aims at a gap of this size.
            max_depth: largest number of nodes on the path.
            function: samples the path instead of `Tree.sample`.
        """
        tree = self.bounds.tree
        target = max(share * self.gap, 0.5 * self.precision)  # a smaller gap is never needed
        use_lower_bound = self.trials % 2 == 1
        arguments = self.bounds.predictor, self.widest, target, max_depth, self.seconds_left, use_lower_bound
        nodes = tree.sample(*arguments) if function is None else function(tree, *arguments)
        self.prune(self.roots)
        self.trials += 1
        vectors = tree.vector_count
        self.work += WORK_PER_TRIAL + vectors * (len(self.bounds.pomdp.states) + vectors // 20)
        return nodes

    def search_graph(self, share: float, max_work: float) -> int:
        """Lower the upper bound at the root with the widest gap by the graph; return the expansions.

        Args:
            share: of the gap, at which each trial aims.
            max_work: the trials end after about this work of the tree.
        """
        tree, target = self.bounds.tree, 0.5 * self.precision
        expanded = tree.search_graph(self.widest, share, target, int(max_work), max(0.0, self.seconds_left))
        self.refresh_record()
        return expanded

    def prune(self, roots: list[int]) -> None:
        """Drop vectors that are useless at the beliefs that the roots reach."""
        self.bounds.tree.prune(roots, PRUNING_RADIUS, PRUNING_RATIO, PRUNING_GROWTH)

    def compress(self, memory_limit: float) -> None:
        """From time to time, replace the vectors by those of a smaller controller as good at the roots.

        An attempt without success doubles the time to the next one.
        """
        made = self.bounds.tree.made_count - self._compressed_at
        if made >= COMPRESSION_GROWTH * self._patience * self._compressed_at + MIN_BACKUPS:
            is_better = self.compress_now(self.seconds_left, memory_limit)
            self._patience = 1 if is_better else 2 * self._patience

    def compress_now(self, seconds: float, memory_limit: float) -> bool:
        """Compress within wall-clock seconds and a limit in bytes; return whether vectors were replaced."""
        tree = self.bounds.tree
        max_evaluations = EVALUATIONS_PER_BACKUP * (tree.made_count - self._compressed_at)
        # vectors are copied
        is_possible = self.bounds.memory_size + tree.bound_memory <= memory_limit
        is_better = is_possible and tree.compress(self.roots, max_evaluations, seconds)
        self._compressed_at = tree.made_count
        return is_better

    def limit_memory(self, limit: float) -> bool:
        """Prune, and remove all nodes but the roots, if the memory exceeds a limit in bytes.

        If the memory is still above `MAX_KEPT_SHARE` of the limit, the older half of the points is removed;
        the points of the roots are new, so the bounds there do not change.

        Returns:
            Whether the memory is above this share even then, so that the search must end.
        """
        bounds = self.bounds
        if bounds.memory_size <= limit:
            return False
        aims = [self.roots.index(root) for root in self._aims]
        beliefs = [bounds.tree.belief(root) for root in self.roots]
        bounds.tree.prune(self.roots, PRUNING_RADIUS, 1.0, 0.0)  # only the best vectors remain
        bounds.add_points(self.roots)
        with delay_sigint():  # the result needs the nodes of the starts
            bounds.tree.clear_nodes()
            self.roots = [bounds.tree.find_or_add_node(belief) for belief in beliefs]
            self._aims = [self.roots[number] for number in aims]
        if bounds.memory_size > MAX_KEPT_SHARE * limit:
            bounds.tree.drop_older_points()
        return bounds.memory_size > MAX_KEPT_SHARE * limit

    def make_solution(self, reason: str) -> Solution:
        """Return the result after the search stopped for a reason."""
        if len(self._aims) < len(self.roots):
            self._aim(self.roots)
        self.refresh_record()
        return self.record.make_solution(
            self.bounds.make_policy(self.roots),
            reason,
            beliefs=self.bounds.tree.node_count,
            trials=self.trials,
        )

    def _aim(self, roots: list[int]) -> None:
        """Record the bounds at these roots from now on."""
        history, self._aims = self.record.history, roots
        beliefs = [self.bounds.tree.belief(root) for root in roots]
        self.record = BoundsRecord(self.bounds.pomdp, beliefs, self._began)
        self.record.history = history
        self.refresh_record()

"""Search with bounds: the tree, the loop and the result that SARSOP, Perseus and the online planner share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from time import monotonic

import numpy as np

from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernel_protocols import Kernels, Model, Tree
from lcorpp.planning.sarsop.kernels import build_model, load_kernels
from lcorpp.planning.sarsop.reachable_blocks import ReachableBlocks
from lcorpp.planning.solution import BoundsRecord, Progress, Solution
from lcorpp.planning.upper_bounds import SawtoothBound
from lcorpp.values import Belief

WORK_PER_TRIAL = 1000
"""Work of a trial beside that for the vectors; a trial of few vectors takes some 50 microseconds."""

PRUNING_RADIUS = 1e-3
"""Radius of delta-dominance, in the space of beliefs."""

PRUNING_RATIO = 3.0
"""Pruning keeps at most this many times the vectors that are best at a belief."""

PRUNING_GROWTH = 1.3
"""Vectors are pruned if there are this many times those after the last pruning."""

MAX_KEPT_SHARE = 0.75
"""The largest share of the memory limit that a search has in use when it goes on."""

CROSSING_TOLERANCE = 1e-9
"""Largest difference by which rounding may make the bounds cross, relative to the largest value."""

SampleFunction = Callable[..., int]
"""Has the parameters and the result of `lcorpp.planning.sarsop.path_sampling.sample`."""


class BoundedTree:
    """A belief tree of a problem with a lower and an upper bound, for one or more searches.

    Args:
        starts: beliefs (S,) from which all searches start, or whose mixtures they start from.
        precision: of the searches, in reward units.
        seconds: wall-clock time limit of each of the three initial bounds.
        kernels: the best installed ones when None.
        previous: a policy for the same model whose vectors and points are imported.

    tree: the nodes and bounds. predictor: of the values of nodes. informed: (A, S) the fast informed bound.
    max_abs_value: the largest absolute initial bound, at least 1: the unit of rounding errors.
    """

    def __init__(
        self,
        pomdp: Pomdp,
        starts: Sequence[Belief],
        *,
        precision: float,
        seconds: float,
        kernels: Kernels | None = None,
        previous: Policy | None = None,
    ) -> None:
        self.pomdp = pomdp
        self._kernels = kernels or load_kernels()
        self._model, self._blocks = self._build_model(starts)
        self._blind = self._kernels.blind_policies(self._model, 1e-3 * precision, seconds)
        upper = previous.upper_bound if previous else None
        if isinstance(upper, SawtoothBound):
            self.informed = upper.informed
        else:
            mdp = self._kernels.mdp_bound(self._model, 1e-3 * precision, seconds)
            self.informed = self._kernels.fast_informed_bound(self._model, mdp, 1e-2 * precision, seconds)
        self.max_abs_value = max(1.0, float(np.abs(self._blind).max()), float(np.abs(self.informed).max()))
        self.predictor = self._kernels.ValuePredictor(self.informed.max(axis=0))
        self.tree = self._make_tree(previous)

    @property
    def memory_size(self) -> int:
        """Memory in bytes: of the problem, for Python and the kernels, of the beliefs, and of the vectors and
        points, which a policy has a second time."""
        return 2 * self.pomdp.memory_size + self.tree.node_memory + 2 * self.tree.bound_memory

    def reset(self) -> None:
        """Forget all beliefs, but keep the vectors and points."""
        self.tree = self._make_tree(self.make_policy())

    def include(self, start: Belief) -> None:
        """Allow searches from another start (S,), which may forget all beliefs."""
        if self._blocks is not None and not self._blocks.cover(start):
            policy = self.make_policy()
            self._model, self._blocks = self._build_model([start])
            self.tree = self._make_tree(policy)

    def add_points(self, nodes: Iterable[int]) -> None:
        """Add the upper bounds of nodes, often below the interpolation of the points, to the points."""
        for node in nodes:
            belief = self.tree.belief(node)
            states = np.flatnonzero(belief).astype(np.int32)
            value = np.array([self.tree.upper_bound(node)])
            self.tree.add_points(np.array([0, len(states)]), states, belief[states], value)

    def make_policy(self) -> Policy:
        """Return the policy of the alpha vectors, with its upper bound."""
        tree, sets = self.tree, []
        for group in range(tree.group_count):
            states, vectors, actions = tree.vectors(group)
            # without the vectors that these depend on, the policy could earn less than its vectors promise
            pruned, pruned_actions = tree.dependencies(group)
            table, actions = np.concatenate([vectors, pruned]), np.concatenate([actions, pruned_actions])
            if not len(actions):
                continue
            parts = [states.astype(np.intp)]
            if (
                self._blocks is not None and group == tree.group_count - 1
            ):  # elsewhere the vectors are invalid
                parts = self._blocks.find_spread_sets(self._model)
            for part in parts:
                values = table if len(part) == len(states) else table[:, part]
                sets.append(AlphaVectors(part, values, actions.astype(np.intp)))
        points = tree.points()
        for array in points:
            array.setflags(write=False)
        return Policy.of_sets(self.pomdp, sets, SawtoothBound(self.informed, *points))

    def _build_model(self, starts: Sequence[Belief]) -> tuple[Model, ReachableBlocks | None]:
        """Return the problem for the kernels, and the blocks of its states if they depend on the starts."""
        model = build_model(self._kernels, self.pomdp)
        blocks = ReachableBlocks.find(self._kernels, model, starts)
        if blocks is None:
            return model, None
        del model  # a large model is in memory only once
        return build_model(self._kernels, self.pomdp, blocks.refine(self.pomdp.observation)), blocks

    def _make_tree(self, previous: Policy | None) -> Tree:
        """Return a tree without nodes, with the vectors and points of an earlier policy.

        A group takes the vectors over sets that contain its states. A group without vectors is never used:
        the model has a single block, and its beliefs are in that.
        """
        tree = self._kernels.Tree(self._model, self.informed, self._blind)
        if previous is None:
            return tree
        groups = [(group, *tree.vectors(group)[::2]) for group in range(tree.group_count)]
        position = np.empty(len(self.pomdp.states), dtype=np.intp)
        for vectors in previous.vector_sets:
            position[:] = -1
            position[vectors.states] = np.arange(len(vectors.states))
            for group, states, actions in groups:
                if len(actions) and position[states[0]] >= 0 and (columns := position[states]).min() >= 0:
                    tree.add_vectors(group, vectors.vectors[:, columns], vectors.actions.astype(np.int32))
        if isinstance(previous.upper_bound, SawtoothBound):
            tree.add_points(*previous.upper_bound.points())
        return tree


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
        self._tolerance = CROSSING_TOLERANCE * bounds.max_abs_value
        self.roots, self.trials, self.work = list[int](), 0, 0
        self._aims = self.roots
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
                self._update_record()
                if callback is not None:
                    tree = self.bounds.tree
                    callback(
                        self.record.make_progress(
                            vectors=tree.vector_count, beliefs=tree.node_count, trials=self.trials
                        )
                    )
        except KeyboardInterrupt:
            return "interrupted"

    def sample(self, share: float, max_depth: int, function: SampleFunction | None = None) -> None:
        """Sample one path from the root with the widest gap and prune.

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
        if function is None:
            tree.sample(*arguments)
        else:
            function(tree, *arguments)
        self.prune(self.roots)
        self.trials += 1
        vectors = tree.vector_count
        self.work += WORK_PER_TRIAL + vectors * (len(self.bounds.pomdp.states) + vectors // 20)

    def prune(self, roots: list[int]) -> None:
        """Drop vectors that are useless at the beliefs that the roots reach."""
        self.bounds.tree.prune(roots, PRUNING_RADIUS, PRUNING_RATIO, PRUNING_GROWTH)

    def limit_memory(self, limit: float) -> bool:
        """Forget all beliefs but the starts if the memory exceeds a limit in bytes, and prune.

        The points that no backup has lowered for long are dropped, too, if that is not enough; those of the
        starts are new, so the bounds there remain. Return whether the search cannot go on for all that.
        """
        bounds = self.bounds
        if bounds.memory_size <= limit:
            return False
        aims = [self.roots.index(root) for root in self._aims]
        beliefs = [bounds.tree.belief(root) for root in self.roots]
        bounds.tree.prune(self.roots, PRUNING_RADIUS, 1.0, 0.0)  # only the best vectors remain
        bounds.add_points(self.roots)
        bounds.tree.forget_nodes()
        self.roots = [bounds.tree.find_or_add_node(belief) for belief in beliefs]
        self._aims = [self.roots[number] for number in aims]
        if bounds.memory_size > MAX_KEPT_SHARE * limit:
            bounds.tree.drop_older_points()
        return bounds.memory_size > MAX_KEPT_SHARE * limit

    def make_solution(self, reason: str) -> Solution:
        """Return the result after the search stopped for a reason."""
        if len(self._aims) < len(self.roots):
            self._aim(self.roots)
        self._update_record()
        self.bounds.add_points(self.roots)
        return self.record.make_solution(
            self.bounds.make_policy(), reason, beliefs=self.bounds.tree.node_count, trials=self.trials
        )

    def _aim(self, roots: list[int]) -> None:
        """Record the bounds at these roots from now on."""
        history, self._aims = self.record.history, roots
        beliefs = [self.bounds.tree.belief(root) for root in roots]
        self.record = BoundsRecord(self.bounds.pomdp, beliefs, self._began)
        self.record.history = history
        self._update_record()

    def _update_record(self) -> None:
        """Record the bounds at the roots that the search aims at."""
        tree, roots = self.bounds.tree, self._aims
        lower = [tree.lower_bound(root) for root in roots]
        upper = [tree.upper_bound(root) for root in roots]
        self.record.update(lower, upper, tree.vector_count, tolerance=self._tolerance)

"""Search with bounds: the tree, the loop and the result that SARSOP, Perseus and the online planner share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import monotonic

import numpy as np

from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernel_protocols import Kernels, Tree
from lcorpp.planning.sarsop.kernels import build_model, load_kernels
from lcorpp.planning.sarsop.upper_bound import SawtoothBound
from lcorpp.planning.solution import Progress, Solution
from lcorpp.values import Belief

PRUNING_RADIUS = 1e-3
"""Radius of delta-dominance, in the space of beliefs."""

PRUNING_RATIO = 3.0
"""Pruning keeps at most this many times the vectors that are best at a belief."""

PRUNING_GROWTH = 1.3
"""Vectors are pruned if there are this many times those after the last pruning."""

CROSSING_TOLERANCE = 1e-9
"""Largest difference by which rounding may make the bounds cross, relative to the largest value."""

SampleFunction = Callable[..., int]
"""Samples one path and backs up its nodes, as `lcorpp.planning.sarsop.path_sampling.sample`."""


class BoundedTree:
    """A belief tree of a problem with a lower and an upper bound, for one or more searches.

    tree: the nodes and bounds. predictor: of the values of nodes.
    informed: (A, S) the fast informed bound. max_abs_value: the largest
        absolute initial bound, at least 1: the unit of rounding errors.
    """

    def __init__(
        self,
        pomdp: Pomdp,
        *,
        precision: float,
        seconds: float,
        kernels: Kernels | None = None,
        previous: Policy | None = None,
    ) -> None:
        """
        Args:
            precision: of the searches, in reward units.
            seconds: wall-clock time limit of each of the three initial bounds.
            kernels: the best installed ones when None.
            previous: a policy for the same model whose vectors and points are imported.
        """
        self.pomdp = pomdp
        self._kernels = kernels or load_kernels()
        self._model = build_model(self._kernels, pomdp)
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

    def reset(self) -> None:
        """Forget all beliefs, but keep the vectors and points."""
        self.tree = self._make_tree(self.policy())

    def policy(self, roots: Iterable[int] = ()) -> Policy:
        """Return the policy of the alpha vectors, with its upper bound.

        Args:
            roots: nodes whose own upper bounds, often below that of the points, become points first.
        """
        tree = self.tree
        for root in roots:
            belief = tree.belief(root)
            states = np.flatnonzero(belief).astype(np.int32)
            value = np.array([tree.upper_bound(root)])
            tree.add_points(np.array([0, len(states)]), states, belief[states], value)
        sets = []
        for group in range(tree.group_count):
            states, vectors, actions = tree.vectors(group)
            # without the vectors that these depend on, the policy could earn less than its vectors promise
            pruned, first = tree.dependencies(group)
            table, actions = np.concatenate([vectors, pruned]), np.concatenate([actions, first])
            if len(actions):
                sets.append(AlphaVectors(states.astype(np.intp), table, actions.astype(np.intp)))
        return Policy.of_sets(self.pomdp, sets, SawtoothBound(self.informed, *tree.points()))

    def _make_tree(self, previous: Policy | None) -> Tree:
        """Return a tree without nodes, with the vectors and points of an earlier policy."""
        tree = self._kernels.Tree(self._model, self.informed, self._blind)
        if previous is None:
            return tree
        own = [(tree.vectors(group), group) for group in range(tree.group_count)]
        groups = {states.tobytes(): group for (states, _, actions), group in own if len(actions)}
        for vectors in previous.vector_sets:
            group = groups.get(vectors.states.astype(np.int32).tobytes())
            if group is not None:
                tree.add_vectors(group, vectors.vectors, vectors.actions.astype(np.int32))
        if isinstance(previous.upper_bound, SawtoothBound):
            tree.add_points(*previous.upper_bound.points())
        return tree


class BoundedSearch:
    """One search from some start beliefs: limits, loop, history and result.

    bounds: the tree, which the search improves. roots: the nodes of the start beliefs.
    lower, upper: bounds at the root with the widest gap, `widest`.
    trials: steps so far, in the unit of the solver.
    history: (seconds, lower, upper, vectors) at first and after each change of a bound.
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
        """
        Args:
            precision: stop when upper - lower is at most this at every root, in reward units.
            began: start time on the monotonic clock.
            time_limit: wall-clock seconds from `began`.
        """
        self.bounds, self.precision = bounds, precision
        self._began, self._deadline = began, began + time_limit
        self.roots = [bounds.tree.find_or_add_node(belief) for belief in starts]
        self.trials = 0
        self.history: list[tuple[float, float, float, int]] = []
        self.widest, self.lower, self.upper = self._record_bounds()

    @property
    def gap(self) -> float:
        """upper - lower."""
        return self.upper - self.lower

    @property
    def seconds(self) -> float:
        """Wall-clock seconds so far."""
        return monotonic() - self._began

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
                self.widest, self.lower, self.upper = self._record_bounds()
                if callback is not None:
                    callback(self._make_progress())
        except KeyboardInterrupt:
            return "interrupted"

    def sample(self, share: float, max_depth: int, function: SampleFunction | None = None) -> None:
        """Sample one path from the root with the widest gap and prune.

        Args:
            share: of the gap; the path aims at a gap of this size.
            max_depth: largest number of nodes on the path.
            function: samples the path instead of `Tree.sample`.
        """
        tree = self.bounds.tree
        target = max(share * self.gap, 0.5 * self.precision)
        use_lower_bound = self.trials % 2 == 1
        arguments = self.bounds.predictor, self.widest, target, max_depth, self.seconds_left, use_lower_bound
        if function is None:
            tree.sample(*arguments)
        else:
            function(tree, *arguments)
        self.prune(self.roots)
        self.trials += 1

    def prune(self, roots: list[int]) -> None:
        """Drop vectors that are useless at the beliefs that the roots reach."""
        self.bounds.tree.prune(roots, PRUNING_RADIUS, PRUNING_RATIO, PRUNING_GROWTH)

    def make_solution(self, reason: str) -> Solution:
        """Return the result after the search stopped for a reason."""
        self.widest, self.lower, self.upper = self._record_bounds()
        return Solution(
            pomdp=self.bounds.pomdp,
            policy=self.bounds.policy(self.roots),
            lower=self.lower,
            upper=self.upper,
            seconds=self.seconds,
            reason=reason,
            history=tuple(self.history),
            beliefs=self.bounds.tree.node_count,
            trials=self.trials,
            start=self.bounds.tree.belief(self.widest),
        )

    def _record_bounds(self) -> tuple[int, float, float]:
        """Return the root with the widest gap and its bounds; append them to the history if they changed."""
        tree, widest = self.bounds.tree, (-1, 0.0, -np.inf)
        for root in self.roots:
            low, high = tree.lower_bound(root), tree.upper_bound(root)
            if low > high + CROSSING_TOLERANCE * self.bounds.max_abs_value:
                raise RuntimeError(f"the bounds cross: {low!r} > {high!r}; this is a bug in lcorpp")
            if widest[0] < 0 or high - low > widest[2] - widest[1]:
                widest = root, low, max(low, high)  # after the check, low exceeds high by rounding at most
        _, low, high = widest
        if not self.history or (low, high) != self.history[-1][1:3]:
            self.history.append((self.seconds, low, high, tree.vector_count))
        return widest

    def _make_progress(self) -> Progress:
        tree = self.bounds.tree
        return Progress(self.seconds, self.lower, self.upper, tree.vector_count, tree.node_count, self.trials)

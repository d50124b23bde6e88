"""Online planning: at every step a search with bounds from the current belief, instead of a policy.

Source: Ross, Pineau, Paquet and Chaib-draa, Online planning algorithms for POMDPs, JAIR 2008; the search is
that of Kurniawati, Hsu and Lee, RSS 2008.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from time import monotonic

from lcorpp.planning.arguments import MEMORY_LIMIT, check_count, check_solver_arguments
from lcorpp.planning.belief import check_belief
from lcorpp.planning.planner import ModelPlanner
from lcorpp.planning.policy import Policy, check_same_model
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.bounded_search import BoundedSearch
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from lcorpp.planning.sarsop.trials import Trials
from lcorpp.values import Belief

MAX_NODES = 50_000
"""Largest number of beliefs in memory; the next search then starts from the vectors and points alone."""

WORK_PER_SECOND = 8e8
"""Numbers that a search reads in about a second; `Tree.work` counts them."""

MAX_WORK = 2.0**60
"""Largest work of a search."""

MAX_KNOWN = 100_000
"""Largest number of results in memory of searches with a fixed amount of work."""

SHARPENING_SECONDS = 10.0
"""Time that sets the limits of the work of `BoundedTree.sharpen`."""


@dataclass(frozen=True)
class SearchResult:
    """The result of a search from a belief.

    action: index of the action with the largest lower bound.
    lower, upper: bounds on the optimal value. A planner that searches at every step earns at least `lower`.
    trials: number of sampled paths (trials) of this search. seconds: wall-clock time.
    """

    action: int
    lower: float
    upper: float
    trials: int
    seconds: float


class OnlinePlanner(ModelPlanner):
    """A planner that searches from each belief: `lcorpp.protocols.Planner`.

    For problems that are too large to be solved in advance or that are used only once: the time goes to the
    beliefs that occur. Bounds are shared by all beliefs, so a planner improves with use; with `work` each
    search begins anew, so that its result depends on the belief alone and a logged decision can be repeated.

    Args:
        pomdp: the problem.
        seconds: largest wall-clock time of one call of `action`.
        precision: a search stops when the bounds are this close, in reward units.
        trials: largest number of sampled paths (trials) per search, at least 1. With `seconds` long enough,
            equal calls then have equal results.
        work: of a search, in numbers read, see `WORK_PER_SECOND`; there is no limit of time then.
        policy: of the problem; the search begins with its vectors and points.
        preparation: largest wall-clock time for the initial bounds, in seconds.

    Raises:
        ModelError: a number is out of range.
        PolicyError: the policy is for another problem.

    Source: Ross and others, JAIR 2008.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import OnlinePlanner
        >>> planner = OnlinePlanner(load_domain("intention").pomdp, trials=100)
        >>> found = planner.search(planner.start)
        >>> planner.pomdp.actions[found.action], round(found.lower), round(found.upper)
        ('move_forward', 66, 66)
    """

    def __init__(
        self,
        pomdp: Pomdp,
        *,
        seconds: float = 1.0,
        precision: float = 1e-3,
        trials: int | None = None,
        work: int | None = None,
        policy: Policy | None = None,
        preparation: float = 60.0,
    ) -> None:
        check_solver_arguments(pomdp, None, precision, seconds)
        check_solver_arguments(pomdp, None, precision, preparation)
        self.pomdp, self.seconds, self.precision = pomdp, seconds, precision
        self.trials = None if trials is None else check_count("trials", trials, 1)
        self.work = None if work is None else check_count("work", work, 1)
        if policy is not None:
            check_same_model(pomdp, policy)
        self._policy, self._known = policy, dict[bytes, SearchResult]()
        self._bounds = BoundedTree(
            pomdp, [pomdp.start], precision=precision, seconds=preparation / 3, previous=policy
        )
        if self.work is not None:
            self._bounds.sharpen([pomdp.start], seconds=SHARPENING_SECONDS)

    def __repr__(self) -> str:
        tree = self._bounds.tree
        limit = f"{self.seconds:g} s" if self.work is None else f"work {self.work}"
        return f"<OnlinePlanner: {limit}, {tree.vector_count} vectors, {tree.node_count} beliefs>"

    def action(self, belief: Belief) -> str:
        """Search, and return the name of the action to take at a belief (S,).

        Raises:
            ModelError: `belief` is not a distribution over the states.
        """
        return self.pomdp.actions[self.search(belief).action]

    def search(self, belief: Belief) -> SearchResult:
        """Search from a belief (S,) for the best action and bounds on the value.

        After Ctrl-C, the result is that of the search so far.

        Raises:
            ModelError: `belief` is not a distribution over the states.
        """
        belief = check_belief(self.pomdp, belief)
        if self.work is None:
            return self._search(belief)[0]
        key = belief.tobytes()
        if key not in self._known:
            if len(self._known) >= MAX_KNOWN:
                self._known.clear()
            self._bounds.restart(self._policy)
            found, is_complete = self._search(belief)
            if not is_complete:
                return found
            self._known[key] = found
        return self._known[key]

    def describe_search(self, belief: Belief) -> str:
        """Return the bounds at a belief (S,), and what another action may gain at most."""
        found = self.search(belief)
        gap = max(found.upper - found.lower, 1e-3)
        value = f"value in [{found.lower:.3f}, {found.upper:.3f}]"
        return f"{value}: another action gains at most {gap:.2g} more"

    def _search(self, belief: Belief) -> tuple[SearchResult, bool]:
        """Search; return the result, and whether it was not interrupted."""
        began = monotonic()
        if self._bounds.tree.node_count > MAX_NODES:
            self._bounds.tree.clear_nodes()
        self._bounds.include(belief)
        seconds = self.seconds if self.work is None else inf
        search = BoundedSearch(
            self._bounds, [belief], precision=self.precision, began=began, time_limit=seconds
        )
        paths = Trials(search, memory_limit=MEMORY_LIMIT, seconds=min(seconds, SHARPENING_SECONDS))
        work_before = self._bounds.tree.work

        def step() -> str | None:
            if self.trials is not None and search.trials >= self.trials:
                return "trial limit"
            left = inf if self.work is None else self.work - (self._bounds.tree.work - work_before)
            if left <= 0:
                return "work limit"
            paths.sample(left)
            return None

        is_complete = search.run(step) != "interrupted"
        tree, root = self._bounds.tree, search.widest
        action, lower = tree.select_action(root, True), tree.lower_bound(root)
        upper = max(lower, tree.upper_bound(root))
        return SearchResult(action, lower, upper, search.trials, monotonic() - began), is_complete

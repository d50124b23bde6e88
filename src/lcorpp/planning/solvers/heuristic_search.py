"""Online planning: at every step a search with bounds from the current belief, instead of a policy.

Source: Ross, Pineau, Paquet and Chaib-draa, Online planning algorithms for POMDPs, JAIR 2008; the search is
that of Kurniawati, Hsu and Lee, RSS 2008.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import monotonic

from lcorpp.planning.arguments import check_count, check_solver_arguments
from lcorpp.planning.belief import check_belief
from lcorpp.planning.planner import ModelPlanner
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.bounded_search import BoundedSearch
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from lcorpp.values import Belief

TARGET_SHARE = 0.5
"""A path aims at this share of the current gap."""

MAX_DEPTH = 200
"""Largest number of nodes on a path."""

MAX_NODES = 50_000
"""Largest number of beliefs in memory; the next search then starts from the vectors and points alone."""


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
    """A planner that searches from each belief for a limited time: `lcorpp.protocols.Planner`.

    For problems that are too large to be solved in advance or that are used only once: the time goes to the
    beliefs that occur. Bounds are shared by all beliefs, so a planner improves with use.

    Args:
        pomdp: the problem.
        seconds: largest wall-clock time of one call of `action`.
        precision: a search stops when the bounds are this close, in reward units.
        trials: largest number of sampled paths (trials) per search, at least 1. With `seconds` long enough,
            equal calls then have equal results.
        preparation: largest wall-clock time for the initial bounds, in seconds.

    Raises:
        ModelError: a number is out of range.

    Source: Ross and others, JAIR 2008.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import OnlinePlanner
        >>> planner = OnlinePlanner(load_domain("intention").pomdp, trials=20)
        >>> found = planner.search(planner.start)
        >>> planner.pomdp.actions[found.action], round(found.lower), round(found.upper)
        ('move_forward', 66, 67)
    """

    def __init__(
        self,
        pomdp: Pomdp,
        *,
        seconds: float = 1.0,
        precision: float = 1e-3,
        trials: int | None = None,
        preparation: float = 60.0,
    ) -> None:
        check_solver_arguments(pomdp, None, precision, seconds)
        check_solver_arguments(pomdp, None, precision, preparation)
        self.pomdp, self.seconds, self.precision = pomdp, seconds, precision
        self.trials = None if trials is None else check_count("trials", trials, 1)
        self._bounds = BoundedTree(pomdp, [pomdp.start], precision=precision, seconds=preparation / 3)

    def __repr__(self) -> str:
        tree = self._bounds.tree
        return f"<OnlinePlanner: {self.seconds:g} s, {tree.vector_count} vectors, {tree.node_count} beliefs>"

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
        began, belief = monotonic(), check_belief(self.pomdp, belief)
        if self._bounds.tree.node_count > MAX_NODES:
            self._bounds.tree.clear_nodes()
        self._bounds.include(belief)
        search = BoundedSearch(
            self._bounds, [belief], precision=self.precision, began=began, time_limit=self.seconds
        )

        def step() -> str | None:
            if self.trials is not None and search.trials >= self.trials:
                return "trial limit"
            search.sample(TARGET_SHARE, MAX_DEPTH)
            return None

        search.run(step)
        tree, root = self._bounds.tree, search.widest
        action, lower = tree.select_action(root, True), tree.lower_bound(root)
        return SearchResult(
            action, lower, max(lower, tree.upper_bound(root)), search.trials, monotonic() - began
        )

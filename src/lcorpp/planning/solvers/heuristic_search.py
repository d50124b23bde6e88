"""Planning at the belief at hand: a search within bounds at every step, instead of a policy beforehand.

Source: Ross, Pineau, Paquet and Chaib-draa, Online planning algorithms for POMDPs, JAIR 2008; the search is
that of Kurniawati, Hsu and Lee, RSS 2008.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import monotonic

from lcorpp.planning.belief import check_belief, update
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import Tree, engine, model_of
from lcorpp.planning.sarsop.upper_bound import SawtoothBound
from lcorpp.planning.solvers.arguments import checked_count, checked_limits
from lcorpp.values import Belief

AIM = 0.5
"""A trial aims at this share of the gap that it finds."""

MAX_DEPTH = 200
"""The longest trial."""

MOST_NODES = 50_000
"""Beliefs that are kept; beyond it the search begins anew with the vectors and points found so far."""

DELTA, CAP, GROWTH = 1e-3, 3.0, 1.3
"""When vectors are pruned, and which: see `lcorpp.planning.sarsop.solver`."""


@dataclass(frozen=True)
class Seen:
    """What a search has found out at a belief.

    action: index of the action that earns most for certain.
    lower, upper: bounds on the optimal value; whoever goes on asking earns `lower` at least.
    trials: of this search. seconds: wall-clock time used.
    """

    action: int
    lower: float
    upper: float
    trials: int
    seconds: float


class OnlinePlanner:
    """A planner that searches when it is asked, for a while: `lcorpp.protocols.Planner`.

    For problems that are too large to be solved beforehand, or that are met once: time is spent on the
    beliefs that come about. Bounds found at one belief serve at all others, so a planner gets better with
    use.

    Args:
        pomdp: the problem.
        seconds: of wall-clock time that `action` may take at most.
        precision: it takes less where the bounds are as close as this, in reward units.
        trials: paths sampled at most at a time, from 1; with `seconds` long enough the same calls then get
            the same answers.
        preparation: wall-clock seconds for the initial bounds, at most.

    Raises:
        ModelError: a number is out of range.

    Source: Ross and others, JAIR 2008.
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
        checked_limits(precision, seconds)
        checked_limits(precision, preparation)
        self.pomdp, self.seconds, self.precision = pomdp, seconds, precision
        self.trials = None if trials is None else checked_count("trials", trials, 1)
        self._kernels = engine()
        self._model = model_of(self._kernels, pomdp)
        share = preparation / 3
        self._blind = self._kernels.blind_policies(self._model, 1e-3 * precision, share)
        seen = self._kernels.mdp_bound(self._model, 1e-3 * precision, share)
        self._informed = self._kernels.fast_informed_bound(self._model, seen, 1e-2 * precision, share)
        self._tree: Tree = self._kernels.Tree(self._model, self._informed, self._blind)
        self._prediction = self._kernels.Prediction(self._informed.max(axis=0))

    @property
    def start(self) -> Belief:
        """(S,) the model's own start belief."""
        return self.pomdp.start

    def action(self, belief: Belief) -> str:
        """The name of the action to take at a belief (S,), after a search.

        Raises:
            ModelError: it is not a distribution over the states.
        """
        return self.pomdp.actions[self.look(belief).action]

    def update(self, belief: Belief, action: str, observation: str) -> Belief:
        """(S,) the belief after a named action and observation.

        Raises:
            ModelError: a name is unknown.
            ObservationError: the observation is impossible.
        """
        pomdp = self.pomdp
        return update(pomdp, belief, pomdp.action_index(action), pomdp.observation_index(observation))

    def look(self, belief: Belief) -> Seen:
        """Search from a belief (S,): the action to take there, and bounds on the value.

        At an interrupt from the keyboard it returns what is known so far.

        Raises:
            ModelError: it is not a distribution over the states.
        """
        began, belief = monotonic(), check_belief(self.pomdp, belief)
        if self._tree.node_count > MOST_NODES:
            self._begin_anew()
        tree, root, done = self._tree, self._tree.node(belief), 0
        try:
            while self._open(root, done, began):
                gap = tree.upper_at(root) - tree.lower_at(root)
                left = began + self.seconds - monotonic()
                target = max(AIM * gap, 0.5 * self.precision)
                tree.trial(self._prediction, root, target, MAX_DEPTH, left, done % 2 == 1)
                tree.prune([root], DELTA, CAP, GROWTH)
                done += 1
        except KeyboardInterrupt:
            pass
        action, low = tree.look(root, True), tree.lower_at(root)
        return Seen(action, low, max(low, tree.upper_at(root)), done, monotonic() - began)

    def _open(self, root: int, done: int, began: float) -> bool:
        """Whether to go on searching."""
        if self.trials is not None and done >= self.trials:
            return False
        narrow = self._tree.upper_at(root) - self._tree.lower_at(root) <= self.precision
        return not narrow and monotonic() < began + self.seconds

    def _begin_anew(self) -> None:
        """Forget the beliefs, not what was learnt at them."""
        old = self._tree
        tree = self._kernels.Tree(self._model, self._informed, self._blind)
        for group in range(old.groups):
            _, vectors, actions = old.vectors(group)
            if len(actions):
                tree.add_vectors(group, vectors, actions)
        tree.add_points(*SawtoothBound(self._informed, *old.points()).points())
        self._tree = tree

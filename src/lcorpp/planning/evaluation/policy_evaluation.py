"""What a policy earns, worked out from the model and the policy alone: nothing of the solver is trusted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.control_variates import estimate
from lcorpp.planning.evaluation.mdp_bounds import mdp_value_bounds
from lcorpp.planning.evaluation.occupancy import DiscountedOccupancy
from lcorpp.planning.evaluation.simulation import CONFIDENCE
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.planner import check_same_model
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Belief

DRIFT = 2.0**-39
"""How far keeping a belief with 40 digits moves it in one step: the sum of all changes, at most."""


@dataclass(frozen=True, eq=False)
class Shortfall:
    """The belief at which a policy loses most of what its vectors promise.

    belief: (S,). action: index. promise: what the best vector says there.
    given: what the action earns at once, and what the vectors promise at the next beliefs, discounted.
    visits: how often the belief is met, discounted.
    """

    belief: Belief
    action: int
    promise: float
    given: float
    visits: float


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What a policy earns from a start belief, in discounted reward.

    lower, upper: bounds that hold for certain.
    exact: whether they are as close as was asked for, rounding aside.
    closed: whether every belief that the policy can meet was worked out.
    nodes: how many beliefs were.
    estimate: the value, or the best guess at it. interval: where it lies, with a `confidence`; the bounds
        themselves, with confidence 1, unless trials were needed.
    trials: how many were. seconds: wall-clock time used.
    shortfall: where most of what the vectors promise is lost, among the beliefs worked out.
    """

    lower: float
    upper: float
    exact: bool
    closed: bool
    nodes: int
    estimate: float
    interval: tuple[float, float]
    confidence: float
    trials: int
    seconds: float
    shortfall: Shortfall

    def summary(self) -> str:
        """One line for people."""
        beliefs = f"{self.nodes} beliefs" + ("" if self.closed else ", not all")
        if not self.trials:
            return f"earns {self.lower:.6g} to {self.upper:.6g} ({beliefs})"
        low, high = self.interval
        return (
            f"earns {self.estimate:.6g}, with confidence {100 * self.confidence:g}% {low:.6g} to {high:.6g}"
            f" ({self.trials} trials), for certain {self.lower:.6g} to {self.upper:.6g} ({beliefs})"
        )


def evaluate(
    pomdp: Pomdp,
    policy: Policy,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-4,
    max_nodes: int = 50_000,
    trials: int = 1_000,
    confidence: float = CONFIDENCE,
    seed: int = 0,
) -> Evaluation:
    """Work out what a policy earns from a belief.

    The beliefs that the policy can meet are worked out, those first of which most depends, and how often
    each is met, discounted. What is not worked out lies between what the worst and the best could earn there
    (`extremes`). The bounds meet when no belief is left, or none that weighs more than the precision. Where
    there are too many beliefs, trials from those that were left tell more, with an interval.

    Beliefs are kept with 40 binary digits, as in simulation, and those that are equal then are one. What is
    earned by doing as the policy does from a node on is linear in the belief there, with coefficients of at
    most M, the largest value in the model; keeping moves a belief by less than d = 2**-39 in all, so it
    moves the value of each node by d M, and that of the first by d M / (1 - gamma) in all. The bounds are
    that much wider. The interval of the trials is that of the normal law.

    Args:
        pomdp: the world. policy: made for it.
        start: (S,) where the policy begins; the model's own when None.
        precision: how close the bounds should be, in reward units.
        max_nodes: no more is worked out once so many beliefs were met, or fewer that hold very many states.
        trials: of the estimate, when the bounds stay too far apart; 0 for none.
        confidence: of its interval, between 0 and 1.
        seed: of the trials, a whole number from 0.

    Raises:
        ModelError: `start` is not a distribution over the states, or a number is out of range.
        PolicyError: the policy is for another model.
        ObservationError: a belief has lost the hidden state of a trial to rounding; it is named.
    """
    check_same_model(pomdp, policy)
    if not precision > 0 or not 0 < confidence < 1 or max_nodes < 1 or trials < 0 or 0 < trials < 4:
        raise ModelError(
            f"precision {precision} must be positive, confidence {confidence} between 0 and 1, max_nodes"
            f" {max_nodes} from 1 and trials {trials} 0 or from 4"
        )
    belief = check_belief(pomdp, pomdp.start if start is None else start)
    began = monotonic()
    low, high = mdp_value_bounds(pomdp)
    most = float(max(np.abs(low).max(), np.abs(high).max()))
    slack = DRIFT * most / (1 - pomdp.discount)
    graph = BeliefGraph(pomdp, policy)
    visits = DiscountedOccupancy(graph, int(graph.add(SparseBeliefs.of(belief[None]))[0]), low, high)
    visits.expand(precision / 2, max_nodes)
    lower, upper = visits.bounds()
    exact = upper - lower <= precision
    lower, upper = lower - slack, upper + slack
    found = Evaluation(
        lower=lower,
        upper=upper,
        exact=exact,
        closed=visits.closed,
        nodes=visits.expanded,
        estimate=(lower + upper) / 2,
        interval=(lower, upper),
        confidence=1.0,
        trials=0,
        seconds=monotonic() - began,
        shortfall=_worst(visits),
    )
    if exact or visits.closed or not trials:
        return found
    roots = np.flatnonzero(visits.left > 0)
    left = visits.left[roots]
    beyond = estimate(graph, roots, left, trials=trials, confidence=confidence, seed=seed)
    value = visits.earned() + float(left.sum()) * beyond.mean
    half = float(left.sum()) * beyond.half + slack
    return replace(
        found,
        estimate=min(max(value, lower), upper),
        interval=(max(lower, value - half), min(upper, value + half)),
        confidence=confidence,
        trials=trials,
        seconds=monotonic() - began,
    )


def _worst(visits: DiscountedOccupancy) -> Shortfall:
    graph, lost = visits.graph, visits.shortfalls()
    node = int(lost.argmax())
    promise, often = float(graph.values[node]), float(visits.visits[node])
    return Shortfall(
        belief=graph.beliefs.belief(node, len(graph.pomdp.states)),
        action=int(graph.actions[node]),
        promise=promise,
        given=promise - float(lost[node]) / often if often > 0 else promise,
        visits=often,
    )

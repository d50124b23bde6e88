"""Policy evaluation from the model alone: bounds on a policy's value that do not rely on its solver."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.notebook import html_table
from lcorpp.planning.arguments import check_type
from lcorpp.planning.belief import check_belief
from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.budget import Budget
from lcorpp.planning.evaluation.control_variates import MeanEstimate, estimate_value
from lcorpp.planning.evaluation.mdp import mdp_value_bounds
from lcorpp.planning.evaluation.occupancy import DiscountedOccupancy
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.policy import Policy, check_same_model
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.undiscounted import DiscountedForm
from lcorpp.values import Belief, Interval

BELIEF_ROUNDING = 2.0**-39
"""Bound on the change of a belief, in total variation, by rounding to 40 binary digits."""


@dataclass(frozen=True, eq=False)
class Shortfall:
    """The belief with the largest loss of a policy against its vectors.

    belief: (S,). action: index.
    vector_value: value of the best vector.
    backup_value: expected reward of the action plus the discounted vector values at the next beliefs.
    visits: expected discounted visits of the belief.
    """

    belief: Belief
    action: int
    vector_value: float
    backup_value: float
    visits: float

    def __repr__(self) -> str:
        return (
            f"<Shortfall: vector value {self.vector_value:.6g}, backup {self.backup_value:.6g},"
            f" {self.visits:.3g} visits>"
        )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The value of a policy at a start belief, in discounted reward.

    lower, upper: certain bounds.
    exact: whether the bounds are as close as requested, apart from rounding.
    complete: whether all reachable beliefs were computed.
    beliefs: how many were computed.
    coverage: share of the discounted future, in [0, 1], before the policy leaves the computed beliefs.
    interval: estimate of the value with a confidence interval; if there were no trials, the middle of the
        bounds and the bounds themselves, with confidence 1.
    trials: how many were simulated; truncated ones contribute bounds on their remaining reward.
    seconds: CPU time of the calling thread. stopped: the limit that was reached, "time limit",
        "memory limit" or "interrupted"; "" if none.
    shortfall: the largest loss against the vectors, among the computed beliefs.
    """

    lower: float
    upper: float
    exact: bool
    complete: bool
    beliefs: int
    coverage: float
    interval: Interval
    trials: int
    seconds: float
    stopped: str
    shortfall: Shortfall

    def summary(self) -> str:
        """Return the result in one line of text."""
        beliefs = f"{self.beliefs} beliefs" + ("" if self.complete else f", not all; {self.coverage:.0%}")
        bounds, interval = f"{self.lower:.6g} to {self.upper:.6g} ({beliefs})", self.interval
        if not self.trials:
            return f"value {bounds}"
        return (
            f"value {interval.estimate:.6g}, {100 * interval.confidence:g}% interval {interval.low:.6g} to"
            f" {interval.high:.6g} ({self.trials} trials), certainly {bounds}"
        )

    def __repr__(self) -> str:
        return f"<Evaluation: {self.summary()}>"

    def _repr_html_(self) -> str:
        interval = self.interval
        rows = [
            ("certain bounds", f"{self.lower:.6g} to {self.upper:.6g}"),
            ("estimate", f"{interval.estimate:.6g}"),
            (f"{100 * interval.confidence:g}% interval", f"{interval.low:.6g} to {interval.high:.6g}"),
            ("beliefs", f"{self.beliefs}" + ("" if self.complete else ", not all")),
            ("trials", f"{self.trials}"),
        ]
        return html_table(("quantity", "value"), rows, caption="Value of a policy")


def evaluate(
    pomdp: Pomdp,
    policy: Policy,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-4,
    max_nodes: int = 50_000,
    trials: int = 1_000,
    confidence: float = 0.95,
    seed: int = 0,
    time_limit: float = np.inf,
    memory_limit: float = np.inf,
    interruptible: bool = False,
    callback: Callable[[float, str], None] | None = None,
) -> Evaluation:
    """Evaluate a policy from a belief.

    The reachable beliefs and their expected discounted visits are computed, those with the largest effect on
    the value first. At beliefs that are not computed, the value is bounded by the MDP (`mdp_value_bounds`).
    The bounds meet if all beliefs are computed, or all with more effect than the precision. If there are too
    many beliefs, trials from the remaining ones give a confidence interval, by the normal distribution.

    Beliefs have 40 binary digits, as in simulation, and equal beliefs are merged. The value of the policy's
    plan at a node is linear in the belief, with coefficients of at most M, the largest value in the model.
    Rounding changes a belief by less than d = 2**-39 in total, hence the value of each node by d M and that
    of the root by d M / (1 - gamma). The bounds are widened by this amount.

    Args:
        pomdp: the model. policy: for this model.
        start: (S,) the start belief; the model's own when None.
        precision: requested difference of the bounds, in reward units.
        max_nodes: the maximal number of reached beliefs; it is smaller if beliefs have very many states.
        trials: number of trials if the bounds remain further apart; 0 for none.
        confidence: of the trials' interval, between 0 and 1.
        seed: of the trials, an integer from 0.
        time_limit: seconds of CPU time of the calling thread, which ends the evaluation after at least 100
            beliefs. memory_limit: bytes of the evaluation's own arrays. At a limit, the evaluation returns
            its result so far.
        interruptible: whether it does so at the first Ctrl-C, too, instead of raising KeyboardInterrupt.
        callback: takes the completed share, in [0, 1], and a text.

    Raises:
        ModelError: `start` is not a distribution over the states, or an argument is out of range.
        PolicyError: the policy is for another model.
        KeyboardInterrupt: Ctrl-C; the second one if `interruptible`.
        ObservationError: rounding has removed the hidden state from a trial's belief; the message names it.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import evaluate
        >>> pomdp = load_domain("intention").pomdp
        >>> evaluation = evaluate(pomdp, solve(pomdp).policy)
        >>> evaluation.exact, round(evaluation.interval.estimate, 1)
        (True, 66.5)
    """
    check_same_model(pomdp, policy)
    numbers = {"precision": precision, "max_nodes": max_nodes, "trials": trials, "confidence": confidence}
    numbers |= {"time_limit": time_limit, "memory_limit": memory_limit}
    for name, number in numbers.items():
        check_type(name, number, Real)
    if not precision > 0 or not 0 < confidence < 1 or max_nodes < 1 or trials < 0 or 0 < trials < 4:
        raise ModelError(
            f"precision {precision} must be positive, confidence {confidence} between 0 and 1, max_nodes"
            f" {max_nodes} from 1 and trials {trials} 0 or from 4"
        )
    if not (time_limit > 0 and memory_limit > 0):
        raise ModelError(f"time_limit {time_limit} and memory_limit {memory_limit} must be positive")
    belief = check_belief(pomdp, pomdp.start if start is None else start)
    if pomdp.discount == 1:
        form = DiscountedForm.of(pomdp)
        scale = float(form.scale(belief[None])[0])
        found = evaluate(
            form.pomdp,
            form.convert_policy(policy),
            form.convert_beliefs(belief[None])[0],
            precision=precision / scale,
            max_nodes=max_nodes,
            trials=trials,
            confidence=confidence,
            seed=seed,
            time_limit=time_limit,
            memory_limit=memory_limit,
            interruptible=interruptible,
            callback=callback,
        )
        return _restore(found, form, scale)
    _import_solvers()
    budget = Budget(time_limit, memory_limit)
    with budget.catch_interrupt() if interruptible else nullcontext():
        state_bounds = mdp_value_bounds(pomdp)
        largest = float(max(np.abs(bound).max() for bound in state_bounds))
        slack = BELIEF_ROUNDING * largest / (1 - pomdp.discount)
        graph = BeliefGraph(pomdp, policy)
        root = int(graph.add(SparseBeliefs.of(belief[None]))[0])
        occupancy = DiscountedOccupancy(graph, root, *state_bounds, budget)

        def show() -> None:
            if callback is not None:
                share = min(1.0, max(budget.seconds / time_limit, len(graph) / max_nodes))
                callback(share, f"{len(graph)} beliefs, {occupancy.coverage:.0%}")

        occupancy.expand(precision / 2, max_nodes, show)
        found = _summarise(occupancy, precision, slack)
        if trials and not found.exact and not found.complete:
            roots = np.flatnonzero(occupancy.residual > 0)
            weights = occupancy.residual[roots]
            remainder = estimate_value(
                graph,
                roots,
                weights,
                trials=trials,
                confidence=confidence,
                seed=seed,
                state_bounds=state_bounds,
                budget=budget,
                show=None if callback is None else lambda n: callback(n / trials, f"{n} of {trials} trials"),
            )
            if remainder is not None:
                found = _add_trials(
                    found, occupancy.expected_reward(), float(weights.sum()), remainder, slack
                )
        return replace(found, seconds=budget.seconds, stopped=budget.reason)


def _import_solvers() -> None:
    """Import what the evaluation imports when it needs it: the first import takes as long as many beliefs."""
    import scipy.sparse.linalg
    import scipy.special  # noqa: F401


def _restore(found: Evaluation, form: DiscountedForm, scale: float) -> Evaluation:
    """Return the evaluation of a discounted form as that of the problem with discount 1."""
    interval, loss = found.interval, found.shortfall
    belief = form.restore_belief(loss.belief)
    local = float(form.scale(belief[None])[0])
    return replace(
        found,
        lower=scale * found.lower,
        upper=scale * found.upper,
        interval=Interval(
            scale * interval.estimate, scale * interval.low, scale * interval.high, interval.confidence
        ),
        shortfall=replace(
            loss,
            belief=belief,
            vector_value=local * loss.vector_value,
            backup_value=local * loss.backup_value,
        ),
    )


def _summarise(occupancy: DiscountedOccupancy, precision: float, slack: float) -> Evaluation:
    """Return what the expanded beliefs show."""
    lower, upper = occupancy.bounds()
    exact = upper - lower <= precision
    lower, upper = lower - slack, upper + slack
    return Evaluation(
        lower=lower,
        upper=upper,
        exact=exact,
        complete=occupancy.complete,
        beliefs=occupancy.expanded,
        coverage=occupancy.coverage,
        interval=Interval((lower + upper) / 2, lower, upper, confidence=1.0),
        trials=0,
        seconds=0.0,
        stopped="",
        shortfall=_find_largest_shortfall(occupancy),
    )


def _add_trials(
    found: Evaluation, reward: float, weight: float, remainder: MeanEstimate, slack: float
) -> Evaluation:
    """Add the estimate of what lies beyond the expanded beliefs, whose total residual is `weight`."""
    lower, upper = found.lower, found.upper
    interval = Interval(
        estimate=min(max(reward + weight * remainder.mean, lower), upper),
        low=max(lower, reward + weight * remainder.low - slack),
        high=min(upper, reward + weight * remainder.high + slack),
        confidence=remainder.confidence,
    )
    return replace(found, interval=interval, trials=remainder.trials)


def _find_largest_shortfall(occupancy: DiscountedOccupancy) -> Shortfall:
    graph, losses = occupancy.graph, occupancy.shortfalls()
    node = int(losses.argmax())
    value, visits = float(graph.values[node]), float(occupancy.visits[node])
    return Shortfall(
        belief=graph.beliefs.dense(node, len(graph.pomdp.states)),
        action=int(graph.actions[node]),
        vector_value=value,
        backup_value=value - float(losses[node]) / visits if visits > 0 else value,
        visits=visits,
    )

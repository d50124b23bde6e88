"""An independent check of what a solver says of its policy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief, describe
from lcorpp.planning.evaluation.policy_evaluation import Evaluation, Shortfall, evaluate
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Solution

TOLERANCE = 1e-6
"""How far a claim may be off, as a share of the values it speaks of and at least of 1."""

Verdict = Literal["confirmed", "refuted", "open"]


@dataclass(frozen=True)
class Certificate:
    """What became of the claim that a policy earns at least `lower`, and none more than `upper`.

    promise: what the policy's vectors say of the start belief.
    tolerance: how far a claim may be off, in reward units.
    evaluation: what the policy earns, found from the model and the policy alone.
    verdict: "confirmed", "refuted", or "open" where the trials were too few to tell.
    reason: what decided, in words.
    certain: whether that holds for certain, not with the confidence of the evaluation only.
    """

    lower: float
    upper: float
    promise: float
    tolerance: float
    evaluation: Evaluation
    verdict: Verdict
    reason: str
    certain: bool

    @property
    def text(self) -> str:
        """The certificate for people."""
        found = self.evaluation
        if found.trials:
            way = (
                f"checked by {found.trials} trials beyond {found.nodes} beliefs that were worked out: it"
                f" earns {found.interval[0]:.8g} to {found.interval[1]:.8g} with confidence"
                f" {100 * found.confidence:g}%, and for certain {found.lower:.8g} to {found.upper:.8g}"
            )
        else:
            which = "all beliefs" if found.closed else "the beliefs"
            way = (
                f"checked exactly on {which} that the policy meets ({found.nodes}): it earns"
                f" {found.lower:.8g} to {found.upper:.8g}"
            )
        claim = f"the policy earns at least {self.lower:.8g}, and none earns more than {self.upper:.8g}"
        verdict = f"{self.verdict}: {self.reason} (tolerance {self.tolerance:.2g})"
        return f"claim:   {claim}\ncheck:   {way}\nverdict: {verdict}"


def certificate(
    solution: Solution,
    start: npt.ArrayLike | None = None,
    *,
    tolerance: float | None = None,
    max_nodes: int = 50_000,
    trials: int = 200,
    confidence: float = 0.99,
    seed: int = 0,
) -> Certificate:
    """Check what a solution claims, by what its policy earns.

    A policy of alpha vectors earns what its vectors promise only if each vector is backed by others: if what
    it promises is what its action earns at once and what the best vectors at the next beliefs promise then.
    A vector that was needed for that and has been pruned breaks the promise, and no bound at the start tells.
    So the policy is evaluated from the model (`evaluate`), where the vectors only choose the actions.

    Args:
        solution: of a solver.
        start: (S,) a belief to check the claims at, as vectors and upper bound make them there; the start and
            the claims of the solution when None.
        tolerance: in reward units; a millionth of the values when None.
        max_nodes, trials, confidence, seed: as for `evaluate`.

    Raises:
        ModelError: `start` is not a distribution over the states, or a number is out of range.
        PolicyError: the policy is for another model.
    """
    pomdp, policy = solution.pomdp, solution.policy
    own = pomdp.start if solution.start is None else solution.start
    belief = check_belief(pomdp, own if start is None else start)
    promise = policy.value(belief)
    lower, upper = solution.lower, solution.upper
    if start is not None:
        lower = promise
        upper = np.inf if policy.upper_bound is None else float(policy.upper_bound.value(belief))
    if tolerance is None:
        tolerance = TOLERANCE * max(1.0, abs(lower), abs(upper) if np.isfinite(upper) else 0.0)
    if not tolerance > 0:
        raise ModelError(f"the tolerance must be positive, not {tolerance}")
    found = evaluate(
        pomdp,
        policy,
        belief,
        precision=tolerance,
        max_nodes=max_nodes,
        trials=trials,
        confidence=confidence,
        seed=seed,
    )
    verdict, certain, reason = _judged(lower - tolerance, upper + tolerance, found)
    if verdict == "refuted" and promise >= lower - tolerance > found.estimate:
        reason += "; " + _loss(pomdp, found.shortfall)
    return Certificate(lower, upper, promise, tolerance, found, verdict, reason, certain)


def _judged(lower: float, upper: float, found: Evaluation) -> tuple[Verdict, bool, str]:
    """The verdict, whether it is certain, and why; the bounds are given with their tolerance."""
    if upper < lower:
        return "refuted", True, "the upper bound is below the lower one"
    for certain, (least, greatest) in ((True, (found.lower, found.upper)), (False, found.interval)):
        how = "" if certain else f" with confidence {100 * found.confidence:g}%"
        if greatest < lower:
            return "refuted", certain, f"the policy earns less than is claimed{how}"
        if least > upper:
            return "refuted", certain, f"the policy earns more than any is said to{how}"
        if least >= lower:
            return "confirmed", certain, f"the policy earns what is claimed{how}"
    return "open", False, "the claim is within the interval; more trials or beliefs would tell"


def _loss(pomdp: Pomdp, loss: Shortfall) -> str:
    """Where the promise of the vectors is broken."""
    return (
        f"most is lost in belief {describe(pomdp, loss.belief)}, where {pomdp.actions[loss.action]!r}"
        f" promises {loss.promise:.6g} but what it leads to is worth {loss.given:.6g}"
    )

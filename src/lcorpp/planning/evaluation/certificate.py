"""Certificates: an independent check of a solver's claims about its policy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.notebook import html_table
from lcorpp.planning.arguments import MEMORY_LIMIT, check_type
from lcorpp.planning.belief import check_belief, format_belief
from lcorpp.planning.evaluation.policy_evaluation import Evaluation, evaluate
from lcorpp.planning.solution import Solution

TOLERANCE = 1e-6
"""Default tolerance of a claim, relative to the largest claimed value, which counts as at least 1."""

MIN_SECONDS = 2.0
"""Minimal default of the time limit, in seconds."""

Verdict = Literal["confirmed", "refuted", "open"]


@dataclass(frozen=True)
class Certificate:
    """The check of a claim: the policy's value is at least `lower`, that of every policy at most `upper`.

    The check evaluates this policy only: it can prove or refute the first half of the claim. The second half
    can be refuted, not proved: it is false if this policy's value exceeds `upper`.

    vector_value: value of the policy's best vector at the start belief.
    tolerance: of the claim, in reward units.
    evaluation: of the policy, from the model alone.
    verdict: "confirmed", "refuted", or "open" if the evaluation is not precise enough to decide.
    reason: of the verdict, in words.
    certain: whether the verdict is certain; otherwise it has the confidence of the evaluation's interval.
    """

    lower: float
    upper: float
    vector_value: float
    tolerance: float
    evaluation: Evaluation
    verdict: Verdict
    reason: str
    certain: bool

    @property
    def text(self) -> str:
        """The certificate in three lines: claim, check and verdict."""
        return "\n".join(f"{name + ':':<8} {text}" for name, text in self._parts())

    def _parts(self) -> list[tuple[str, str]]:
        evaluation = self.evaluation
        bounds = f"{evaluation.lower:.8g} to {evaluation.upper:.8g}"
        which = "all reachable beliefs" if evaluation.complete else "reachable beliefs"
        check = f"exact evaluation on {which} ({evaluation.beliefs}): value {bounds}"
        if evaluation.trials:
            interval = evaluation.interval
            check = (
                f"{evaluation.trials} trials beyond {evaluation.beliefs} computed beliefs:"
                f" {100 * interval.confidence:g}% interval {interval.low:.8g} to {interval.high:.8g},"
                f" certainly {bounds}"
            )
        if evaluation.stopped:
            check += (
                f"; {evaluation.stopped} after {evaluation.seconds:.1f} s, the beliefs cover"
                f" {evaluation.coverage:.0%} of the discounted future"
            )
        return [
            ("claim", f"policy's value at least {self.lower:.8g}, optimal value at most {self.upper:.8g}"),
            ("check", check),
            ("verdict", f"{self.verdict}: {self.reason} (tolerance {self.tolerance:.2g})"),
        ]

    def __repr__(self) -> str:
        return f"<Certificate\n{self.text}>"

    def _repr_html_(self) -> str:
        return html_table(("check", "result"), self._parts(), caption="Certificate")


def certificate(
    solution: Solution,
    start: npt.ArrayLike | None = None,
    *,
    tolerance: float | None = None,
    max_nodes: int = 50_000,
    trials: int = 200,
    confidence: float = 0.99,
    seed: int = 0,
    time_limit: float | None = None,
    memory_limit: float = MEMORY_LIMIT,
    callback: Callable[[float, str], None] | None = None,
) -> Certificate:
    """Check the claims of a solution by evaluating its policy.

    The value of a policy reaches its vectors' values only if each vector is at most its one-step backup: the
    expected reward of its action plus the discounted values of the best vectors at the next beliefs. If a
    vector that others depend on was pruned, this fails, and no bound at the start shows it. The check
    evaluates the policy from the model (`evaluate`); it uses the vectors only to select actions.

    Args:
        solution: of a solver.
        start: (S,) belief of the claims, which are then the values of vectors and upper bound there; the
            solution's own start and claims when None.
        tolerance: in reward units; 1e-6 times the claimed values when None.
        max_nodes, trials, confidence, seed, callback: as for `evaluate`.
        time_limit: seconds of CPU time; when None, as many as the search took, at least `MIN_SECONDS`.
        memory_limit: bytes. At a limit or at Ctrl-C, the result so far determines the verdict, which may be
            "open".

    Raises:
        ModelError: `start` is not a distribution over the states, or an argument is out of range.
        PolicyError: the policy is for another model.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import certificate
        >>> certificate(solve(load_domain("intention").pomdp)).verdict
        'confirmed'
    """
    check_type("solution", solution, Solution)
    pomdp, policy = solution.pomdp, solution.policy
    own = pomdp.start if solution.start is None else solution.start
    belief = check_belief(pomdp, own if start is None else start)
    vector_value = policy.value(belief)
    lower, upper = solution.lower, solution.upper
    if start is not None:
        lower = vector_value
        upper = np.inf if policy.upper_bound is None else float(policy.upper_bound.value(belief))
    if tolerance is None:
        tolerance = TOLERANCE * max(1.0, abs(lower), abs(upper) if np.isfinite(upper) else 0.0)
    if not tolerance > 0:
        raise ModelError(f"the tolerance must be positive, not {tolerance}")
    evaluation = evaluate(
        pomdp,
        policy,
        belief,
        precision=tolerance,
        max_nodes=max_nodes,
        trials=trials,
        confidence=confidence,
        seed=seed,
        time_limit=max(MIN_SECONDS, solution.seconds) if time_limit is None else time_limit,
        memory_limit=memory_limit,
        interruptible=True,
        callback=callback,
    )
    verdict, certain, reason = _decide(lower - tolerance, upper + tolerance, evaluation)
    if verdict == "refuted" and vector_value >= lower - tolerance > evaluation.interval.estimate:
        loss = evaluation.shortfall
        reason += (
            f"; the largest loss is in belief {format_belief(pomdp, loss.belief)}, where the vector of"
            f" {pomdp.actions[loss.action]!r} has value {loss.vector_value:.6g} but its backup"
            f" {loss.backup_value:.6g}"
        )
    return Certificate(lower, upper, vector_value, tolerance, evaluation, verdict, reason, certain)


def _decide(lower: float, upper: float, evaluation: Evaluation) -> tuple[Verdict, bool, str]:
    """Return the verdict, whether it is certain, and its reason; the bounds include the tolerance."""
    if upper < lower:
        return "refuted", True, "the upper bound is below the lower bound"
    interval = evaluation.interval
    certain_bounds = evaluation.lower, evaluation.upper
    for certain, (low, high) in ((True, certain_bounds), (False, (interval.low, interval.high))):
        how = "" if certain else f" with confidence {100 * interval.confidence:g}%"
        if high < lower:
            return "refuted", certain, f"the policy's value is below the claimed lower bound{how}"
        if low > upper:
            return "refuted", certain, f"the policy's value is above the claimed upper bound{how}"
        if low >= lower:
            return "confirmed", certain, f"the policy's value reaches the claimed lower bound{how}"
    return "open", False, "the claim is within the interval; more trials or beliefs could decide"

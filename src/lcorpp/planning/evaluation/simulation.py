"""Monte Carlo simulation of a policy: thousands of trials at once, scored from the hidden state."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log, sqrt
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.notebook import html_table
from lcorpp.planning.belief import check_belief
from lcorpp.planning.evaluation.rollout import BatchRollout
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.policy import Policy, check_same_model
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.undiscounted import DiscountedForm
from lcorpp.values import Array, Indices, Interval


def mean_interval(samples: Array, confidence: float = 0.95) -> Interval:
    """Return the mean of independent samples (n,) with Student's t interval; it is infinite for n = 1."""
    from scipy.special import stdtrit

    n, mean = len(samples), float(samples.mean())
    if n < 2:
        return Interval(mean, -np.inf, np.inf, confidence)
    half = float(stdtrit(n - 1, (1 + confidence) / 2) * samples.std(ddof=1) / np.sqrt(n))
    return Interval(mean, mean - half, mean + half, confidence)


@dataclass(frozen=True, eq=False)
class Trace:
    """One trial of L steps.

    states: (L + 1,) the hidden states, including the last one.
    actions, observations: (L,) indices; an observation is made after its action.
    rewards: (L,) of each action.
    """

    states: Indices
    actions: Indices
    observations: Indices
    rewards: Array

    def __repr__(self) -> str:
        return f"<Trace: {len(self.actions)} steps, reward {self.rewards.sum():.6g}>"


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """The rewards of a policy in n trials of at most T steps.

    returns: (n,) the discounted reward of each trial.
    lengths: (n,) the number of steps before all further rewards were zero, at most T.
    rewards: (T,) the mean reward of each step, not discounted, with 0 for trials that had ended.
    unfinished: how many trials were cut off at T.
    truncation: smallest and largest change of the mean if these trials had continued.
    spread: difference of the largest and the smallest possible discounted reward of a trial.
    beliefs: how many beliefs were computed. seconds: wall-clock time.
    traces: the first trials step by step, as many as requested.
    """

    returns: Array
    lengths: Indices
    rewards: Array
    unfinished: int
    truncation: tuple[float, float]
    spread: float
    beliefs: int
    seconds: float
    traces: tuple[Trace, ...] = ()

    @property
    def steps(self) -> int:
        """The number of steps of all trials."""
        return int(self.lengths.sum())

    @property
    def active_share(self) -> Array:
        """(T,) the share of trials that took each step."""
        counts = np.bincount(self.lengths, minlength=len(self.rewards) + 1)
        return counts[::-1].cumsum()[::-1][1:] / len(self.lengths)

    @property
    def mean(self) -> float:
        """The mean discounted reward."""
        return float(self.returns.mean())

    @property
    def standard_deviation(self) -> float:
        """The standard deviation of the discounted reward; nan for a single trial."""
        return float(self.returns.std(ddof=1)) if len(self.returns) > 1 else float("nan")

    @cached_property
    def interval(self) -> Interval:
        """The mean discounted reward with its 95% confidence interval, without truncation."""
        return mean_interval(self.returns)

    def upper_limit(self, confidence: float) -> float:
        """Return a bound that the policy's value exceeds with probability at most 1 - confidence.

        It holds for any distribution of the rewards, also if large ones are too rare to occur in the trials,
        and includes the truncation; it is infinite for a single trial.

        Source: Maurer and Pontil, "Empirical Bernstein bounds and sample variance penalization", COLT 2009,
        theorem 4.
        """
        n = len(self.returns)
        if n < 2:
            return np.inf
        level = log(2 / (1 - confidence))
        half = self.standard_deviation * sqrt(2 * level / n) + 7 * self.spread * level / (3 * (n - 1))
        return self.mean + half + self.truncation[1]

    def summary(self) -> str:
        """Return the result in one line of text."""
        interval = self.interval
        return (
            f"{len(self.returns)} trials, {self.steps} steps in {self.seconds:.2f} s: discounted reward"
            f" {interval.estimate:.6g} (95% confidence: {interval.low:.6g} to {interval.high:.6g})"
        )

    def __repr__(self) -> str:
        return f"<SimulationResult: {self.summary()}>"

    def _repr_html_(self) -> str:
        interval, (low, high) = self.interval, self.truncation
        rows = [
            ("trials", f"{len(self.returns)}"),
            ("mean discounted reward", f"{interval.estimate:.6g}"),
            ("95% interval", f"{interval.low:.6g} to {interval.high:.6g}"),
            ("standard deviation", f"{self.standard_deviation:.6g}"),
            ("steps", f"{self.steps}, {float(self.lengths.mean()):.3g} a trial"),
            ("cut off", f"{self.unfinished}; effect on the mean {low:.3g} to {high:.3g}"),
        ]
        return html_table(("quantity", "value"), rows, caption="Simulation")


def simulate(
    pomdp: Pomdp,
    policy: Policy,
    *,
    trials: int = 10_000,
    steps: int = 100,
    seed: int,
    start: npt.ArrayLike | None = None,
    traces: int = 0,
    world: Pomdp | None = None,
) -> SimulationResult:
    """Simulate a policy, many trials at once.

    A trial draws its hidden state from the start belief. The policy depends on the observations only; rewards
    are scored from the hidden state. A trial ends if all further rewards are zero: in a state from which no
    reward is reachable, or at a belief that never changes again under the policy and earns nothing.

    Beliefs have 40 binary digits and are shared by all trials (`belief_graph`), so that each is computed
    once. A trial depends on the model, the policy, the seed and its number only: the first hundred of a
    thousand trials equal the hundred trials of the same seed.

    Args:
        pomdp: the model. policy: for this model.
        trials: how many, from 1. steps: the maximal length of a trial, from 1.
        seed: an integer from 0.
        start: (S,) the start belief; the model's own when None.
        traces: how many trials are returned step by step.
        world: what happens, if it is not as the model states; the policy's beliefs are still those of the
            model. Its actions and observations are those of the model, its states and rewards its own.

    Raises:
        ModelError: `start` is not a distribution over the states, or an argument is out of range; or the
            discount is 1 and some policy may never end; or the world has other actions or observations.
        PolicyError: the policy is for another model.
        ObservationError: rounding has removed the hidden state from a belief; the message names it.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> from lcorpp.planning import simulate
        >>> pomdp = load_domain("intention").pomdp
        >>> result = simulate(pomdp, solve(pomdp).policy, trials=1000, seed=0)
        >>> round(result.mean, 1)
        66.1
    """
    check_same_model(pomdp, policy)
    for name, number, minimum in (("trials", trials, 1), ("steps", steps, 1), ("traces", traces, 0)):
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < minimum:
            raise ModelError(f"{name} is a whole number from {minimum}, not {number!r}")
    belief = check_belief(pomdp, pomdp.start if start is None else start)
    began = monotonic()
    if world is not None and (world.actions, world.observations) != (pomdp.actions, pomdp.observations):
        raise ModelError("the world has other actions or observations than the model; expected the same")
    rollout = BatchRollout(pomdp, policy, SparseBeliefs.of(belief[None]), np.ones(1), seed, world)
    pomdp = rollout.pomdp
    returns, lengths = np.zeros(trials), np.zeros(trials, dtype=np.intp)
    rewards = np.zeros(steps)
    reward_of_row = pomdp.reward.reshape(-1)
    unfinished = 0
    for block in rollout.blocks(trials):
        weight = 1.0
        for step in rollout.steps(block, steps):
            earned = reward_of_row.take(step.rows)
            returns[block][step.trials] += weight * earned
            lengths[block][step.trials] += 1
            rewards[step.number] += earned.sum()
            weight *= pomdp.discount
            if step.number == steps - 1:
                unfinished += int(np.count_nonzero(~step.ended))
    # the largest expected (discounted) number of further steps
    future = DiscountedForm.of(pomdp).weights.max() if pomdp.discount == 1 else 1 / (1 - pomdp.discount)
    ahead = unfinished / trials * pomdp.discount**steps * float(future)
    low, high = min(float(reward_of_row.min()), 0.0), max(float(reward_of_row.max()), 0.0)
    return SimulationResult(
        returns=returns,
        lengths=lengths,
        rewards=rewards / trials,
        unfinished=unfinished,
        truncation=(ahead * low + 0.0, ahead * high),  # adding 0 turns -0 into 0
        spread=(high - low) * float((pomdp.discount ** np.arange(steps)).sum()),
        traces=_record_traces(pomdp, rollout, min(traces, trials), steps),
        beliefs=rollout.beliefs,
        seconds=monotonic() - began,
    )


def _record_traces(pomdp: Pomdp, rollout: BatchRollout, count: int, steps: int) -> tuple[Trace, ...]:
    """Repeat the first trials and record them."""
    S = len(pomdp.states)
    traces: list[Trace] = []
    for block in rollout.blocks(count):
        recorded = list(rollout.steps(block, steps))
        _, start_states = rollout.start_states(block)
        trials, *columns = (
            np.concatenate([np.zeros(0, dtype=np.intp), *(getattr(step, field) for step in recorded)])
            for field in ("trials", "rows", "states", "observations")
        )
        order = np.argsort(trials, kind="stable")
        ends = np.searchsorted(trials[order], np.arange(len(start_states) + 1))
        for i, start in enumerate(start_states):
            rows, states, observations = (column[order[ends[i] : ends[i + 1]]] for column in columns)
            rewards = pomdp.reward.reshape(-1)[rows]
            traces.append(Trace(np.append(start, states), rows // S, observations, rewards))
    return tuple(traces)

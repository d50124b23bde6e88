"""A policy tried out: thousands of trials at once, the hidden state drawn and paid for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.evaluation.rollout import BatchRollout
from lcorpp.planning.evaluation.sparse_beliefs import Indices, SparseBeliefs
from lcorpp.planning.planner import check_same_model
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

CONFIDENCE = 0.95
"""How often an interval holds the truth."""


def interval(drawn: Array, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """The confidence interval of the mean of independent draws (n,), by Student's t.

    It is without end for a single draw.
    """
    from scipy.special import stdtrit

    n, mean = len(drawn), float(drawn.mean())
    if n < 2:
        return -np.inf, np.inf
    half = float(stdtrit(n - 1, (1 + confidence) / 2) * drawn.std(ddof=1) / np.sqrt(n))
    return mean - half, mean + half


@dataclass(frozen=True, eq=False)
class Trace:
    """What happened in one trial of L steps.

    states: (L + 1,) the hidden states, the last one being where it ended or was cut off.
    actions, observations: (L,) indices; an observation is made in the state that the action led to.
    rewards: (L,) what each action earned.
    """

    states: Indices
    actions: Indices
    observations: Indices
    rewards: Array


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """What a policy earned in n trials of at most T steps.

    returns: (n,) the discounted reward of each trial.
    lengths: (n,) the steps each took before nothing more could be earned, at most T.
    rewards: (T,) the mean reward of each step, not discounted; a trial that has ended earns 0.
    unfinished: the trials that were cut off at T.
    rest: what those might still have added to the mean, at least and at most.
    beliefs: how many beliefs were worked out. seconds: wall-clock time used.
    traces: the first trials step by step, as many as were asked for.
    """

    returns: Array
    lengths: Indices
    rewards: Array
    unfinished: int
    rest: tuple[float, float]
    beliefs: int
    seconds: float
    traces: tuple[Trace, ...] = ()

    @property
    def steps(self) -> int:
        """The steps of all trials together."""
        return int(self.lengths.sum())

    @property
    def running(self) -> Array:
        """(T,) the share of trials that took each step."""
        taken = np.bincount(self.lengths, minlength=len(self.rewards) + 1)
        return taken[::-1].cumsum()[::-1][1:] / len(self.lengths)

    @property
    def mean(self) -> float:
        """The mean discounted reward."""
        return float(self.returns.mean())

    @property
    def deviation(self) -> float:
        """The standard deviation of the discounted reward; nan for a single trial."""
        return float(self.returns.std(ddof=1)) if len(self.returns) > 1 else float("nan")

    @cached_property
    def interval(self) -> tuple[float, float]:
        """The 95% confidence interval of the mean, `rest` left aside."""
        return interval(self.returns)

    def summary(self) -> str:
        """One line for people."""
        low, high = self.interval
        return (
            f"{len(self.returns)} trials, {self.steps} steps in {self.seconds:.2f} s: discounted reward"
            f" {self.mean:.6g} (95% confidence: {low:.6g} to {high:.6g})"
        )


def simulate(
    pomdp: Pomdp,
    policy: Policy,
    *,
    trials: int = 10_000,
    steps: int = 100,
    seed: int,
    start: npt.ArrayLike | None = None,
    traces: int = 0,
) -> SimulationResult:
    """Try a policy out, many trials at once.

    A trial draws its hidden state from the start belief and follows the policy, which sees the observations
    alone; what is earned is scored from the hidden state. A trial ends early where nothing more can be
    earned: in a state from which none that pays can be reached, or at a belief that never changes again
    under the policy and earns nothing.

    Beliefs are kept with 40 binary digits and shared by all trials (`belief_graph`), so each is worked out
    once. What comes of a trial depends on the model, the policy, the seed and the number of the trial alone:
    the first hundred of a thousand trials are the hundred trials of the same seed.

    Args:
        pomdp: the world. policy: made for it.
        trials: how many, from 1. steps: how long a trial is at most, from 1.
        seed: a whole number from 0.
        start: (S,) where trials begin; the model's own when None.
        traces: how many trials are told step by step.

    Raises:
        ModelError: `start` is not a distribution over the states, or a number is out of range.
        PolicyError: the policy is for another model.
        ObservationError: a belief has lost the hidden state to rounding; it is named.
    """
    check_same_model(pomdp, policy)
    for name, number, least in (("trials", trials, 1), ("steps", steps, 1), ("traces", traces, 0)):
        if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
            raise ModelError(f"{name} is a whole number from {least}, not {number!r}")
    belief = check_belief(pomdp, pomdp.start if start is None else start)
    began = monotonic()
    walk = BatchRollout(pomdp, policy, SparseBeliefs.of(belief[None]), np.ones(1), seed)
    returns, lengths = np.zeros(trials), np.zeros(trials, dtype=np.intp)
    rewards = np.zeros(steps)
    paid = pomdp.reward.reshape(-1)
    unfinished = 0
    for block in walk.blocks(trials):
        worth = 1.0
        for step in walk.steps(block, steps):
            earned = paid.take(step.rows)
            returns[block][step.trials] += worth * earned
            lengths[block][step.trials] += 1
            rewards[step.number] += earned.sum()
            worth *= pomdp.discount
            if step.number == steps - 1:
                unfinished += int(np.count_nonzero(~step.ended))
    cut = unfinished / trials * pomdp.discount**steps / (1 - pomdp.discount)
    told = _traces(pomdp, walk, min(traces, trials), steps)
    return SimulationResult(
        returns=returns,
        lengths=lengths,
        rewards=rewards / trials,
        unfinished=unfinished,
        rest=(cut * min(float(paid.min()), 0.0) + 0.0, cut * max(float(paid.max()), 0.0)),  # no -0
        beliefs=walk.made,
        seconds=monotonic() - began,
        traces=told,
    )


def _traces(pomdp: Pomdp, walk: BatchRollout, count: int, steps: int) -> tuple[Trace, ...]:
    """The first trials, walked once more and noted."""
    S = len(pomdp.states)
    traces: list[Trace] = []
    for block in walk.blocks(count):
        noted = list(walk.steps(block, steps))
        _, starts = walk.starts(block)
        trials = np.concatenate([np.zeros(0, dtype=np.intp), *(step.trials for step in noted)])
        order = np.argsort(trials, kind="stable")
        ends = np.searchsorted(trials[order], np.arange(len(starts) + 1))
        for i, start in enumerate(starts):
            own = order[ends[i] : ends[i + 1]]
            rows, states, seen = (
                np.concatenate([np.zeros(0, dtype=np.intp), *(getattr(step, kind) for step in noted)])[own]
                for kind in ("rows", "states", "observations")
            )
            traces.append(Trace(np.append(start, states), rows // S, seen, pomdp.reward.reshape(-1)[rows]))
    return tuple(traces)

"""Expected counts of the parameters of a POMDP, given episodes whose states are hidden; and their prior.

Sources: Baum, Petrie, Soules and Weiss, Annals of Mathematical Statistics 41, 1970; with actions, Chrisman,
Reinforcement learning with perceptual aliasing, AAAI 1992.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.latent_classes import normalise
from lcorpp.model_learning import _episodes
from lcorpp.model_learning.episodes import Episodes
from lcorpp.model_learning.spaces import Space
from lcorpp.values import Array, Indices

PRIOR_STEPS = (0.5, 2.0, 0.05)
"""Weights of the prior, in steps, of a row of transitions, observations and rewards: answers of few people
are overrated by a policy, and rewards hardly vary."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """Tables of a POMDP with K hidden states; the state K is the end of a decision.

    start: (K,). transition: (A, K, K + 1) P(s' | s, a). observation: (A, K + 1, O) P(o | a, s').
    reward: (A, K, V) P(r | a, s) of each different reward.
    """

    start: Array
    transition: Array
    observation: Array
    reward: Array

    @property
    def count(self) -> int:
        """K."""
        return len(self.start)


@dataclass(frozen=True, eq=False)
class Expectation:
    """Expected counts in the form of `Parameters`, and the log-likelihood of each episode (N,)."""

    counts: Parameters
    log_likelihoods: Array


def expect(
    episodes: Episodes,
    parameters: Parameters,
    values: Indices | None = None,
    rng: np.random.Generator | None = None,
) -> Expectation:
    """Return the expected counts of all steps, given the episodes (forward-backward algorithm).

    values: (K,) the shared value of each state, to which the evidence of episodes refers; None ignores it.
    rng: with it, the counts are those of paths of states that are drawn given the episodes.
    """
    evidence = None if values is None or episodes.evidence is None else episodes.evidence[:, values]
    *counts, logs = _episodes.expect(
        parameters.start,
        parameters.transition,
        parameters.observation,
        parameters.reward,
        episodes.actions,
        episodes.observations,
        episodes.rewards,
        episodes.begins,
        episodes.ended,
        evidence if evidence is None else np.ascontiguousarray(evidence),
        None if rng is None else rng.random(len(episodes.actions) + len(episodes)),
    )
    return Expectation(Parameters(*counts), logs)


@dataclass(frozen=True, eq=False)
class Prior:
    """Pseudo-counts in the form of `Parameters`: rows are pulled to what an action does on average.

    An action without steps in a state is so expected to end as often as elsewhere, or else to leave the state
    as it is; observations and rewards are those of the action in all states.
    """

    transition_end: Array
    observation: Array
    reward: Array
    steps: tuple[float, float, float] = PRIOR_STEPS

    @classmethod
    def of(cls, episodes: Episodes, steps: tuple[float, float, float] = PRIOR_STEPS) -> Prior:
        """Return the prior of some episodes."""
        A = len(episodes.action_names)
        steps_of = np.bincount(episodes.actions, minlength=A)
        ends = np.bincount(episodes.actions[episodes.is_end], minlength=A)
        observed = np.zeros((2, A, len(episodes.observation_names)))
        rewards = np.zeros((A, len(episodes.reward_values)))
        np.add.at(observed, (episodes.is_end.astype(int), episodes.actions, episodes.observations), 1)
        np.add.at(rewards, (episodes.actions, episodes.rewards), 1)
        total = observed.sum(axis=0)
        observed += 1e-3 * (total + 1 / total.shape[1])[None]
        return cls(
            ends / np.maximum(steps_of, 1),
            normalise(observed),
            normalise(rewards + 1e-9),
            steps,
        )

    def pseudo_counts(self, count: int, space: Space) -> Parameters:
        """Return the pseudo-counts for K states."""
        A, starts = len(self.transition_end), space.count_starts(count)
        transition = np.zeros((A, count, count + 1))
        transition[:, np.arange(count), np.arange(count)] = (1 - self.transition_end)[:, None]
        transition[:, :, count] = self.transition_end[:, None]
        observation = np.repeat(self.observation[0][:, None], count + 1, axis=1)
        observation[:, count] = self.observation[1]
        reward = np.repeat(self.reward[:, None], count, axis=1)
        return Parameters(
            np.where(np.arange(count) < starts, 1 / starts, 0.0),
            *(steps * own for steps, own in zip(self.steps, (transition, observation, reward), strict=True)),
        )

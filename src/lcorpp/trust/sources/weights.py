"""Weights of sources, together with the noise of the answers by which they are judged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lcorpp.errors import DecisionError
from lcorpp.trust.answers import AnswerModel, find_degree
from lcorpp.values import Array

KNOWLEDGE_SHARE = 0.4
"""Weight of the knowledge before the first person, and its part of the fixed share: where no source predicts
better, what is stated is used."""

ESTIMATE_SHARE = 0.5
"""Weight of the estimated observation model against fixed noise, before the first person and in the share."""

FIXED_NOISE = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95)
"""Degrees of noise beside the estimate, see `AnswerModel`."""


class SourceWeights:
    """P(source, noise | answers of all people so far).

    A source gains weight by the probability that it gives to the answers. That depends on their noise: if
    answers are noisier than estimated, a few people refute a source that is right. So each source is weighed
    together with each of several noises: that of the estimates, and fixed ones, which need no people to be
    learnt. The fixed noise applies to the first group of questions and those that follow it; other groups
    have the estimated one.

    The noisier answers are, the less they can refute a source that is wrong. So with a fixed noise d, the
    source without evidence has the weight d more, and all have 1 - d of theirs, before the first person.

    joint: (1 + N, sources) summing to 1; the first row is for the estimates.

    Args:
        n_sources: their number; the first one is the knowledge. no_evidence: index of the source without
            evidence. answers: the stated observation model.
        share: alpha, the probability that another pair becomes the best one between two people.

    Source: as of `Trust` (fixed share).
    """

    def __init__(self, n_sources: int, no_evidence: int, answers: AnswerModel, share: float) -> None:
        self._share, self._answers = share, answers
        degrees = [find_degree(noise) for noise in FIXED_NOISE]
        self._fixed: Array = answers.noisy_log_likelihoods[degrees]  # (N, D, W)
        self._is_fixed = answers.follows_first_group  # (D, W)
        noise = np.full(1 + len(FIXED_NOISE), (1 - ESTIMATE_SHARE) / len(FIXED_NOISE))
        noise[0] = ESTIMATE_SHARE
        sources = np.full(n_sources, (1 - KNOWLEDGE_SHARE) / (n_sources - 1))
        sources[0] = KNOWLEDGE_SHARE
        degree = np.array([0.0, *FIXED_NOISE])[:, None]
        self._start: Array = noise[:, None] * (
            (1 - degree) * sources + degree * np.eye(n_sources)[no_evidence]
        )
        self.joint = self._start

    @property
    def of_sources(self) -> Array:
        """(sources,) P(source)."""
        weights: Array = self.joint.sum(axis=0)
        return weights

    @property
    def of_noises(self) -> Array:
        """(1 + N,) P(noise)."""
        weights: Array = self.joint.sum(axis=1)
        return weights

    @property
    def stated_loss(self) -> float:
        """Log Bayes factor of the most probable fixed noise against the stated observation model."""
        gains = np.log(self.of_noises[1:] / self._start.sum(axis=1)[1:])
        return float(gains.max() - gains[FIXED_NOISE.index(0.0)])

    def compute_mean_rows(self, estimated: Array) -> Array:
        """Return the mean of the rows (R, O) over the noises.

        Args:
            estimated: (R, O) the rows of the estimates.
        """
        fixed = [self._answers.fix_noise(noise, estimated) for noise in FIXED_NOISE]
        mean: Array = np.tensordot(self.of_noises, np.array([estimated, *fixed]), 1)
        return mean

    def compute_log_likelihoods(self, answers: Sequence[int], estimated: Array) -> Array:
        """Return (1 + N, W) log P(answers | value) at each noise.

        Args:
            answers: index of each. estimated: (D, W) log P(answer | value) by the estimates.
        """
        given = list(answers)
        own = estimated[given]
        fixed = np.where(self._is_fixed[given], self._fixed[:, given], own)
        logs: Array = np.vstack([own.sum(axis=0), fixed.sum(axis=1)])
        return logs

    def compute_joint(self, rows: Array, likelihoods: Array) -> Array:
        """Return (W,) P(value, answers).

        Args:
            rows: (sources, W) P(value) of each source.
            likelihoods: (1 + N, W) P(answers | value) at each noise, up to a common factor.
        """
        joint: Array = ((self.joint @ rows) * likelihoods).sum(axis=0)
        return joint

    def update(self, new: Array, same: Array | None = None) -> None:
        """Weigh the pairs by the answers of a person.

        Args:
            new: (1 + N, sources) P(answers) by each pair, up to a common factor.
            same: (1 + N,) the same if the value of a known person persists, of which the sources predict
                nothing; both contain the probability of their case. None for a person without a record.
        """
        weights = self.joint * (new if same is None else new + same[:, None])
        self.joint = (1 - self._share) * weights / weights.sum() + self._share * self._start

    def state(self) -> list[list[float]]:
        """Return the weights as JSON."""
        rows: list[list[float]] = self.joint.tolist()
        return rows

    def restore(self, state: Any) -> None:
        """Replace the weights by those of a state.

        Raises:
            DecisionError: they are no probabilities. TypeError, ValueError: no numbers of this shape.
        """
        joint = np.array(state, np.float64).reshape(self.joint.shape)
        if not (np.isfinite(joint).all() and (joint >= 0).all() and abs(joint.sum() - 1) < 1e-6):
            raise DecisionError("the state of trust is damaged: the weights of sources do not sum to 1")
        self.joint = joint

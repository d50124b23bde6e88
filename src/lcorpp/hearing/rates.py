"""Rates of a measurement: P(heard | said, noise), their mix over noises, and the observation model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lcorpp.hearing.answers import SaidModel
from lcorpp.planning import Pomdp, SparseTables
from lcorpp.values import Array, Indices, Interval
from lcorpp.values.probabilities import MIN_ROUNDED

PSEUDO_COUNT = 0.5
"""Added to each count of what was heard, so that nothing is impossible (Jeffreys)."""

DRAWS = 400
"""Number of bootstrap samples of the sentences."""


@dataclass(frozen=True, eq=False)
class HeardCases:
    """What was heard in n cases, as indices.

    said: (n,) of K kinds. noise: (n,) of W noises. sentence: (n,) equal numbers for equal sentences.
    heard: (n,) of the observations of the measured model.
    kinds, noises, observations: the names. shares: (W,) of the noises in the mix.
    """

    said: Indices
    noise: Indices
    sentence: Indices
    heard: Indices
    kinds: tuple[str, ...]
    noises: tuple[str, ...]
    shares: Array
    observations: tuple[str, ...]

    def count(self, weights: Array | None = None) -> Array:
        """Return the numbers (K, W, O) of cases, each case counted with its weight (n,)."""
        counts = np.zeros((len(self.kinds), len(self.noises), len(self.observations)))
        np.add.at(counts, (self.said, self.noise, self.heard), 1.0 if weights is None else weights)
        return counts

    def estimate(self, counts: Array) -> Array:
        """Return P(heard | said) (K, O) in the mix of noises, with pseudo-counts."""
        smooth = counts + PSEUDO_COUNT
        rates = smooth / smooth.sum(axis=2, keepdims=True)
        mixed: Array = np.einsum("w,kwo->ko", self.shares, rates)
        return mixed

    def interval(self, kind: str, noise: str | None, observations: Sequence[str]) -> tuple[Interval, int]:
        """Return P(one of `observations` | said, noise) with its Wilson interval, and the number of cases.

        A noise of None takes all cases as one sample, whatever their noise.
        """
        chosen = self.said == self.kinds.index(kind)
        if noise is not None:
            chosen &= self.noise == self.noises.index(noise)
        hits = np.isin(self.heard[chosen], [self.observations.index(name) for name in observations]).sum()
        return Interval.from_count(float(hits), float(chosen.sum())), int(chosen.sum())


def make_observation_rows(rates: Array, said: SaidModel) -> Array:
    """Return O(z | a, s') (A, S, O), the sum over what is said of P(said | a, s') P(heard | said)."""
    rows: Array = said.probabilities @ rates
    return rows


def make_model(stated: Pomdp, observations: Sequence[str], rates: Array, said: SaidModel) -> Pomdp:
    """Return a model with measured observations.

    Args:
        stated: gives states, transitions, rewards, and the rows that are not measured.
        observations: (O,) names; those that the stated model lacks have probability 0 in its rows.
        rates: (K, O) P(heard | said).
    """
    rows = make_observation_rows(rates, said)
    kept = said.is_measured == 0
    dense = stated.observation.dense
    for place, name in enumerate(observations):
        column = dense[:, :, stated.observations.index(name)] if name in stated.observations else 0.0
        rows[:, :, place] = np.where(kept, column, rows[:, :, place])
    rows[~kept] = round_rows(rows[~kept])
    return replace(
        stated, observations=tuple(observations), observation=SparseTables.of(rows), file=stated.file
    )


def round_rows(rows: Array) -> Array:
    """Return distributions (n, O) with four decimals that sum to 1, each at least `MIN_ROUNDED`."""
    rounded = np.maximum(np.round(rows, 4), MIN_ROUNDED)
    largest = np.argmax(rounded, axis=1)
    index = np.arange(len(rows))
    rounded[index, largest] = 0
    rounded[index, largest] = np.round(1 - rounded.sum(axis=1), 4)
    return rounded


def find_row_intervals(cases: HeardCases, said: SaidModel, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the ends (A, S, O) of 95 % intervals of the measured rows.

    By a bootstrap of the sentences: utterances of one sentence are right or wrong together.
    """
    sentences, index = np.unique(cases.sentence, return_inverse=True)
    kind_of = np.zeros(len(sentences), np.intp)
    kind_of[index] = cases.said
    draws = []
    for _ in range(DRAWS):
        weights = np.zeros(len(sentences))
        for kind in range(len(cases.kinds)):
            own = np.flatnonzero(kind_of == kind)
            if len(own):
                weights[own] = np.bincount(rng.integers(len(own), size=len(own)), minlength=len(own))
        draws.append(make_observation_rows(cases.estimate(cases.count(weights[index])), said))
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return low, high

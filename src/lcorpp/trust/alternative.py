"""The search for other credible estimates of a latent class model, in which two values are exchanged."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from lcorpp.trust.estimates import Estimates
from lcorpp.trust.latent_class_model import LatentClassModel

MAX_LEAD = 6.0
"""Estimates are credible if their log posterior is at most this much lower than that of the most probable."""

MIN_VARIATION = 0.1
"""Estimates differ if P(value) does by at least this, in total variation, on average over people."""


class AlternativeSearch:
    """Looks for estimates with two values exchanged, and chooses between them and those in use.

    Exchanging two values in pi and C, but not in O, changes the probabilities of the answers. If few people
    have answered, both estimates may be credible, one of them with answers that are mostly noise. A robot
    that believes it does not ask, and does not learn that it is wrong. So of two credible estimates the model
    uses those with less noise, and people are asked until only one is credible.

    Args:
        model: its `estimates` and `alternative` are replaced.

    n_searches: number of searches so far.
    """

    def __init__(self, model: LatentClassModel) -> None:
        self._model, self.n_searches = model, 0
        rows = model.answers.row_of
        self._pairs = [  # of values that some answer distinguishes
            (a, b) for a, b in combinations(range(rows.shape[1]), 2) if (rows[:, a] != rows[:, b]).any()
        ]

    def search(self, iterations: int) -> bool:
        """Unless there is an alternative, look for one, and choose.

        EM runs from the estimates in use with two values exchanged and the first observation model. Pairs
        of values are exchanged in turn, one in each call.

        Returns:
            Whether the estimates in use are those found.
        """
        model = self._model
        if not self._pairs or model.alternative is not None:
            return False
        start = model.estimates.exchange(*self._pairs[self.n_searches % len(self._pairs)])
        self.n_searches += 1
        start = replace(start, rows=model.answers.start_rows)
        model.alternative = model.iterate(start, iterations)
        return self.choose()

    def choose(self) -> bool:
        """Use the more probable estimates, of two credible ones those with less noise.

        The others remain as the alternative if they are credible and differ.

        Returns:
            Whether the estimates in use were the alternative before.
        """
        model = self._model
        used, other = model.estimates, model.alternative
        if other is None:
            return False
        lead = model.compute_log_posterior(used) - model.compute_log_posterior(other)
        both = (used, other) if lead >= 0 else (other, used)
        if abs(lead) <= MAX_LEAD and self._compute_variation(used, other) >= MIN_VARIATION:
            both = (used, other) if used.mean_noise <= other.mean_noise else (other, used)
            model.estimates, model.alternative = both
        else:
            model.estimates, model.alternative = both[0], None
        return model.estimates is other

    def _compute_variation(self, one: Estimates, other: Estimates) -> float:
        """Return the total variation of P(value | context, labels, answers), on average over people."""
        weights = self._model.cases.weights
        changes = np.abs(self._model.classify_cases(one) - self._model.classify_cases(other)).sum(axis=1)
        return float(weights @ changes / max(weights.sum(), 1)) / 2

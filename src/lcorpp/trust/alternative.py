"""Other credible estimates of a latent class model, in which two values are exchanged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from lcorpp.trust.estimates import Estimates
from lcorpp.trust.latent_class import LatentClassModel

MAX_LEAD = 6.0
"""Estimates are credible if their log posterior is at most this much lower than that of the most probable."""

MIN_VARIATION = 0.1
"""Estimates differ if P(value) does by at least this, in total variation, on average over people."""


class Alternative:
    """Estimates with two values exchanged, beside those in use, as long as both are credible.

    Exchanging two values in pi and C needs other answers (label switching): if labels and contexts suggest
    the contrary of the truth, and few people have answered, answers seem to be noise. A robot that believes
    this does not ask, and does not learn that they are not. So of two credible estimates the model uses those
    with less noise, and people are asked until only one is credible.

    estimates: those that are not in use; None if no others are credible.

    Args:
        model: whose estimates are compared and replaced.
    """

    def __init__(self, model: LatentClassModel) -> None:
        self._model = model
        self._pairs = list(combinations(range(model.n_values), 2))
        self._n_exchanges = 0
        self.estimates: Estimates | None = None

    def fit(self, iterations: int) -> None:
        """Run EM on the alternative, if there is one, and choose again."""
        if self.estimates is not None:
            self._choose(self._model.iterate(self._model.add_contexts(self.estimates), iterations))

    def exchange(self, iterations: int) -> None:
        """Unless there is an alternative, look for one.

        EM runs from the estimates in use with two values exchanged and the stated answers. Pairs of values
        are exchanged in turn, one in each call.
        """
        if self._pairs and self.estimates is None:
            first, second = self._pairs[self._n_exchanges % len(self._pairs)]
            self._n_exchanges += 1
            start = self._model.estimates.exchange(first, second)
            start = replace(start, rows=self._model.answers.stated_rows)
            self._choose(self._model.iterate(start, iterations))

    def forget(self) -> None:
        """Forget the alternative."""
        self.estimates = None

    def state(self) -> dict[str, Any]:
        """Return the state as JSON."""
        estimates = None if self.estimates is None else self._model.add_contexts(self.estimates).state()
        return {"exchanges": self._n_exchanges, "estimates": estimates}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state; the model has its contexts already."""
        self._n_exchanges = int(state["exchanges"])
        estimates = state["estimates"]
        self.estimates = None if estimates is None else self._model.estimates.restore(estimates)

    def _choose(self, found: Estimates) -> None:
        """Choose the estimates in use, and the alternative, from both and those found."""
        model, used = self._model, self._model.estimates
        scores = {used: model.compute_log_posterior(used), found: model.compute_log_posterior(found)}
        best = max(scores, key=scores.__getitem__)
        lead = abs(scores[used] - scores[found])
        self.estimates = None
        if lead > MAX_LEAD or self._compare(used, found) < MIN_VARIATION:
            model.estimates = best
        else:
            model.estimates, self.estimates = sorted((used, found), key=lambda estimates: estimates.noise)

    def _compare(self, one: Estimates, other: Estimates) -> float:
        """Return the total variation of P(value | context, labels, answers), on average over people."""
        weights = self._model.cases.weights
        changes = np.abs(self._model.classify_cases(one) - self._model.classify_cases(other)).sum(axis=1)
        return float(weights @ changes / max(weights.sum(), 1)) / 2

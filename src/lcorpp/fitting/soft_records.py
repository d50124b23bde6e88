"""Records with soft evidence: each is a mixture of records without."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.fitting.expectation import Expectation, Expected
from lcorpp.values import Array


class SoftExpectation:
    """The expectation step for n records of which some terms are known by a likelihood only.

    A record with soft evidence is the mixture of the records that state its hidden values, weighed by the
    likelihood of these values (virtual evidence). As the stated records are few, so are the passes.

    Args:
        stated: the expectation step of the records that the mixtures consist of.
        parts: (n, V) the index of a stated record for each of V values.
        likelihoods: (n, V) P(what was observed | value), up to a factor for each record.
        repeats: (n,) how often each record occurs.
    """

    def __init__(
        self, stated: Expectation, parts: npt.NDArray[np.intp], likelihoods: Array, repeats: Array
    ) -> None:
        self._stated, self._parts, self._repeats = stated, parts, repeats
        self._likelihoods = likelihoods

    def compute(self, values: Array) -> Expected:
        """Compute the expected counts, given the values of the forms (f,)."""
        stated = self._stated.compute(values)
        log_p, shares = self._mix(stated)
        counts = np.einsum("fnv,nv->fn", stated.counts[:, self._parts], shares)
        special = stated.counts[:, -2:]  # a draw that is not rejected, and one that is
        n_rejected = self._repeats.sum() * np.exp(stated.log_p[-1] - stated.log_p[-2])
        return Expected(
            np.append(log_p, stated.log_p[-2:]),
            np.append(self._repeats, [0.0, n_rejected]),
            np.hstack([counts, special]),
        )

    def compute_shares(self, values: Array) -> Array:
        """Compute (n, V) the probability of each value, given the record."""
        return self._mix(self._stated.compute(values))[1]

    def _mix(self, stated: Expected) -> tuple[Array, Array]:
        """Return the log probabilities (n,) of the records, and the shares (n, V) of the mixtures."""
        p = np.exp(stated.log_p)[self._parts] * self._likelihoods
        total = p.sum(axis=1)
        with np.errstate(divide="ignore"):
            return np.log(total), p / np.where(total > 0, total, 1.0)[:, None]

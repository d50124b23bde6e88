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

    If the facts of a record are given, its probability is P(soft evidence | facts). It is as if draws were
    repeated until one has the facts, so that other draws are counted, too: a draw with the counts c adds
    (E[c] - P(facts) E[c | facts]) / P(facts).

    Source: Dempster, Laird and Rubin, "Maximum likelihood from incomplete data via the EM algorithm", JRSS B
    39(1), 1977, section 4.2 (truncated data).

    Args:
        stated: the expectation step of the records that the mixtures consist of.
        parts: (n, V) the index of a stated record for each of V values.
        likelihoods: (n, V) P(what was observed | value), up to a factor for each record.
        repeats: (n,) how often each record occurs.
        given: whether the facts of each record, which its parts share, are given.
    """

    def __init__(
        self,
        stated: Expectation,
        parts: npt.NDArray[np.intp],
        likelihoods: Array,
        repeats: Array,
        *,
        given: bool = False,
    ) -> None:
        self._stated, self._parts, self._repeats, self._given = stated, parts, repeats, given
        self._likelihoods = likelihoods
        self._facts, facts_of = np.unique(parts, axis=0, return_inverse=True)
        self._facts_of = facts_of.reshape(-1)

    def compute(self, values: Array) -> Expected:
        """Compute the expected counts, given the values of the forms (f,)."""
        stated = self._stated.compute(values)
        log_p, shares, others = self._mix(stated)
        counts = np.einsum("fnv,nv->fn", stated.counts[:, self._parts], shares) + others[:, self._facts_of]
        return Expected(
            np.append(log_p, stated.log_p[-2:]),
            np.append(self._repeats, [0.0, self._count_rejected(stated)]),
            np.hstack([counts, stated.counts[:, -2:]]),  # a draw that is not rejected, and one that is
        )

    def sum_counts(self, values: Array) -> tuple[float, Array]:
        """Compute the log likelihood of the records, and the sum (f,) of the counts, see `compute`."""
        stated = self._stated.compute(values)
        log_p, shares, others = self._mix(stated)
        sizes = np.bincount(self._parts.ravel(), (shares * self._repeats[:, None]).ravel())
        counts = stated.counts[:, : len(sizes)] @ sizes
        counts += others @ np.bincount(self._facts_of, self._repeats)
        counts += stated.counts[:, -1] * self._count_rejected(stated)
        return float((log_p - stated.log_p[-2]) @ self._repeats), counts

    def compute_shares(self, values: Array) -> Array:
        """Compute (n, V) the probability of each value, given the record."""
        return self._mix(self._stated.compute(values))[1]

    def _mix(self, stated: Expected) -> tuple[Array, Array, Array]:
        """Return the log probabilities (n,) of the records, the shares (n, V) of the mixtures, and the counts
        (f, facts) of the draws with other facts: 0 if the facts are not given.
        """
        stated_p = np.exp(stated.log_p)
        p = stated_p[self._parts] * self._likelihoods
        total = p.sum(axis=1)
        shares = p / np.where(total > 0, total, 1.0)[:, None]
        others = np.zeros((len(stated.counts), len(self._facts)))
        with np.errstate(divide="ignore"):
            log_p = np.log(total)
        if self._given:
            p_facts = stated_p[self._facts].sum(axis=1)
            p_facts[p_facts == 0] = 1.0  # log_p is -inf
            log_p += stated.log_p[-2] - np.log(p_facts)[self._facts_of]
            joint = stated.counts * stated_p
            draw = joint[:, -2] + joint[:, -1]
            others = np.maximum(draw[:, None] - joint[:, self._facts].sum(axis=2), 0.0) / p_facts
        return log_p, shares, others

    def _count_rejected(self, stated: Expected) -> float:
        """Return how many draws were rejected; those with other facts are counted by `_mix`."""
        if self._given:
            return 0.0
        return float(self._repeats.sum() * np.exp(stated.log_p[-1] - stated.log_p[-2]))

"""Expected counts: an upward and a downward pass over a decision diagram, for many records at once.

Constraints reject worlds: n records imply that about ``n P(rejected) / P(not rejected)`` other draws were
rejected, and these are counted as one more record.

Source: Darwiche, "A differential approach to inference in Bayesian networks", JACM 50(3), 2003; Ishihata,
Kameya, Sato and Minato, "Propositionalizing the EM algorithm by BDDs", ILP 2008; rejected draws, Dempster,
Laird and Rubin, "Maximum likelihood from incomplete data via the EM algorithm", JRSS B 39(1), 1977.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from lcorpp.fitting.number_model import REJECTED, NumberModel
from lcorpp.values import Array

_Mask = npt.NDArray[np.bool_]
_Codes = npt.NDArray[np.intp]
_Matrix = sparse.csr_array | sparse.csc_array | Array

MAX_CELLS = 4_000_000
"""The passes have at most this many cells (arcs times records) in memory."""

MAX_DENSE_CELLS = 4096
"""Matrices with at most this many cells are dense, as calls of sparse ones take longer than their sums."""


@dataclass(frozen=True, eq=False)
class Expected:
    """The expected counts of n distinct records, of a draw that is not rejected, and of one that is.

    log_p: (n + 2,) their log probabilities.
    repeats: (n + 2,) the number of records, 0, and the number of rejected draws.
    counts: (forms, n + 2) how often each form is a factor of the probability of one; 0 if it is impossible.
    """

    log_p: Array
    repeats: Array
    counts: Array

    @property
    def log_likelihood(self) -> float:
        """The log likelihood of the records."""
        return float((self.log_p[:-2] - self.log_p[-2]) @ self.repeats[:-2])


class _Step(NamedTuple):
    """The arcs of a step, see `Arcs`; the matrices sum over them.

    agrees: (arcs, n) whether they agree with the records; (arcs, 1) if no record observes the terms.
    branches: the child, the target of each arc in it, and (nodes, arcs).
    by_source, by_form: (nodes, arcs) and (forms, arcs).
    """

    sources: _Codes
    outcomes: _Codes
    agrees: _Mask
    branches: Sequence[tuple[int, _Codes, _Matrix]]
    by_source: _Matrix
    by_form: _Matrix


class Expectation:
    """The expectation step.

    Args:
        records: canonical term -> value, for each distinct record.
        repeats: (n,) how often each occurs.
    """

    def __init__(self, model: NumberModel, records: Sequence[Mapping[str, str]], repeats: Array) -> None:
        self._model, self._repeats, diagram = model, repeats, model.diagram
        system, tree, sizes = diagram.system, diagram.system.tree, diagram.sizes
        evidence = [*[{**record, REJECTED: ""} for record in (*records, {})], {REJECTED: "true"}]
        codes: dict[int, _Codes] = {}  # term -> its outcome in each record, -1 if it is not observed
        for i, record in enumerate(evidence):
            for name, value in record.items():
                term = system.term_numbers[name]
                values = system.program.values[term]
                own = codes.setdefault(term, np.full(len(evidence), -1))
                own[i] = values.index(value) if value else len(values)
        self._steps: list[_Step] = []
        for arcs, size, children, terms in zip(diagram.arcs, sizes, tree.children, tree.order, strict=True):
            outcomes = np.array(arcs.outcomes, dtype=np.intp)
            agrees = np.ones((len(outcomes), 1), dtype=np.bool_)
            for i, term in enumerate(terms):
                if term in codes:
                    own = np.array([diagram.outcomes[outcome].values[i] for outcome in outcomes])
                    agrees = agrees & ((codes[term] < 0) | (own[:, None] == codes[term]))
            branches = [
                (child, np.array(targets), _make_sum(targets, sizes[child]))
                for child, targets in zip(children, arcs.targets, strict=True)
            ]
            by_source, by_form = _make_sum(arcs.sources, size), _choose_format(model.factors[:, outcomes])
            self._steps.append(_Step(np.array(arcs.sources), outcomes, agrees, branches, by_source, by_form))
        self._factors = model.factors.T.tocsr()  # sparse, as 0 log 0 is 0 here
        n_arcs = sum([len(step.outcomes) for step in self._steps])
        n, size = len(evidence), max(1, MAX_CELLS // max(n_arcs, 1))
        self._batches = [slice(start, min(start + size, n)) for start in range(0, n, size)]

    def compute(self, values: Array) -> Expected:
        """Compute the expected counts, given the values of the forms (f,)."""
        with np.errstate(divide="ignore"):
            weights = self._model.scales * np.exp(self._factors @ np.log(values))
            parts = [self._compute_batch(weights, batch) for batch in self._batches]
        log_p = np.concatenate([part[0] for part in parts])
        counts = np.concatenate([part[1] for part in parts], axis=1)
        n_rejected = self._repeats.sum() * np.exp(log_p[-1] - log_p[-2]) if np.isfinite(log_p[-2]) else 0.0
        return Expected(log_p, np.append(self._repeats, [0.0, n_rejected]), counts)

    def sum_counts(self, values: Array) -> tuple[float, Array]:
        """Compute the log likelihood of the records, and the sum (f,) of the expected counts."""
        expected = self.compute(values)
        return expected.log_likelihood, expected.counts @ expected.repeats

    def _compute_batch(self, weights: Array, batch: slice) -> tuple[Array, Array]:
        """Return the log probability (n,) and the expected counts (f, n) of n records."""
        diagram, n = self._model.diagram, batch.stop - batch.start
        counts = np.zeros((len(self._model.constants), n))
        if not diagram.has_worlds:
            return np.full(n, -np.inf), counts
        below: dict[int, Array] = {}  # step -> (nodes, n), scaled
        products: dict[int, Array] = {}  # step -> (arcs, n)
        log_p = np.zeros(n)
        for number in range(len(self._steps) - 1, -1, -1):
            step = self._steps[number]
            agrees = step.agrees if step.agrees.shape[1] == 1 else step.agrees[:, batch]
            product = weights[step.outcomes][:, None] * agrees
            for child, targets, _ in step.branches:
                product = product * below[child][targets]
            sums = step.by_source @ product
            scale = sums.max(axis=0)
            log_p += np.log(scale)
            below[number], products[number] = sums / np.where(scale > 0, scale, 1.0), product
        above: dict[int, Array] = {
            root: np.where(below[root] > 0, 1.0, 0.0) for root in diagram.system.tree.roots
        }
        for number, step in enumerate(self._steps):
            flow = above.pop(number)[step.sources] * products[number]
            total = flow.sum(axis=0)  # each world has one arc of each step
            flow /= np.where(total > 0, total, 1.0)
            counts += step.by_form @ flow
            for child, targets, by_target in step.branches:
                own = below[child][targets]
                above[child] = by_target @ np.divide(flow, own, out=np.zeros_like(flow), where=own > 0)
        counts[:, np.isinf(log_p)] = 0.0
        return log_p, counts


def _make_sum(groups: Sequence[int], size: int) -> _Matrix:
    """Make the matrix (size, n) that sums n numbers by group."""
    n = len(groups)
    return _choose_format(sparse.csr_array((np.ones(n), (groups, np.arange(n))), shape=(size, n)))


def _choose_format(matrix: sparse.csr_array | sparse.csc_array) -> _Matrix:
    """Return a matrix as a dense one if it is small."""
    return matrix.toarray() if np.prod(matrix.shape) <= MAX_DENSE_CELLS else matrix

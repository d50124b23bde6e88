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

import numpy as np
import numpy.typing as npt
from scipy import sparse

from lcorpp.reasoning.fitting.number_model import REJECTED, NumberModel
from lcorpp.values import Array

_Mask = npt.NDArray[np.bool_]

MAX_CELLS = 4_000_000
"""The passes have at most this many cells (arcs times records) in memory."""


@dataclass(frozen=True, eq=False)
class Expected:
    """The expected counts of n distinct records, and of the rejected draws after them.

    log_p: (n,) log probabilities of the records, of worlds that are not rejected.
    rejected: the probability of rejected worlds.
    repeats: (n + 1,) the number of records and of rejected draws.
    counts: (forms, n + 1) how often each form is a factor of the probability of one; 0 if it is impossible.
    """

    log_p: Array
    rejected: float
    repeats: Array
    counts: Array

    @property
    def log_likelihood(self) -> float:
        """The log likelihood of the records."""
        n_records = self.repeats[:-1].sum()
        return float(self.log_p @ self.repeats[:-1] - n_records * np.log1p(-self.rejected))


@dataclass(frozen=True, eq=False)
class _Step:
    """The arcs of a step, and sparse matrices that sum over them.

    children: the steps that follow it. sources, targets, outcomes: as in `Arcs`.
    by_source: (nodes, arcs). by_target: for each branch (its nodes, arcs). by_form: (forms, arcs).
    """

    children: Sequence[int]
    sources: npt.NDArray[np.intp]
    targets: Sequence[npt.NDArray[np.intp]]
    outcomes: npt.NDArray[np.intp]
    by_source: sparse.csr_array
    by_target: Sequence[sparse.csr_array]
    by_form: sparse.csc_array


class Expectation:
    """The expectation step.

    Args:
        records: canonical term -> value, for each distinct record.
        repeats: (n,) how often each occurs.
    """

    def __init__(self, model: NumberModel, records: Sequence[Mapping[str, str]], repeats: Array) -> None:
        self._model, self._repeats, diagram = model, repeats, model.diagram
        self._steps = []
        for step, arcs in enumerate(diagram.arcs):
            children = diagram.system.tree.children[step]
            sources, outcomes = np.array(arcs.sources), np.array(arcs.outcomes, dtype=np.intp)
            targets = [np.array(branch) for branch in arcs.targets]
            by_target = [
                _make_sum(t, diagram.sizes[child]) for t, child in zip(targets, children, strict=True)
            ]
            by_source, by_form = _make_sum(sources, diagram.sizes[step]), model.factors[:, outcomes]
            self._steps.append(_Step(children, sources, targets, outcomes, by_source, by_target, by_form))
        n_arcs = sum(len(step.outcomes) for step in self._steps)
        size = max(1, MAX_CELLS // max(n_arcs, 1))
        evidence = [*[{**record, REJECTED: ""} for record in records], {REJECTED: "true"}]
        self._batches = [
            self._find_agreement(evidence[start : start + size]) for start in range(0, len(evidence), size)
        ]

    def _find_agreement(self, evidence: Sequence[Mapping[str, str]]) -> tuple[_Mask, list[_Mask | None]]:
        """Return which records are possible so far, and for each step whether arcs agree with records."""
        diagram = self._model.diagram
        system = diagram.system
        possible = np.full(len(evidence), diagram.has_worlds)
        codes: dict[int, npt.NDArray[np.intp]] = {}  # term -> the outcome in each record, -1 for not observed
        for i, record in enumerate(evidence):
            for name, value in record.items():
                term = system.term_numbers[name]
                values = system.program.values[term]
                own = codes.setdefault(term, np.full(len(evidence), -1))
                own[i] = values.index(value) if value else len(values)
        agreement: list[_Mask | None] = []
        for terms, step in zip(system.tree.order, self._steps, strict=True):
            agrees: _Mask | None = None
            for i, term in enumerate(terms):
                if term in codes:
                    outcomes = np.array([diagram.outcomes[outcome][0][i] for outcome in step.outcomes])
                    own = (codes[term] < 0) | (outcomes[:, None] == codes[term])
                    agrees = own if agrees is None else agrees & own
            agreement.append(agrees)
        return possible, agreement

    def compute(self, values: Array) -> Expected:
        """Compute the expected counts, given the values of the forms (f,)."""
        with np.errstate(divide="ignore"):
            weights = self._model.scales * np.exp(self._model.factors.T @ np.log(values))
            parts = [self._compute_batch(weights, *batch) for batch in self._batches]
        log_p = np.concatenate([part[0] for part in parts])
        rejected = min(float(np.exp(log_p[-1])), 1.0)
        n_rejected = self._repeats.sum() * rejected / (1 - rejected) if rejected < 1 else 0.0
        counts = np.concatenate([part[1] for part in parts], axis=1)
        return Expected(log_p[:-1], rejected, np.append(self._repeats, n_rejected), counts)

    def _compute_batch(
        self, weights: Array, possible: _Mask, agreement: Sequence[_Mask | None]
    ) -> tuple[Array, Array]:
        """Return the log probability (n,) and the expected counts (f, n) of n records."""
        n, roots = len(possible), self._model.diagram.system.tree.roots
        counts = np.zeros((len(self._model.constants), n))
        if not possible.any():
            return np.full(n, -np.inf), counts
        below: dict[int, Array] = {}  # step -> (nodes, n), scaled
        products: dict[int, Array] = {}  # step -> (arcs, n)
        log_scale = np.zeros(n)
        for number in range(len(self._steps) - 1, -1, -1):
            step, agrees = self._steps[number], agreement[number]
            product = weights[step.outcomes][:, None] * (np.ones((1, n)) if agrees is None else agrees)
            for child, targets in zip(step.children, step.targets, strict=True):
                product = product * below[child][targets]
            sums = step.by_source @ product
            scale = sums.max(axis=0)
            scale[scale == 0] = 1.0
            below[number], products[number] = sums / scale, product
            log_scale += np.log(scale)
        log_p = log_scale + sum([np.log(below[root][0]) for root in roots], start=np.zeros(n))
        log_p[~possible] = -np.inf
        above = {root: np.ones((1, n)) for root in roots}
        for number, step in enumerate(self._steps):
            flow = above.pop(number)[step.sources] * products[number]
            total = flow.sum(axis=0)  # each world has one arc of each step
            flow /= np.where(total > 0, total, 1.0)
            counts += step.by_form @ flow
            branches = zip(step.children, step.targets, step.by_target, strict=True)
            for child, targets, by_target in branches:
                own = below[child][targets]
                above[child] = by_target @ np.divide(flow, own, out=np.zeros_like(flow), where=own > 0)
        counts[:, ~np.isfinite(log_p)] = 0.0
        return log_p, counts


def _make_sum(groups: npt.NDArray[np.intp], size: int) -> sparse.csr_array:
    """Make the matrix (size, n) that sums n numbers by group."""
    n = len(groups)
    return sparse.csr_array((np.ones(n), (groups, np.arange(n))), shape=(size, n))

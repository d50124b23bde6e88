"""Expected counts: an upward and a downward pass over a decision diagram, for many records at once.

Source: Darwiche, "A differential approach to inference in Bayesian networks", JACM 50(3), 2003; Ishihata,
Kameya, Sato and Minato, "Propositionalizing the EM algorithm by BDDs", ILP 2008.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy import sparse

from lcorpp.reasoning.fitting.number_model import NumberModel
from lcorpp.values import Array

_Mask = npt.NDArray[np.bool_]

MAX_CELLS = 4_000_000
"""The passes have at most this many cells (arcs times records) in memory."""


class _Step:
    """The arcs of a step as sparse matrices that sum over arcs."""

    def __init__(self, model: NumberModel, step: int, sizes: Sequence[int]) -> None:
        diagram = model.diagram
        sources, targets, labels = diagram.arcs[step]
        self.children = diagram.system.tree.children[step]
        self.sources, self.targets = np.array(sources), [np.array(branch) for branch in targets]
        self.labels = np.array(labels, dtype=np.intp)
        self.sum_by_source = _make_sum(self.sources, diagram.sizes[step])
        self.sum_by_target = [
            _make_sum(own, sizes[child]) for own, child in zip(self.targets, self.children, strict=True)
        ]
        n_forms = len(model.constants) + 1
        forms = model.factors[self.labels]
        self.sum_by_form = sum(
            (_make_sum(forms[:, i], n_forms) for i in range(forms.shape[1])),
            start=sparse.csr_array((n_forms, len(labels))),
        )


def _make_sum(groups: npt.NDArray[np.intp], size: int) -> sparse.csr_array:
    """Make the matrix (size, n) that sums n numbers by group."""
    n = len(groups)
    return sparse.csr_array((np.ones(n), (groups, np.arange(n))), shape=(size, n))


class Expectation:
    """Likelihoods and expected counts of distinct records.

    Args:
        records: canonical term -> value.
    """

    def __init__(self, model: NumberModel, records: Sequence[Mapping[str, str]]) -> None:
        self._model, diagram = model, model.diagram
        self._steps = [_Step(model, step, diagram.sizes) for step in range(len(diagram.arcs))]
        n_arcs = sum(len(step.labels) for step in self._steps)
        size = max(1, MAX_CELLS // max(n_arcs, 1))
        self._batches = [
            self._find_agreement(records[start : start + size]) for start in range(0, len(records), size)
        ]

    def _find_agreement(self, records: Sequence[Mapping[str, str]]) -> tuple[_Mask, list[_Mask | None]]:
        """Return which records are possible so far, and for each step whether arcs agree with records."""
        diagram = self._model.diagram
        system = diagram.system
        possible = np.full(len(records), diagram.has_worlds)
        codes: dict[
            int, npt.NDArray[np.intp]
        ] = {}  # term -> the observed value in each record, -1 if it is not observed
        for i, record in enumerate(records):
            for name, value in record.items():
                term = system.term_numbers.get(name)
                if term is None:  # it has no value in any world
                    possible[i] = False
                else:
                    own = codes.setdefault(term, np.full(len(records), -1))
                    own[i] = system.program.values[term].index(value)
        agreement: list[_Mask | None] = []
        for terms, step in zip(system.tree.order, self._steps, strict=True):
            agrees: _Mask | None = None
            for i, term in enumerate(terms):
                if term in codes:
                    value_of = np.array([diagram.outcomes[label][0][i] for label in step.labels])
                    own = (codes[term] < 0) | (value_of[:, None] == codes[term])
                    agrees = own if agrees is None else agrees & own
            agreement.append(agrees)
        return possible, agreement

    def compute(self, parameters: Array) -> tuple[Array, Array]:
        """Compute the log likelihood of each record, and the expected count of each form in it.

        Returns:
            (n,) and (forms, n); the count is 0 for a record of likelihood 0.
        """
        values = np.append(self._model.evaluate(parameters), 1.0)
        weights = self._model.scales * values[self._model.factors].prod(axis=1)
        parts = [self._compute_batch(weights, *batch) for batch in self._batches]
        return np.concatenate([p for p, _ in parts]), np.concatenate([c for _, c in parts], axis=1)

    def _compute_batch(
        self, weights: Array, possible: _Mask, agreement: Sequence[_Mask | None]
    ) -> tuple[Array, Array]:
        n, roots = len(possible), self._model.diagram.system.tree.roots
        counts = np.zeros((len(self._model.constants) + 1, n))
        if not possible.any():
            return np.full(n, -np.inf), counts[:-1]
        below: list[Array] = [np.empty(0)] * len(self._steps)  # step -> (nodes, n), scaled
        products: list[Array] = [np.empty(0)] * len(self._steps)  # step -> (arcs, n)
        logs: list[Array] = [np.zeros(0)] * len(self._steps)  # step -> (n,) log of the scale of `below`
        with np.errstate(divide="ignore"):
            for number in range(len(self._steps) - 1, -1, -1):
                step, agrees = self._steps[number], agreement[number]
                product = weights[step.labels][:, None] * (np.ones((1, n)) if agrees is None else agrees)
                log = np.zeros(n)
                for child, targets in zip(step.children, step.targets, strict=True):
                    product = product * below[child][targets]
                    log = log + logs[child]
                sums = step.sum_by_source @ product
                largest = sums.max(axis=0)
                scale = np.where(largest > 0, largest, 1.0)
                below[number], products[number], logs[number] = sums / scale, product, log + np.log(scale)
            log_p = sum([logs[root] + np.log(below[root][0]) for root in roots], start=np.zeros(n))
        log_p[~possible] = -np.inf
        above = {root: np.ones((1, n)) for root in roots}
        for number, step in enumerate(self._steps):
            flow = above.pop(number)[step.sources] * products[number]
            total = flow.sum(axis=0)  # each world has one arc of each step
            flow /= np.where(total > 0, total, 1.0)
            counts += step.sum_by_form @ flow
            for child, targets, sum_by_target in zip(
                step.children, step.targets, step.sum_by_target, strict=True
            ):
                own = below[child][targets]
                above[child] = sum_by_target @ np.divide(flow, own, out=np.zeros_like(flow), where=own > 0)
        counts[:, ~np.isfinite(log_p)] = 0.0
        return log_p, counts[:-1]

"""Predictions of the shared value by stated sources: knowledge, single senses, the planner's model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lcorpp.decision.strategies import infer_from_rates
from lcorpp.protocols import DomainInterface, Reasoner
from lcorpp.trust.evidence_cache import EvidenceCache
from lcorpp.values import Array, Distribution, Label

NO_EVIDENCE = "no evidence"
"""The source that predicts the initial belief of the planner's model."""


class StatedSources:
    """The sources that do not learn.

    They are the program with all evidence; with senses, the program with the facts alone; the labels of all
    senses, of two or more; the label of each sense; and the initial belief of the planner's model. A sense
    alone is combined with a uniform prior of the values: only the classifier's rates are the program's.

    names: of the sources. attributes: of the senses' labels. facts_row: index of the program with the facts
    alone.
    """

    def __init__(self, reasoner: Reasoner, domain: DomainInterface, start: Distribution) -> None:
        self._reasoner, self._domain = reasoner, domain
        self.attributes = domain.label_attributes
        facts = ("knowledge without labels",) if self.attributes else ()
        together = ("all senses",) if len(self.attributes) > 1 else ()
        self.names = ("knowledge", *facts, *together, *self.attributes, NO_EVIDENCE)
        self.facts_row = len(facts)
        self._start = start.probabilities
        self._cache = EvidenceCache()

    def predict(self, evidence: Mapping[str, Label]) -> Array:
        """Return (sources, V) P(value) of each source.

        Raises:
            UndefinedError: the evidence is impossible.
        """
        return self._cache.find(evidence, self._compute_predictions)

    def compute_rates(self, attribute: str) -> tuple[tuple[str, ...], Array]:
        """Return the labels of a sense, and (V, L) P(label | value) under the program, 0 if impossible."""
        labels = self._reasoner.posterior(attribute, {})
        prior = self._infer({}).probabilities
        assert labels is not None
        columns = [self._combine_uniform({attribute: label}) if p > 0 else 0 * prior for label, p in labels]
        # P(label | value) is P(label) times a column whose mean over the values is 1
        rates = [p * column / (column @ prior or 1) for column, (_, p) in zip(columns, labels, strict=True)]
        return tuple(labels.values), np.array(rates).T

    def _compute_predictions(self, evidence: Mapping[str, Label]) -> Array:
        knowledge = self._infer(evidence)
        labels = {name: evidence[name] for name in self.attributes if name in evidence}
        rows = [knowledge.probabilities]
        if self.attributes:
            facts = {name: value for name, value in evidence.items() if name not in labels}
            rows.append(self._infer(facts).probabilities if labels else knowledge.probabilities)
        if len(self.attributes) > 1:
            rows.append(self._combine_uniform(labels))
        rows += [
            self._combine_uniform({name: labels[name]} if name in labels else {}) for name in self.attributes
        ]
        return np.array([*rows, self._start])

    def _combine_uniform(self, labels: Mapping[str, Label]) -> Array:
        """Return (V,) P(value | labels) if all values were equally probable before."""
        if not labels:
            return np.full(len(self._start), 1 / len(self._start))
        return infer_from_rates(self._reasoner, self._domain.shared, labels).probabilities

    def _infer(self, evidence: Mapping[str, Label]) -> Distribution:
        found = self._reasoner.posterior(self._domain.shared, evidence)
        assert found is not None
        return found

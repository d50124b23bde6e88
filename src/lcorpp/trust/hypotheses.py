"""Hypotheses about the knowledge: the stated program and its alternatives, as predictive distributions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lcorpp.arguments import to_numbers
from lcorpp.errors import DecisionError, UndefinedError
from lcorpp.protocols import DomainInterface, Reasoner
from lcorpp.trust.evidence_cache import EvidenceCache
from lcorpp.values import Array, Label, Likelihood


class Hypotheses:
    """F hypotheses: the stated program, and programs with one wrong attribute.

    Args:
        reasoners: (B,) the first is that of the stated program.
        weights: (F, B) a hypothesis gives evidence the probability ``weights @ p`` of its probabilities p by
            the reasoners; the first row is 1, 0, ... 0.
        attributes: (F,) the attribute that is wrong, "" for the first, which is the stated program.
        changes: (F,) what is wrong.
        priors: (F,) prior probabilities.
        domain: names the values, labels and the shared attribute.
        given: whether the facts are given, e.g. by the robot's own schedule; otherwise the program predicts
            them, too.

    Attributes:
        attributes, changes, priors, domain, given: as above.

    Raises:
        DecisionError: the shapes do not fit, or the first hypothesis is not the stated program.
        DataError: `weights` or `priors` are no numbers.

    Examples:
        >>> from lcorpp import Reasoner, load_domain, parse_plog
        >>> from lcorpp.trust import Hypotheses
        >>> domain, rule = load_domain("intention"), "pr(intention=interested | identity=visitor) = "
        >>> other = parse_plog(str(domain.program).replace(rule + "4/5", rule + "1/5"))
        >>> hypotheses = Hypotheses(
        ...     [Reasoner(domain.program), Reasoner(other)], [[1, 0], [0, 1]],
        ...     ["", "intention"], ["", "inverted for visitors"], [0.5, 0.5], domain,
        ... )
        >>> hypotheses.predict({"time": "afternoon"}).round(3).tolist()  # P(value, facts) by each program
        [[0.205, 0.112], [0.065, 0.252]]
    """

    def __init__(
        self,
        reasoners: Sequence[Reasoner],
        weights: Array,
        attributes: Sequence[str],
        changes: Sequence[str],
        priors: Array,
        domain: DomainInterface,
        *,
        given: bool = False,
    ) -> None:
        self.attributes, self.changes = tuple(attributes), tuple(changes)
        self.priors = priors = to_numbers(priors, "hypotheses: priors")
        weights = to_numbers(weights, "hypotheses: weights")
        shape = len(self.attributes), len(reasoners)
        if weights.shape != shape or len(changes) != len(priors) or len(priors) != shape[0]:
            raise DecisionError(f"hypotheses have weights of shape {weights.shape}; expected {shape}")
        if not shape[0] or not np.array_equal(weights[0], np.eye(shape[1])[0]):
            raise DecisionError("the first hypothesis is another program; expected the stated one")
        self.domain = domain
        self._reasoners, self._weights, self.given = reasoners, weights, given
        self._cache = EvidenceCache()

    def predict(self, evidence: Mapping[str, Label]) -> Array:
        """Return (F, V) P(value, labels, facts), or P(value, labels | facts) if the facts are given.

        A likelihood of labels counts as in P(value, label) summed over the labels, up to a factor.

        Raises:
            UndefinedError: the evidence is impossible under the stated program.
        """
        return self._cache.find(evidence, self._compute_predictions)

    def _compute_predictions(self, evidence: Mapping[str, Label]) -> Array:
        rows = [self._infer(number, evidence) for number in range(len(self._reasoners))]
        mixed = np.maximum(self._weights @ np.array(rows), 0)
        predictions, facts = mixed[:, :-1], mixed[:, -1:]
        if self.given:
            predictions = np.divide(predictions, facts, out=np.zeros_like(predictions), where=facts > 0)
        return predictions

    def _infer(self, number: int, evidence: Mapping[str, Label]) -> Array:
        """Return (V + 1,) P(value, labels, facts) and P(facts) by one of the reasoners."""
        reasoner, known, chances = self._reasoners[number], dict[str, Label](), [0.0, 0.0]
        values = np.zeros(len(self.domain.values))
        try:
            for i, is_label in enumerate((False, True)):
                chance = 1.0
                for name, value in evidence.items():
                    if (name in self.domain.label_attributes) == is_label:
                        chance *= _find_probability(reasoner, name, value, known)
                        known[name] = value
                chances[i] = chance
            marginal = reasoner.posterior(self.domain.shared, known)
            assert marginal is not None
            values = marginal.probabilities
        except UndefinedError:
            if number == 0:
                raise
        facts, labels = chances
        return np.append(facts * labels * values, facts)


def _find_probability(reasoner: Reasoner, name: str, value: Label, known: Mapping[str, Label]) -> float:
    """Return P(value | known), or the mean of a likelihood."""
    marginal = reasoner.posterior(name, known)
    assert marginal is not None
    chances = dict(marginal)
    likelihood = dict(value) if isinstance(value, Likelihood) else {value: 1.0}
    return sum(p * chances.get(name, 0.0) for name, p in likelihood.items())

"""Drift: an alarm when the signals change, or the classifiers agree less often with the reports than before.

The people of each batch are compared with those of all batches before, by two tests for each sense that
learns. As long as nothing changes, the p-values of a test are independent, and uniform or larger. They become
a test martingale: a capital that starts at 1, stays at 1 in the mean, and so reaches n with at most the
probability 1 / n in a run of any length (Ville's inequality). The alarm is raised when it does. Small
p-values of successive batches multiply: a change that lasts is found even if each batch leaves it open.

The rate of false alarms is that of a run, for all tests together. It presumes people who do not depend on
each other, and a retrained classifier that agrees no less often than those before.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import log

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.evaluation.two_sample import compare_rates, compare_signals
from lcorpp.runs.batches import Row
from lcorpp.runs.run_store import RunStore
from lcorpp.values import Array, Label

FALSE_ALARMS = 0.05
"""Probability of an alarm in a run in which nothing changes."""

SIGNALS, AGREEMENT = "signals", "agreement"
CHANGES: Mapping[str, str] = {
    SIGNALS: "the signals have changed",
    AGREEMENT: "the classifier agrees less often with the reports",
}


@dataclass
class _Observations:
    """What a sense perceived, and whether its label was the reported class; None if that is unknown."""

    signals: list[Array] = field(default_factory=list)
    agrees: list[bool | None] = field(default_factory=list)
    start: int = 0  # of the batch under way

    def compute_p_values(self, rng: np.random.Generator) -> dict[str, float]:
        """Compare the observations of the batch with those before; return the p-value of each test."""
        p_values, parts = {}, (slice(self.start), slice(self.start, None))
        before, after = (self.signals[part] for part in parts)
        if before and after:
            p_values[SIGNALS] = compare_signals(before, after, rng)
        known_before, known = ([own for own in self.agrees[part] if own is not None] for part in parts)
        if known_before and known:
            counts = (sum(known_before), len(known_before)), (sum(known), len(known))
            p_values[AGREEMENT] = compare_rates(*counts)
        return p_values


class DriftMonitor:
    """Compares the decisions of each batch with those before."""

    @check_arguments
    def __init__(self, senses: Collection[str], seed: int) -> None:
        self._observations, self._seed = {name: _Observations() for name in senses}, seed

    def add(self, sense: str, signal: Array, agrees: bool | None) -> None:
        """Add the signal of a decision, and whether the classifier agreed with the report, if it is known."""
        self._observations[sense].signals.append(signal)
        self._observations[sense].agrees.append(agrees)

    def restore(self, run_store: RunStore) -> None:
        """Add the decisions of earlier runs, those since their last training as the batch under way."""
        pending = {track.id for track in run_store.pending}
        for is_pending in (False, True):
            for sense in self._observations:
                for track, signal in run_store.decisions(sense):
                    if (track.id in pending) == is_pending:
                        self.add(sense, signal, track.extra.get("agrees", {}).get(sense))
            if not is_pending:
                self.start_batch()

    def start_batch(self) -> None:
        """What was added until now is that before the batch."""
        for own in self._observations.values():
            own.start = len(own.signals)

    def test_batch(self, number: int, rows: Sequence[Row]) -> Row:
        """Return the columns of a batch that ends: p-values, and the alarms as a text in "drift".

        Args:
            number: of the batch. rows: of the batches before.
        """
        alarms, several = list[str](), len(self._observations) > 1
        columns: Row = {}
        for index, (sense, own) in enumerate(self._observations.items()):
            rng = np.random.default_rng([self._seed, 3, number, index])  # a resumed run repeats it
            for test, p_value in own.compute_p_values(rng).items():
                column = f"p_{test}_{sense}" if several else f"p_{test}"
                columns[column] = p_value
                history = [float(row[column]) for row in rows if column in row]
                limit = len(self._observations) * len(CHANGES) / FALSE_ALARMS
                if compute_capital([*history, p_value]) >= limit:
                    alarms.append(f"{sense}: {CHANGES[test]}" if several else CHANGES[test])
        self.start_batch()
        return columns | ({"drift": "; ".join(alarms)} if columns else {})


@check_arguments
def agrees_with(label: Label, reported: str) -> bool:
    """Return whether a reported class is the label, or the most likely class of a likelihood."""
    if isinstance(label, str):
        return label == reported
    return label.values[int(label.weights.argmax())] == reported


@check_arguments
def compute_capital(p_values: Sequence[float]) -> float:
    """Return the capital of a test martingale, 1 at the start, that bets on small p-values.

    A share of 1 / (k (k + 1)) is staked from the k-th p-value on, as a change may come at any time. A p-value
    multiplies what is staked by its calibrated e-value, which has mean 1 if the p-value is uniform.

    Raises:
        DataError: a p-value is not from 0 to 1.

    Source: Vovk and Wang, E-values: calibration, combination and applications, Annals of Statistics 49
    (2021), section 2.
    """
    staked, reserve = 0.0, 1.0
    for number, p in enumerate(p_values, 1):
        share = 1 / (number * (number + 1))
        staked, reserve = (staked + share) * calibrate(p), reserve - share
    return staked + reserve


@check_arguments
def calibrate(p: float) -> float:
    """Return the e-value of a p-value: the integral of k p^(k - 1) over k from 0 to 1.

    Raises:
        DataError: the p-value is not from 0 to 1.
    """
    if not 0 <= p <= 1:
        raise DataError(f"the p-value is {p}; expected a number from 0 to 1")
    if p > 1 - 1e-6:
        return 0.5  # the limit, where the formula loses all digits
    p = max(p, 1e-300)
    return (1 - p + p * log(p)) / (p * log(p) ** 2)

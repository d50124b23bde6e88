"""The classifiers of a robot's senses: trained, loaded, or noisy channels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lcorpp.assembly.options import LABEL
from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.simulation.simulated_classifier import BatchClassifier, NoisyChannel
from lcorpp.values import ConfusionMatrix, EvidenceKind

if TYPE_CHECKING:  # scikit-learn takes seconds to load, and a noisy channel does without
    from lcorpp.learning import EvaluationReport, Rate, TrainedClassifier
    from lcorpp.simulation.people import SignalSource


@dataclass(frozen=True, eq=False)
class SenseSetup:
    """The classifier of a sense, the source of its test signals, and its error rates.

    rates: true class -> predicted class -> probability, as the rules contain them.
    confusion: the matrix that replaces the rules; None for a noisy channel, whose rules the program has.
    intervals: one row of rates with intervals per true class; () for a noisy channel.
    source: "channel", the learner, or the file of the classifier.
    trained: the trained classifier, without soft evidence; None for a noisy channel.
    evidence: its kind of evidence; if a likelihood, the program does without its rates.
    n_tracks: number of training cases, report: evaluation of the classifier; None if it was not trained now.
    unit: plural noun of the cases. data: the recorded data, None if they are simulated.
    notes: warnings about the data.
    """

    classifier: BatchClassifier
    signals: SignalSource
    rates: dict[str, dict[str, float]]
    confusion: ConfusionMatrix | None = None
    intervals: Sequence[Sequence[Rate]] = ()
    source: str = "channel"
    trained: TrainedClassifier | None = None
    evidence: EvidenceKind = LABEL
    n_tracks: int | None = None
    report: EvaluationReport | None = None
    unit: str = "tracks"
    data: Path | None = None
    notes: tuple[str, ...] = ()

    @property
    def soft(self) -> bool:
        """Whether its evidence is a likelihood."""
        return self.evidence.is_likelihood

    def __repr__(self) -> str:
        kind = "channel" if self.trained is None else "trained"
        rates = ", ".join(f"{value} {row[value]:.3f}" for value, row in self.rates.items())
        return f"<SenseSetup {kind}; recall: {rates}>"


Senses = Mapping[str, SenseSetup]
"""Name of a sense -> its setup, for the senses that some strategy uses."""


def from_channel(domain: Domain, sense: Sense) -> SenseSetup:
    """Return the noisy channel of a sense; the program keeps its own rules.

    Raises:
        DomainError: the domain has no noisy channel.
    """
    channel = NoisyChannel.from_domain(domain, sense)
    return SenseSetup(channel, channel, nest_rates(sense.classes, channel.rates.tolist()))


def nest_rates(classes: Sequence[str], rows: Iterable[Iterable[float]]) -> dict[str, dict[str, float]]:
    """Return rates (V, V) as true class -> predicted class -> probability."""
    return {actual: dict(zip(classes, row, strict=True)) for actual, row in zip(classes, rows, strict=True)}

"""A simulated classifier, the noisy channel: it draws each class at known error rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lcorpp.domains import Domain
from lcorpp.domains.sections.learning import Sense
from lcorpp.errors import DomainError
from lcorpp.values import Array, Label, find_perceived

if TYPE_CHECKING:
    from lcorpp.simulation.people import Person


class BatchClassifier(Protocol):
    """A classifier of a sense that also accepts many signals at once."""

    def classify(self, signal: Array) -> Label: ...

    def classify_many(self, signals: Array) -> Sequence[Label]: ...


def classify_perceived(classifier: BatchClassifier, signals: Array) -> list[Label | None]:
    """Return the output of a classifier for each signal; None where all of its numbers are NaN.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import NoisyChannel, classify_perceived
        >>> domain = load_domain("intention")
        >>> channel = NoisyChannel.from_domain(domain, domain.senses[0])
        >>> classify_perceived(channel, np.array([[[1.0]], [[np.nan]]]))
        ['not_interested', None]
    """
    perceived = find_perceived(signals)
    if perceived.all():
        return list(classifier.classify_many(signals))
    labels = iter(classifier.classify_many(signals[perceived]) if perceived.any() else ())
    return [next(labels) if known else None for known in perceived]


@dataclass(frozen=True, eq=False)
class NoisyChannel:
    """A classifier with known error rates; it is its own source of signals, too.

    The signal of a person is one number: the index of the predicted class, drawn from the row of rates of the
    person's true class, or that of the label that the truth program has drawn with the person.

    of: the attribute that is classified. classes: its V values.
    rates: (V, V) rates[i, j] = P(predicted class j | true class i).
    attribute: of the person's label, if it is drawn with the person; None if it is drawn by `rates`.
    labels: the value of `attribute` that each class has.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import NoisyChannel
        >>> domain = load_domain("intention")
        >>> NoisyChannel.from_domain(domain, domain.senses[0]).rates.round(2).tolist()
        [[0.76, 0.24], [0.29, 0.71]]
    """

    of: str
    classes: tuple[str, ...]
    rates: Array
    attribute: str | None = None
    labels: tuple[str, ...] = ()

    def __repr__(self) -> str:
        recalls = zip(self.classes, self.rates.diagonal(), strict=True)
        return f"<NoisyChannel of {self.of}; recall: {', '.join(f'{name} {p:.3f}' for name, p in recalls)}>"

    @classmethod
    def from_domain(cls, domain: Domain, sense: Sense) -> NoisyChannel:
        """Return the noisy channel of a sense.

        Raises:
            DomainError: the domain has none.
        """
        label_rates = domain.simulation.noisy_channels.get(sense.name)
        if label_rates is None:
            raise DomainError(
                f"{domain.folder}: no noisy channel: neither [simulation.channel] nor rules for"
                f" {sense.attribute!r} in the truth program"
            )
        labels = tuple(sense.label_of[value] for value in sense.classes)
        rates = np.array([[label_rates[value][label] for label in labels] for value in sense.classes])
        attribute = sense.attribute if sense.name in domain.simulation.joint_labels else None
        return cls(sense.of, sense.classes, rates, attribute, labels)

    def simulate(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        """Draw the index of each person's predicted class: (people, 1, 1)."""
        if self.attribute is not None:
            drawn = np.array([self.labels.index(person[self.attribute]) for person in people])
        else:
            bounds = np.cumsum(self.rates, axis=1)
            rows = [self.classes.index(person[self.of]) for person in people]
            drawn = (rng.random((len(people), 1)) >= bounds[rows][:, :-1]).sum(axis=1)
        signals: Array = drawn.astype(np.float64).reshape(-1, 1, 1)
        return signals

    def probabilities(self, person: Mapping[str, str]) -> Array:
        """Return (V,) the probability of each predicted class, for a person of these attributes."""
        if self.attribute is None:
            row: Array = self.rates[self.classes.index(person[self.of])]
            return row
        return np.array([float(label == person[self.attribute]) for label in self.labels])

    def classify(self, signal: Array) -> str:
        return self.classes[int(signal[0, 0])]

    def classify_many(self, signals: Array) -> Sequence[str]:
        return [self.classes[int(index)] for index in signals[:, 0, 0]]


@dataclass(frozen=True)
class PrecomputedLabel:
    """A classifier that returns a label that is known."""

    label: Label | None

    def classify(self, signal: Array) -> Label | None:
        return self.label

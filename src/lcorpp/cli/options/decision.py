"""Options that describe one decision: facts, labels, likelihoods, the true value and the answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.errors import DomainError, ObservationError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.domains import Domain
    from lcorpp.domains.sections.learning import Sense
    from lcorpp.values import Label, Likelihood, SharedValue


@dataclass(frozen=True)
class Person:
    """What options state of a person.

    facts: observed attribute -> value. predicted: sense -> its class or likelihood.
    truth: the true shared value, None if it is unknown. answers: None draws them.
    """

    facts: Mapping[str, str]
    predicted: Mapping[str, Label]
    truth: SharedValue | None
    answers: Sequence[str] | None

    @property
    def likelihoods(self) -> list[str]:
        """The senses with a likelihood."""
        return [name for name, label in self.predicted.items() if not isinstance(label, str)]


@dataclass(frozen=True)
class PersonGroup:
    """The person of one decision; each field is an option of its name."""

    fact: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="An observed fact; repeatable.")
    ] = None
    label: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SENSE=]VALUE",
            help="The classifier's label: a value of the attribute that it feeds; one for each sense.",
        ),
    ] = None
    likelihood: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SENSE:]VALUE=NUMBER",
            help="Soft evidence instead of a label: the likelihood of a value, by default 1; repeatable.",
        ),
    ] = None
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="VALUE,...",
            help="The person's true value, one for each shared variable; by default it is drawn.",
        ),
    ] = None
    answers: Annotated[
        str | None,
        typer.Option(metavar="A,B,...", help="The person's answers in order; by default they are drawn."),
    ] = None

    def parse(self, domain: Domain) -> Person:
        """Return the person in the domain's vocabulary.

        Raises:
            DomainError: a name or value is unknown, or a sense has a label and a likelihood.
        """
        facts = parse_facts(domain, self.fact or [])
        truth = None if self.truth is None else parse_truth(domain, self.truth)
        answers = None if self.answers is None else parse_answers(domain, self.answers)
        labels = parse_labels(domain, self.label or [])
        likelihoods = parse_likelihoods(domain, self.likelihood or [])
        for sense in labels.keys() & likelihoods.keys():
            raise DomainError(
                f"--label and --likelihood are both evidence of the classifier {sense}; expected one"
            )
        return Person(facts, {**labels, **likelihoods}, truth, answers)


def parse_answers(domain: Domain, text: str) -> list[str]:
    """Return the answers in a text such as "pos,neg"; each is an observation of the model."""
    from lcorpp.planning import Pomdp

    model, answers = domain.model, [part.strip() for part in text.split(",")]
    for answer in answers:
        if isinstance(model, Pomdp):
            if answer not in model.observations:
                raise DomainError(f"--answers {answer!r}: {expected_one_of(model.observations)}")
            continue
        try:
            model.read_observation(answer)
        except ObservationError as error:
            raise DomainError(f"--answers {answer!r}: {error}") from None
    return answers


def parse_facts(domain: Domain, pairs: list[str]) -> dict[str, str]:
    """Return the facts in texts such as "time=afternoon": attribute -> value."""
    facts: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals:
            raise DomainError(
                f"--fact {pair!r}: expected NAME=VALUE with NAME among {', '.join(domain.observed)}"
            )
        if name in facts:
            raise DomainError(f"--fact {pair!r}: {name} is given twice")
        facts[name] = value
    domain.evidence(facts, {})  # raises DomainError for an unknown fact
    return facts


def parse_truth(domain: Domain, text: str) -> SharedValue:
    """Return the shared value in a text such as "coffee,alice"."""
    parts = [part.strip() for part in text.split(",")]
    value = parts[0] if len(parts) == len(domain.reasoning.shared) == 1 else tuple(parts)
    if value not in domain.values:
        known = [",".join(domain.reasoning.split(v).values()) for v in domain.values]
        raise DomainError(f"--truth {text!r}: {expected_one_of(known)}")
    return value


def parse_labels(domain: Domain, texts: list[str]) -> dict[str, str]:
    """Return the classes that texts such as "gaze=left" name, sense -> class."""
    labels: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        sense = _find_sense(domain, "--label", text, name if equals else None)
        if sense.name in labels:
            raise DomainError(f"--label {text!r}: the label of {sense.name} is given twice")
        labels[sense.name] = _parse_class(sense, value if equals else text, "--label")
    return labels


def parse_likelihoods(domain: Domain, texts: list[str]) -> dict[str, Likelihood]:
    """Return the likelihoods of texts such as "gaze:left=0.3", sense -> likelihood; 1 for other classes."""
    import numpy as np

    from lcorpp.values import Likelihood

    weights: dict[str, dict[str, float]] = {}
    for text in texts:
        left, _, number = (part.strip() for part in text.rpartition("="))
        name, colon, value = (part.strip() for part in left.partition(":"))
        try:
            weight = float(number)
        except ValueError:
            left = ""
        if not left:
            raise DomainError(f"--likelihood {text!r}: expected VALUE=NUMBER") from None
        sense = _find_sense(domain, "--likelihood", text, name if colon else None)
        class_name = _parse_class(sense, value if colon else left, "--likelihood")
        own = weights.setdefault(sense.name, {})
        if class_name in own:
            raise DomainError(f"--likelihood {text!r}: {class_name} is given twice")
        own[class_name] = weight
    return {
        name: Likelihood(classes, np.array([own.get(value, 1.0) for value in classes]))
        for name, own in weights.items()
        for classes in [domain.find_sense(name).classes]
    }


def _find_sense(domain: Domain, option: str, text: str, name: str | None) -> Sense:
    """Return the sense of this name, or the only one."""
    if name is not None:
        return domain.find_sense(name)
    if len(domain.senses) != 1:
        names = ", ".join(sense.name for sense in domain.senses)
        expected = f"expected the name of a sense first: {names}" if names else "the domain has no [learning]"
        raise DomainError(f"{option} {text!r}: {expected}")
    return domain.senses[0]


def _parse_class(sense: Sense, text: str, option: str) -> str:
    """Return the class that a text names."""
    try:
        return sense.find_class(text)
    except DomainError:
        raise DomainError(f"{option} {text!r}: {expected_one_of(sense.label_of.values())}") from None

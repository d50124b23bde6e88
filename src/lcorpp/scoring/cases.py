"""The cases of exact scores: what a robot may perceive of people, and its posteriors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import product
from math import prod
from typing import NamedTuple

import numpy as np

from lcorpp.decision import Strategy
from lcorpp.domains import Domain
from lcorpp.protocols import Reasoner as ReasonerProtocol
from lcorpp.reasoning import Program, Reasoner
from lcorpp.simulation.simulated_classifier import NoisyChannel
from lcorpp.values import Array, Distribution, Label


class Case(NamedTuple):
    """Facts and labels that a robot may perceive; (V,) their probability with each true value.

    labels: sense -> class; a sense that does not perceive the person is left out.
    """

    context: Mapping[str, str]
    labels: Mapping[str, str]
    masses: Array


def compute_joint_distribution(domain: Domain, attributes: Sequence[str]) -> dict[tuple[str, ...], float]:
    """Compute the joint distribution of some attributes of the people: value tuple -> probability."""
    return dict(_compute_joint(domain.simulation.true_program, tuple(attributes)))


@lru_cache(maxsize=16)
def _compute_joint(program: Program, attributes: tuple[str, ...]) -> list[tuple[tuple[str, ...], float]]:
    """Compute a joint distribution, once for the configurations of a sweep that have the same people."""
    return [(values, float(p)) for values, p in Reasoner(program).exact(attributes).items()]


def list_cases(
    domain: Domain,
    channels: Mapping[str, NoisyChannel],
    people: Sequence[tuple[Mapping[str, str], float]],
) -> list[Case]:
    """List what a robot with these senses may perceive.

    Args:
        people: attribute -> value, of those in `list_attributes`, and probability.
    """
    cases: dict[tuple[str | None, ...], Case] = {}
    for person, mass in people:
        v = domain.values.index(domain.reasoning.join(person))
        context = {name: person[name] for name in domain.observed}
        for labels, rate in _enumerate_labels(domain, channels, person):
            if mass * rate > 0:
                key = (*context.values(), *[labels.get(sense) for sense in channels])
                case = cases.setdefault(key, Case(context, labels, np.zeros(len(domain.values))))
                case.masses[v] += mass * rate
    return list(cases.values())


def _enumerate_labels(
    domain: Domain, channels: Mapping[str, NoisyChannel], person: Mapping[str, str]
) -> Iterator[tuple[dict[str, str], float]]:
    """Yield the labels that the senses may give a person, sense -> class, and their probability.

    A sense that may not perceive the person is left out of some.
    """
    choices = list[list[tuple[str | None, float]]]()
    for sense, channel in channels.items():
        presence = domain.simulation.presence.get(sense)
        perceived = 1.0 if presence is None else presence.probability(person)
        row = channel.probabilities(person) * perceived
        labelled = zip(channel.classes, row.tolist(), strict=True)
        choices.append([*labelled, *([(None, 1 - perceived)] if perceived < 1 else [])])
    for combination in product(*choices):
        outputs = zip(channels, combination, strict=True)
        labels = {sense: label for sense, (label, _) in outputs if label is not None}
        yield labels, prod([rate for _, rate in combination])


def list_attributes(domain: Domain, channels: Mapping[str, NoisyChannel]) -> tuple[str, ...]:
    """List the attributes of people on which `list_cases` depends."""
    classified = [channel.attribute or channel.of for channel in channels.values()]
    presence = [known.of for sense, known in domain.simulation.presence.items() if sense in channels]
    needed = [*domain.observed, *classified, *domain.reasoning.shared, *filter(None, presence)]
    return tuple(dict.fromkeys(needed))


class _KnownPosteriors(NamedTuple):
    """A reasoner that has inferred the posterior of all evidence of an evaluation at once."""

    answers: Mapping[tuple[tuple[str, Label], ...], Distribution]

    def posterior(self, attribute: str | Sequence[str], evidence: Mapping[str, Label]) -> Distribution:
        return self.answers[tuple(evidence.items())]


def infer_posteriors(
    domain: Domain, reasoner: ReasonerProtocol, cases: Mapping[Strategy, Sequence[Case]]
) -> ReasonerProtocol:
    """Return the reasoner for the cases of the table's strategies; another engine answers one by one."""
    evidence: dict[tuple[tuple[str, Label], ...], Mapping[str, Label]] = {}
    for strategy, own in cases.items():
        if strategy.change is not None or not (strategy.reasons or strategy.plans):
            continue
        for case in own:
            each = domain.evidence(case.context if strategy.reasons else {}, case.labels)
            if not strategy.reasons:  # as `LabelRatesReasoner` asks
                each = {name: each[name] for name in domain.shared_label_attributes if name in each}
            evidence[tuple(each.items())] = each
        if not strategy.reasons:
            evidence[()] = {}  # see `LabelRatesReasoner`
    if not isinstance(reasoner, Reasoner):
        return reasoner
    answers = reasoner.posteriors(domain.shared, list(evidence.values()))
    return _KnownPosteriors(dict(zip(evidence, answers, strict=True)))

"""One person to decide about: facts, the classifiers' output, and a world that answers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lcorpp.assembly.senses import Senses, from_channel
from lcorpp.domains import Domain
from lcorpp.errors import DomainError, check_type
from lcorpp.protocols import World
from lcorpp.values import Label, Likelihood, SharedValue

if TYPE_CHECKING:
    from lcorpp.simulation import Population


class Case(NamedTuple):
    """One person to decide about.

    facts: observed attribute -> value. predicted: sense -> its output, a class or a likelihood.
    world: answers the robot's actions. truth: the true shared value, None if it is unknown.
    person: all that a simulation knows of the person, None without one.
    """

    facts: Mapping[str, str]
    predicted: Mapping[str, Label]
    world: World
    truth: SharedValue | None
    person: Mapping[str, str] | None


def choose_labels(domain: Domain, label: Label | None, labels: Mapping[str, Label]) -> dict[str, Label]:
    """Return sense -> output, with the class of each label.

    Args:
        label: of the only sense.

    Raises:
        DomainError: a sense or label is unknown, or `label` does not show its sense.
    """
    check_type(labels, Mapping, "`labels`, sense -> label,", DomainError)
    if label is not None:
        check_type(
            label, (str, Likelihood), "the label of the only sense (of several: `labels`)", DomainError
        )
        names = [sense.name for sense in domain.senses]
        if len(names) != 1 or labels:
            raise DomainError(
                f"the label {label!r} is that of one sense, and the domain {domain.name} has"
                f" {', '.join(names) or 'none'}; expected labels={{sense: label}}"
            )
        labels = {names[0]: label}
    return {
        name: domain.find_sense(name).find_class(own) if isinstance(own, str) else own
        for name, own in labels.items()
    }


def draw_case(
    domain: Domain,
    senses: Senses,
    facts: Mapping[str, str],
    predicted: Mapping[str, Label],
    truth: SharedValue | None = None,
    *,
    seed: int = 0,
) -> Case:
    """Draw a simulated person, with the facts and labels that are not given, of the senses that perceive it.

    Args:
        senses: those that the robot uses; the labels of the others are drawn, too, and not used.
        truth: the person's shared value; None draws it.
        seed: of the person, the labels and the answers.

    Raises:
        DomainError: no such person is possible, or a sense has no noisy channel.
    """
    # a real person is not simulated
    from lcorpp.simulation import classify_perceived, make_dynamics, simulate_signals

    rng = np.random.default_rng([seed, 0])
    given = facts if truth is None else {**facts, **domain.reasoning.split(truth)}
    for name in domain.simulation.joint_labels:
        if isinstance(label := predicted.get(name), str):  # the person who has this label
            sense = domain.find_sense(name)
            given = {**given, sense.attribute: sense.label_of[label]}
    person = _make_population(domain).sample(1, rng, given)[0]
    labels = dict(predicted)
    for sense in (*domain.senses, *[own for own in domain.baselines if own.name in senses]):
        if sense.name not in labels:
            setup = senses.get(sense.name) or from_channel(domain, sense)
            signals = simulate_signals(domain, sense.name, setup.signals, [person], rng)
            output = classify_perceived(setup.classifier, signals)[0]
            if output is not None:
                labels[sense.name] = output
    context = {name: person[name] for name in domain.observed}
    known = {name: labels[name] for name in senses if name in labels}
    world = make_dynamics(domain).make_world(person, rng)
    return Case(context, known, world, domain.reasoning.join(person), person)


@lru_cache(maxsize=4)
def _make_population(domain: Domain) -> Population:
    """Return the people of a domain; all are drawn from one compiled program."""
    from lcorpp.simulation import Population

    return Population(domain)

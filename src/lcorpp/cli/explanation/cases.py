"""The person of one decision of `lcorpp explain`: simulated, or the user."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from lcorpp.cli import console
from lcorpp.errors import DecisionError

if TYPE_CHECKING:
    from lcorpp.assembly.setup import Senses
    from lcorpp.domains import Domain, Sense
    from lcorpp.protocols import World
    from lcorpp.values import Label, SharedValue


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


def ask_case(
    domain: Domain, senses: Sequence[Sense], facts: Mapping[str, str], predicted: Mapping[str, Label]
) -> Case:
    """Ask the user, who is the person, for the facts and the labels that no option gives."""
    from lcorpp.worlds import ConsoleWorld, choose

    complete = dict(facts)
    for name in domain.observed:
        if name not in complete:
            values = domain.program.attributes[name].values
            complete[name] = choose(values, f"What is the {name}?", ask=console.ask, show=console.out.print)
    labels = dict(predicted)
    for sense in senses:
        if sense.name not in labels:
            class_of = {label: name for name, label in sense.label_of.items()}
            question = f"What is the classifier's label ({sense.attribute})?"
            labels[sense.name] = class_of[
                choose(tuple(class_of), question, ask=console.ask, show=console.out.print)
            ]
    return Case(
        complete,
        labels,
        ConsoleWorld(domain.pomdp.observations, ask=console.ask, show=console.out.print),
        None,
        None,
    )


def simulate_case(
    domain: Domain,
    senses: Senses,
    facts: Mapping[str, str],
    predicted: Mapping[str, Label],
    truth: SharedValue | None,
    answers: Sequence[str] | None,
    seed: int,
) -> Case:
    """Draw what is None, and the facts and labels that are not given; print what the robot cannot observe.

    Args:
        senses: those that the robot uses; the labels of the others are drawn, too, and not used.
    """
    import numpy as np

    from lcorpp.assembly.setup import from_channel
    from lcorpp.simulation import Population, SimulationModel

    rng = np.random.default_rng([seed, 0])
    given = facts if truth is None else {**facts, **domain.reasoning.split(truth)}
    person = Population(domain).sample(1, rng, given)[0]
    labels = dict(predicted)
    for sense in domain.senses:
        if sense.name not in labels:
            setup = senses.get(sense.name) or from_channel(domain, sense)
            labels[sense.name] = setup.classifier.classify_many(setup.signals.simulate([person], rng))[0]
    world = SimulationModel(domain).make_world(person, rng) if answers is None else ScriptedWorld(answers)
    print_person(domain, person)
    context = {name: person[name] for name in domain.observed}
    known = {name: labels[name] for name in senses}
    return Case(context, known, world, domain.reasoning.join(person), person)


def print_person(domain: Domain, person: Mapping[str, str]) -> None:
    """Print what the robot cannot observe of a simulated person."""
    observable = (*domain.observed, *[sense.attribute for sense in domain.senses])
    hidden = ", ".join(f"{name}={value}" for name, value in person.items() if name not in observable)
    console.out.print(f"a simulated person; hidden from the robot: {hidden}", style="dim")


def describe_simulation(case: Case) -> dict[str, object] | None:
    """Return what only the simulation knows, for the log; prepared answers have no cost and no return."""
    from lcorpp.simulation import SimulatedWorld

    if case.person is None:
        return None
    known: dict[str, object] = {"truth": dict(case.person)}
    if isinstance(case.world, SimulatedWorld):
        known |= {"cost": case.world.cost, "return": case.world.return_}
    return known


class ScriptedWorld:
    """A world whose person gives prepared answers (`lcorpp.protocols.World`)."""

    def __init__(self, answers: Sequence[str]) -> None:
        self._count, self._rest = len(answers), iter(answers)

    def act(self, action: str) -> str:
        answer = next(self._rest, None)
        if answer is None:
            raise DecisionError(
                f"--answers has {self._count} answers, and the robot needs another one, to {action}"
            )
        return answer

    def report(self, action: str) -> None:
        pass

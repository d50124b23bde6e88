"""The person of one decision of `lcorpp explain`: simulated, or the user."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from lcorpp.cli import console

if TYPE_CHECKING:
    from lcorpp.assembly.case import Case
    from lcorpp.cli.options.decision import Person
    from lcorpp.domains import Domain, Sense


def ask_case(domain: Domain, senses: Sequence[Sense], person: Person) -> Case:
    """Ask the user, who is the person, for the facts and the labels that no option gives."""
    from lcorpp.assembly.case import Case
    from lcorpp.worlds import ConsoleWorld, choose

    complete = dict(person.facts)
    for name in domain.observed:
        if name not in complete:
            values = domain.program.attributes[name].values
            complete[name] = choose(values, f"What is the {name}?", ask=console.ask, show=console.out.print)
    labels = dict(person.predicted)
    for sense in senses:
        if sense.name not in labels:
            class_of = {label: name for name, label in sense.label_of.items()}
            question = f"What is the classifier's label ({sense.attribute})?"
            labels[sense.name] = class_of[
                choose(tuple(class_of), question, ask=console.ask, show=console.out.print)
            ]
    model = domain.model
    check = getattr(model, "read_observation", lambda _answer: None)  # of generative models
    world = ConsoleWorld(model.observations, ask=console.ask, show=console.out.print, check=check)
    return Case(complete, labels, world, None, None)


def print_person(domain: Domain, person: Mapping[str, str]) -> None:
    """Print what the robot cannot observe of a simulated person."""
    observable = (*domain.observed, *[sense.attribute for sense in domain.all_senses])
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

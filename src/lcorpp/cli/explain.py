"""`lcorpp explain`: one decision, step by step."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from lcorpp.cli import console, options
from lcorpp.errors import DecisionError, DomainError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.decision import Robot
    from lcorpp.domains import Domain
    from lcorpp.protocols import World
    from lcorpp.values import Label, Likelihood, Step


def explain(
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    fact: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="An observed fact; repeatable.")
    ] = None,
    label: Annotated[
        str | None, typer.Option(help="The classifier's label: a value of the attribute that it feeds.")
    ] = None,
    likelihood: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VALUE=NUMBER",
            help="Soft evidence instead of a label: the likelihood of a value, by default 1; repeatable.",
        ),
    ] = None,
    truth: Annotated[
        str | None, typer.Option(metavar="VALUE", help="The person's true value; by default it is drawn.")
    ] = None,
    answers: Annotated[
        str | None,
        typer.Option(metavar="A,B,...", help="The person's answers in order; by default they are drawn."),
    ] = None,
    seed: options.SeedOption = 0,
    interactive: Annotated[
        bool, typer.Option("--interactive", help="You are the person: type the facts and answers.")
    ] = False,
) -> None:
    """Print one decision, step by step.

    The steps are label, evidence, posterior, prior, then every action with its observation and belief.
    The person is simulated; values that are not given are drawn. With --interactive you are the person.
    """
    from lcorpp.cli.robot_output import print_classifier, print_domain, print_solution
    from lcorpp.domains import load_domain
    from lcorpp.experiments.setup import from_channel, make_robot, solve_domain
    from lcorpp.planning import Planner

    if interactive and sys.stdin is None:
        raise DecisionError("--interactive needs an input to read your answers from; it is closed")
    if interactive and (truth is not None or answers is not None):
        raise DomainError("--truth and --answers describe a simulated person; --interactive has none")
    loaded = load_domain(domain, preset=preset)
    facts = _parse_facts(loaded, fact or [])
    if label is not None and likelihood:
        raise DomainError("--label and --likelihood are both evidence of the classifier; expected one")
    if truth is not None and truth not in loaded.values:
        raise DomainError(f"--truth {truth!r}: {expected_one_of(loaded.values)}")
    script = None if answers is None else _parse_answers(loaded, answers)
    predicted: Label | None = None if label is None else _parse_class(loaded, label)
    setup = from_channel(loaded)
    if likelihood:
        predicted = _parse_likelihood(loaded, likelihood)
        setup = replace(setup, program=loaded.soft_program)
    print_domain(loaded)
    print_classifier(setup, "channel")
    with console.show_progress("solving the POMDP"):
        solution = solve_domain(loaded)
    print_solution(solution)
    robot = make_robot(loaded, setup, Planner(solution))
    if interactive:
        case = _ask_case(loaded, facts, predicted)
    else:
        case = _simulate_case(loaded, facts, predicted, truth, script, seed)
    _print_decision(loaded, robot, case)


class _Case(NamedTuple):
    """One person to decide about.

    facts: observed attribute -> value. predicted: the classifier's output, a class or a likelihood.
    world: answers the robot's actions. truth: the true value of the target, None if it is unknown.
    """

    facts: Mapping[str, str]
    predicted: Label
    world: World
    truth: str | None


def _ask_case(domain: Domain, facts: Mapping[str, str], predicted: Label | None) -> _Case:
    """Ask the user, who is the person, for the facts and the label that no option gives."""
    from lcorpp.worlds import ConsoleWorld, choose

    complete = dict(facts)
    for name in domain.observed:
        if name not in complete:
            values = domain.program.attributes[name].values
            complete[name] = choose(values, f"What is the {name}?", show=console.out.print)
    if predicted is None:
        class_of = {label: name for name, label in domain.learning.label_of.items()}
        question = f"What is the classifier's label ({domain.learning.attribute})?"
        predicted = class_of[choose(tuple(class_of), question, show=console.out.print)]
    return _Case(complete, predicted, ConsoleWorld(domain.pomdp.observations, show=console.out.print), None)


def _simulate_case(
    domain: Domain,
    facts: Mapping[str, str],
    predicted: Label | None,
    truth: str | None,
    answers: Sequence[str] | None,
    seed: int,
) -> _Case:
    """Draw what is None and the facts that are not given; print what the robot cannot observe."""
    import numpy as np

    from lcorpp.simulation import NoisyChannel, Population, SimulationModel

    rng = np.random.default_rng([seed, 0])
    given = facts if truth is None else {**facts, domain.target: truth}
    person = Population(domain).sample(1, rng, given)[0]
    if predicted is None:
        channel = NoisyChannel.of(domain)
        predicted = channel.classify_many(channel.trajectories([person], rng))[0]
    world = SimulationModel(domain).make_world(person, rng) if answers is None else ScriptedWorld(answers)
    observable = (*domain.observed, domain.learning.attribute)
    hidden = ", ".join(f"{name}={value}" for name, value in person.items() if name not in observable)
    console.out.print(f"a simulated person; hidden from the robot: {hidden}", style="dim")
    return _Case({name: person[name] for name in domain.observed}, predicted, world, person[domain.target])


def _print_decision(domain: Domain, robot: Robot, case: _Case) -> None:
    """Run Algorithm 2 and print each of its steps."""
    from lcorpp.decision.dt_control import act_until_report

    evidence = domain.evidence(case.facts, case.predicted)
    if isinstance(case.predicted, str):
        attribute = domain.learning.attribute
        console.print_heading(1, "learning", "the classifier's label")
        console.out.print(f"     {case.predicted} ({attribute} = {evidence[attribute]})")
    else:
        console.print_heading(1, "learning", "the classifier's likelihood, scaled to a maximum of 1")
        _print_bars(case.predicted)
    subtitle = "given " + ", ".join(f"{name} = {value}" for name, value in evidence.items())
    console.print_heading(2, "reasoning", subtitle)
    hidden = [
        name
        for name, attribute in domain.program.attributes.items()
        if not attribute.arguments and name not in evidence and name != domain.target
    ]
    for name in (*hidden, domain.target):
        marginal = robot.reasoner.posterior(name, evidence)
        if marginal is not None:
            console.out.print(f"   {name}")
            _print_bars(marginal)
    prior = robot.planner.start if marginal is None else domain.prior(marginal)
    console.print_heading(3, "planning", "the prior belief")
    states = domain.pomdp.states
    _print_bars(zip(states, prior.tolist(), strict=True), possible=True)
    numbers = itertools.count(4)

    def print_step(step: Step) -> None:
        if step.observation is None:
            console.print_heading(next(numbers), step.action, "the decision")
            return
        console.print_heading(next(numbers), step.action, f"observes {step.observation}")
        _print_bars(zip(states, step.belief.tolist(), strict=True), possible=True)

    _, report = act_until_report(robot, prior, case.world, listener=print_step)
    verdict = " (correct)" if case.truth == report else f" (wrong: {case.truth})"
    console.out.print()
    console.out.print(f"{domain.target} = {report}{'' if case.truth is None else verdict}", style="bold")


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


def _parse_answers(domain: Domain, text: str) -> list[str]:
    """Return the answers in a text such as "pos,neg"; each is an observation of the POMDP."""
    answers = [part.strip() for part in text.split(",")]
    for answer in answers:
        if answer not in domain.pomdp.observations:
            raise DomainError(f"--answers {answer!r}: {expected_one_of(domain.pomdp.observations)}")
    return answers


def _parse_facts(domain: Domain, pairs: list[str]) -> dict[str, str]:
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
    domain.evidence(facts, None)  # raises DomainError for an unknown fact
    return facts


def _parse_class(domain: Domain, text: str, option: str = "--label") -> str:
    """Return the class that a text names: by itself, or by its label in the program."""
    for class_name, label in domain.learning.label_of.items():
        if text in (label, class_name):
            return class_name
    raise DomainError(f"{option} {text!r}: {expected_one_of(domain.learning.label_of.values())}")


def _parse_likelihood(domain: Domain, pairs: list[str]) -> Likelihood:
    """Return the likelihood of each class: the given weight, 1 by default."""
    import numpy as np

    from lcorpp.values import Likelihood

    weights: dict[str, float] = {}
    for pair in pairs:
        name, _, number = (part.strip() for part in pair.partition("="))
        try:
            weight = float(number)
        except ValueError:
            raise DomainError(f"--likelihood {pair!r}: expected VALUE=NUMBER") from None
        class_name = _parse_class(domain, name, "--likelihood")
        if class_name in weights:
            raise DomainError(f"--likelihood {pair!r}: {name} is given twice")
        weights[class_name] = weight
    return Likelihood(domain.values, np.array([weights.get(value, 1.0) for value in domain.values]))


def _print_bars(pairs: Iterable[tuple[str, float]], *, possible: bool = False) -> None:
    """Print names with their probabilities; `possible`: only those of positive probability."""
    shown = list(pairs)
    width = max(len(name) for name, _ in shown)
    for name, probability in shown:
        if probability > 0 or not possible:
            console.print_probability(name, probability, width)

"""`lcorpp explain`: one decision, step by step."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console, options
from lcorpp.errors import DecisionError, DomainError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.decision import Robot
    from lcorpp.domains import Domain
    from lcorpp.protocols import World
    from lcorpp.values import Belief, Label, Likelihood, Step


def explain(
    domain: options.DomainArgument = "intention",
    preset: options.PresetOption = None,
    fact: Annotated[
        list[str] | None,
        typer.Option("--fact", metavar="NAME=VALUE", help="An observed fact; repeatable."),
    ] = None,
    label: Annotated[
        str | None,
        typer.Option("--label", help="The classifier's label: a value of the attribute that it feeds."),
    ] = None,
    likelihood: Annotated[
        list[str] | None,
        typer.Option(
            "--likelihood",
            metavar="VALUE=NUMBER",
            help="Soft evidence instead of a label: the likelihood of a value, by default 1; repeatable.",
        ),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option("--truth", metavar="VALUE", help="The person's true value; by default it is drawn."),
    ] = None,
    answers: Annotated[
        str | None,
        typer.Option(
            "--answers", metavar="A,B,...", help="The person's answers in order; by default they are drawn."
        ),
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
    soft = _parse_likelihood(loaded, likelihood) if likelihood else None
    predicted: Label | None = soft if label is None else _parse_class(loaded, label)
    print_domain(loaded)
    setup = from_channel(loaded)
    print_classifier(setup, "channel")
    with console.show_progress("solving the POMDP"):
        solution = solve_domain(loaded)
    print_solution(solution)
    robot = make_robot(
        loaded, setup if soft is None else replace(setup, program=loaded.soft_program), Planner(solution)
    )
    if interactive:
        case = _ask_case(loaded, facts, predicted)
    else:
        case = _simulate_case(loaded, facts, predicted, truth=truth, script=script, seed=seed)
    _print_decision(loaded, robot, case)


@dataclass(frozen=True)
class _Case:
    """One person to decide about.

    facts: observed attribute -> value. predicted: the classifier's output, a class or a likelihood.
    world: answers the robot's actions. actual: the true value of the target, None if it is unknown.
    """

    facts: Mapping[str, str]
    predicted: Label
    world: World
    actual: str | None


def _ask_case(domain: Domain, facts: Mapping[str, str], predicted: Label | None) -> _Case:
    """Ask the user, who is the person, for the facts and the label that no option gives."""
    from lcorpp.worlds import ConsoleWorld, choose

    complete = dict(facts)
    for name in domain.observed:
        if name not in complete:
            values = domain.program.attributes[name].values
            complete[name] = choose(values, f"What is the {name}?", show=console.out.print)
    if predicted is None:
        labels = tuple(domain.learning.label_of.values())
        question = f"What is the classifier's label ({domain.learning.attribute})?"
        predicted = _parse_class(domain, choose(labels, question, show=console.out.print))
    return _Case(complete, predicted, ConsoleWorld(domain.pomdp.observations, show=console.out.print), None)


def _simulate_case(
    domain: Domain,
    facts: Mapping[str, str],
    predicted: Label | None,
    *,
    truth: str | None,
    script: Sequence[str] | None,
    seed: int,
) -> _Case:
    """Draw a person, and the classifier's label if no option gives it; print what the robot cannot observe.

    Args:
        truth: the person's true value; None draws it. script: the person's answers; None draws them.
    """
    import numpy as np

    from lcorpp.simulation.people import Population
    from lcorpp.simulation.simulated_classifier import NoisyChannel
    from lcorpp.simulation.world import SimulationModel

    rng = np.random.default_rng([seed, 0])
    given = facts if truth is None else {**facts, domain.target: truth}
    person = Population(domain).sample(1, rng, given)[0]
    if predicted is None:
        channel = NoisyChannel.of(domain)
        predicted = channel.classify_many(channel.trajectories([person], rng))[0]
    world = SimulationModel(domain).make_world(person, rng) if script is None else ScriptedWorld(script)
    observable = (*domain.observed, domain.learning.attribute)
    hidden = ", ".join(f"{name}={value}" for name, value in person.items() if name not in observable)
    console.out.print(f"a simulated person; hidden from the robot: {hidden}", style="dim")
    return _Case({name: person[name] for name in domain.observed}, predicted, world, person[domain.target])


def _print_decision(domain: Domain, robot: Robot, case: _Case) -> None:
    """Run Algorithm 2 and print each of its steps."""
    from lcorpp.decision.dt_control import act_until_report

    evidence = domain.evidence(case.facts, case.predicted)
    _print_prediction(domain, case.predicted, evidence)
    subtitle = "given " + ", ".join(f"{name} = {value}" for name, value in evidence.items())
    console.print_heading(2, "reasoning", subtitle)
    _print_posteriors(domain, robot, evidence)
    marginal = robot.reasoner.posterior(domain.target, evidence)
    prior = robot.planner.start if marginal is None else domain.prior(marginal)
    console.print_heading(3, "planning", "the prior belief")
    _print_belief(domain, prior)
    numbers = itertools.count(4)

    def print_step(step: Step) -> None:
        result = f"observes {step.observation}" if step.observation is not None else "the decision"
        console.print_heading(next(numbers), step.action, result)
        if step.observation is not None:
            _print_belief(domain, step.belief)

    _, report = act_until_report(robot, prior, case.world, listener=print_step)
    verdict = (
        "" if case.actual is None else " (correct)" if case.actual == report else f" (wrong: {case.actual})"
    )
    console.out.print()
    console.out.print(f"{domain.target} = {report}{verdict}", style="bold")


class ScriptedWorld:
    """A world whose person gives prepared answers (`lcorpp.protocols.World`)."""

    def __init__(self, answers: Sequence[str]) -> None:
        self._answers, self._position = tuple(answers), 0

    def act(self, action: str) -> str:
        if self._position == len(self._answers):
            raise DecisionError(
                f"--answers has {len(self._answers)} answers, and the robot needs another one, to {action}"
            )
        self._position += 1
        return self._answers[self._position - 1]

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


def _parse_class(domain: Domain, name: str, option: str = "--label") -> str:
    """Return the class of a label of the program; the name of a class is accepted, too."""
    for class_name, label in domain.learning.label_of.items():
        if name in (label, class_name):
            return class_name
    raise DomainError(f"{option} {name!r}: {expected_one_of(tuple(domain.learning.label_of.values()))}")


def _parse_likelihood(domain: Domain, pairs: list[str]) -> Likelihood:
    """Return the likelihood of each class: the given weight, 1 by default."""
    import numpy as np

    from lcorpp.values import Likelihood

    weights = dict.fromkeys(domain.values, 1.0)
    names = set[str]()
    for pair in pairs:
        name, _, number = (part.strip() for part in pair.partition("="))
        try:
            weight = float(number)
        except ValueError:
            raise DomainError(f"--likelihood {pair!r}: expected VALUE=NUMBER") from None
        if name in names:
            raise DomainError(f"--likelihood {pair!r}: {name} is given twice")
        weights[_parse_class(domain, name, "--likelihood")] = weight
        names.add(name)
    return Likelihood(domain.values, np.array([weights[value] for value in domain.values]))


def _print_prediction(domain: Domain, predicted: Label, evidence: Mapping[str, Label]) -> None:
    """Print the predicted class and its label, or the likelihood of each class."""
    if isinstance(predicted, str):
        attribute = domain.learning.attribute
        console.print_heading(1, "learning", "the classifier's label")
        console.out.print(f"     {predicted} ({attribute} = {evidence[attribute]})")
        return
    console.print_heading(1, "learning", "the classifier's likelihood, scaled to a maximum of 1")
    for class_name, weight in predicted:
        console.print_probability(class_name, weight, max(map(len, predicted.values)))


def _print_posteriors(domain: Domain, robot: Robot, evidence: Mapping[str, Label]) -> None:
    """Print the marginal of every attribute that is not observed, the target last."""
    hidden = [
        name
        for name, attribute in domain.program.attributes.items()
        if not attribute.arguments and name not in evidence and name != domain.target
    ]
    for name in (*hidden, domain.target):
        marginal = robot.reasoner.posterior(name, evidence)
        if marginal is not None:
            console.out.print(f"   {name}")
            width = max(map(len, marginal.values))
            for value, probability in marginal:
                console.print_probability(value, probability, width)


def _print_belief(domain: Domain, belief: Belief) -> None:
    """Print the states of positive probability under a belief (S,)."""
    width = max(map(len, domain.pomdp.states))
    for state, probability in zip(domain.pomdp.states, belief.tolist(), strict=True):
        if probability > 0:
            console.print_probability(state, probability, width)

"""`lcorpp explain`: one decision, step by step."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
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
    import numpy as np

    from lcorpp.cli.domain_output import print_domain
    from lcorpp.cli.robot_output import print_classifier, print_solution
    from lcorpp.decision.dt_control import act_until_report
    from lcorpp.domains import load_domain
    from lcorpp.experiments.setup import from_channel, make_robot, solve_domain
    from lcorpp.planning import Planner
    from lcorpp.simulation.channel import NoisyChannel
    from lcorpp.simulation.population import Population
    from lcorpp.simulation.world import SimulationModel
    from lcorpp.worlds import ConsoleWorld

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
    evidence_label: Label | None = soft if label is None else _class_of_label(loaded, label)
    print_domain(loaded)
    setup = from_channel(loaded)
    print_classifier(setup, "channel")
    with console.progress("solving the POMDP"):
        solution = solve_domain(loaded)
    print_solution(solution)
    robot = make_robot(
        loaded, setup if soft is None else replace(setup, program=loaded.soft_program), Planner(solution)
    )
    world: World
    actual: str | None = None
    if interactive:
        facts, evidence_label = _ask_facts(loaded, facts, evidence_label)
        world = ConsoleWorld(loaded.pomdp.observations, show=console.out.print)
    else:
        rng = np.random.default_rng([seed, 0])
        given = facts if truth is None else {**facts, loaded.target: truth}
        person = Population(loaded).sample(1, rng, given)[0]
        facts = {name: person[name] for name in loaded.observed}
        actual = person[loaded.target]
        if evidence_label is None:
            channel = NoisyChannel.of(loaded)
            evidence_label = channel.classify_many(channel.trajectories([person], rng))[0]
        world = SimulationModel(loaded).make_world(person, rng) if script is None else ScriptedWorld(script)
        shown = (*facts, loaded.learning.attribute)
        hidden = ", ".join(f"{name}={value}" for name, value in person.items() if name not in shown)
        console.out.print(f"a simulated person; hidden from the robot: {hidden}", style="dim")
    evidence = loaded.evidence(facts, evidence_label)
    _print_label(loaded, evidence_label, evidence)
    subtitle = "given " + ", ".join(f"{name} = {value}" for name, value in evidence.items())
    console.print_heading(2, "reasoning", subtitle)
    _print_posteriors(loaded, robot, evidence)
    marginal = robot.reasoner.posterior(loaded.target, evidence)
    prior = robot.planner.start if marginal is None else loaded.prior(marginal)
    console.print_heading(3, "planning", "the prior belief")
    _print_belief(loaded, prior)
    count = 0

    def print_step(step: Step) -> None:
        nonlocal count
        count += 1
        result = f"observes {step.observation}" if step.observation is not None else "the decision"
        console.print_heading(3 + count, step.action, result)
        if step.observation is not None:
            _print_belief(loaded, step.belief)

    _, report = act_until_report(robot, prior, world, listener=print_step)
    verdict = "" if actual is None else (" (correct)" if actual == report else f" (wrong: {actual})")
    console.out.print()
    console.out.print(f"{loaded.target} = {report}{verdict}", style="bold")


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
    answers = [part.strip() for part in text.split(",")]
    for answer in answers:
        if answer not in domain.pomdp.observations:
            raise DomainError(f"--answers {answer!r}: {expected_one_of(domain.pomdp.observations)}")
    return answers


def _parse_facts(domain: Domain, pairs: list[str]) -> dict[str, str]:
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
    domain.evidence(facts, None)
    return facts


def _class_of_label(domain: Domain, label: str, option: str = "--label") -> str:
    """Return the class of a label of the program; a class itself is accepted, too."""
    for value, word in domain.learning.label_of.items():
        if label in (word, value):
            return value
    raise DomainError(f"{option} {label!r}: {expected_one_of(tuple(domain.learning.label_of.values()))}")


def _parse_likelihood(domain: Domain, pairs: list[str]) -> Likelihood:
    """Return the given weights, 1 for other values."""
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
        weights[_class_of_label(domain, name, "--likelihood")] = weight
        names.add(name)
    return Likelihood(domain.values, np.array([weights[value] for value in domain.values]))


def _ask_facts(domain: Domain, facts: Mapping[str, str], label: Label | None) -> tuple[dict[str, str], Label]:
    """Ask the user for the facts and the label that no option gives."""
    from lcorpp.worlds import choose

    complete = dict(facts)
    for name in domain.observed:
        if name not in complete:
            values = domain.program.attributes[name].values
            complete[name] = choose(values, f"What is the {name}?", show=console.out.print)
    if label is None:
        words = tuple(domain.learning.label_of.values())
        question = f"What is the classifier's label ({domain.learning.attribute})?"
        label = _class_of_label(domain, choose(words, question, show=console.out.print))
    return complete, label


def _print_label(domain: Domain, label: Label | None, evidence: Mapping[str, Label]) -> None:
    if label is None or isinstance(label, str):
        attribute = domain.learning.attribute
        console.print_heading(1, "learning", "the classifier's label")
        console.out.print(f"     {label} ({attribute} = {evidence[attribute]})")
        return
    console.print_heading(1, "learning", "the classifier's likelihood, in proportion")
    for value, weight in label:
        console.print_probability(value, weight, max(map(len, label.values)))


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
            for value, share in marginal:
                console.print_probability(value, share, width)


def _print_belief(domain: Domain, belief: Belief) -> None:
    width = max(map(len, domain.pomdp.states))
    for state, share in zip(domain.pomdp.states, belief.tolist(), strict=True):
        if share > 0:
            console.print_probability(state, share, width)

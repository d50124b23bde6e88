"""`lcorpp explain`: one decision, told step by step."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import console as show
from lcorpp.errors import DecisionError, DomainError, expected_one_of

if TYPE_CHECKING:
    from lcorpp.decision import Robot
    from lcorpp.domains import Domain
    from lcorpp.protocols import World
    from lcorpp.values import Belief, Label, Likelihood, Step


def explain(
    domain: show.DomainArgument = "intention",
    preset: show.PresetOption = None,
    fact: Annotated[
        list[str] | None,
        typer.Option("--fact", metavar="NAME=VALUE", help="An observed fact; again for more."),
    ] = None,
    label: Annotated[
        str | None,
        typer.Option("--label", help="What the classifier says: a value of the attribute it feeds."),
    ] = None,
    likelihood: Annotated[
        list[str] | None,
        typer.Option(
            "--likelihood",
            metavar="VALUE=NUMBER",
            help="Soft evidence in place of a label: how likely what was seen is if that is so; again for"
            " others, which have 1.",
        ),
    ] = None,
    seed: show.SeedOption = 0,
    interactive: Annotated[
        bool, typer.Option("--interactive", help="You are the person: the facts and answers are yours.")
    ] = False,
) -> None:
    """Tell one decision step by step: label, evidence, posterior, prior, then every action and belief.

    The person is simulated, with the facts given and the rest drawn; with --interactive it is you.
    """
    import numpy as np

    from lcorpp.cli import preparation
    from lcorpp.cli.eyes import channel_eyes
    from lcorpp.decision.dt_control import act_until_report
    from lcorpp.domains import load_domain
    from lcorpp.simulation.channel import NoisyChannel
    from lcorpp.simulation.population import Population
    from lcorpp.simulation.world import SimulationModel
    from lcorpp.worlds import ConsoleWorld

    if interactive and sys.stdin is None:
        raise DecisionError("--interactive needs an input to read your answers from; it is closed")
    loaded = load_domain(domain, preset=preset)
    preparation.introduce(loaded)
    facts = _facts(loaded, fact or [])
    if label is not None and likelihood:
        raise DomainError("--label and --likelihood both say what the classifier saw; expected one of them")
    soft = _likelihood(loaded, likelihood) if likelihood else None
    given: Label | None = soft if label is None else _claimed(loaded, label)
    eyes = channel_eyes(loaded)
    robot = preparation.robot(loaded, eyes if soft is None else replace(eyes, program=loaded.soft_program))
    rng = np.random.default_rng([seed, 0])
    world: World
    truth: str | None = None
    if interactive:
        facts, given = _asked(loaded, facts, given)
        world = ConsoleWorld(loaded.pomdp.observations, show=show.console.print)
    else:
        person = Population(loaded).sample(1, rng, facts)[0]
        facts = {name: person[name] for name in loaded.observed}
        truth = person[loaded.target]
        if given is None:
            channel = NoisyChannel.of(loaded)
            given = channel.classify_many(channel.trajectories([person], rng))[0]
        world = SimulationModel(loaded).make_world(person, rng)
        hidden = ", ".join(
            f"{k}={v}" for k, v in person.items() if k not in (*facts, loaded.learning.attribute)
        )
        show.console.print(f"somebody is there; hidden from the robot: {hidden}", style="dim")
    evidence = loaded.evidence(facts, given)
    if soft is None:
        show.heading(1, "learning", "the classifier's label")
        show.console.print(
            f"     {given} ({loaded.learning.attribute} = {evidence[loaded.learning.attribute]})"
        )
    else:
        show.heading(1, "learning", "how likely what the classifier saw is, in proportion")
        for value, weight in soft:
            show.line(value, weight, max(map(len, soft.values)))
    show.heading(
        2, "reasoning", "given " + ", ".join(f"{name} = {value}" for name, value in evidence.items())
    )
    _posteriors(loaded, robot, evidence)
    marginal = robot.reasoner.posterior(loaded.target, evidence)
    prior = robot.planner.start if marginal is None else loaded.prior(marginal)
    show.heading(3, "planning", "the prior belief")
    _belief(loaded, prior)
    count = 0

    def tell(step: Step) -> None:
        nonlocal count
        count += 1
        heard = f"observes {step.observation}" if step.observation is not None else "the decision"
        show.heading(3 + count, step.action, heard)
        if step.observation is not None:
            _belief(loaded, step.belief)

    _, report = act_until_report(robot, prior, world, listener=tell)
    verdict = "" if truth is None else (" (right)" if truth == report else f" (wrong: {truth})")
    show.console.print()
    show.console.print(f"{loaded.target} = {report}{verdict}", style="bold")


def _facts(domain: Domain, pairs: list[str]) -> dict[str, str]:
    facts = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals:
            raise DomainError(
                f"--fact {pair!r}: expected NAME=VALUE with NAME among {', '.join(domain.observed)}"
            )
        if name.strip() in facts:
            raise DomainError(f"--fact {pair!r}: {name.strip()} is given twice")
        facts[name.strip()] = value.strip()
    domain.evidence(facts, None)
    return facts


def _claimed(domain: Domain, label: str, option: str = "--label") -> str:
    """The class that a label of the program, or the class itself, stands for."""
    for value, word in domain.learning.label_of.items():
        if label in (word, value):
            return value
    raise DomainError(f"{option} {label!r}: {expected_one_of(tuple(domain.learning.label_of.values()))}")


def _likelihood(domain: Domain, pairs: list[str]) -> Likelihood:
    """The weights that the user gives, 1 for what is left out."""
    import numpy as np

    from lcorpp.values import Likelihood

    weights = dict.fromkeys(domain.values, 1.0)
    named = set[str]()
    for pair in pairs:
        name, _, number = (part.strip() for part in pair.partition("="))
        try:
            weight = float(number)
        except ValueError:
            raise DomainError(f"--likelihood {pair!r}: expected VALUE=NUMBER") from None
        if name in named:
            raise DomainError(f"--likelihood {pair!r}: {name} is given twice")
        weights[_claimed(domain, name, "--likelihood")] = weight
        named.add(name)
    return Likelihood(domain.values, np.array([weights[value] for value in domain.values]))


def _asked(domain: Domain, facts: Mapping[str, str], label: Label | None) -> tuple[dict[str, str], Label]:
    """The facts and the label, asked of the user where they are not given."""
    from lcorpp.worlds import choose

    asked = dict(facts)
    for name in domain.observed:
        if name not in asked:
            asked[name] = choose(
                domain.program.attributes[name].values, f"What is the {name}?", show=show.console.print
            )
    if label is None:
        words = tuple(domain.learning.label_of.values())
        label = _claimed(
            domain,
            choose(
                words, f"What does the classifier say ({domain.learning.attribute})?", show=show.console.print
            ),
        )
    return asked, label


def _posteriors(domain: Domain, robot: Robot, evidence: Mapping[str, Label]) -> None:
    """The marginal of every attribute that is not observed, the target last."""
    hidden = [
        name
        for name, attribute in domain.program.attributes.items()
        if not attribute.arguments and name not in evidence and name != domain.target
    ]
    for name in (*hidden, domain.target):
        marginal = robot.reasoner.posterior(name, evidence)
        if marginal is not None:
            show.console.print(f"   {name}")
            width = max(map(len, marginal.values))
            for value, share in marginal:
                show.line(value, share, width)


def _belief(domain: Domain, belief: Belief) -> None:
    width = max(map(len, domain.pomdp.states))
    for state, share in zip(domain.pomdp.states, belief.tolist(), strict=True):
        if share > 0:
            show.line(state, share, width)

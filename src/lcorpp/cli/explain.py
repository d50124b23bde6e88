"""`lcorpp explain`: one decision, told step by step."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from lcorpp.cli import show
from lcorpp.errors import DecisionError, DomainError, expected

if TYPE_CHECKING:
    from lcorpp.decision import Robot
    from lcorpp.domains import Domain
    from lcorpp.interfaces import World
    from lcorpp.values import Belief, Step


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
    from lcorpp.decision.dt_control import act_until_report
    from lcorpp.domains import load_domain
    from lcorpp.experiments.people import Channel, Population
    from lcorpp.experiments.simulated_world import Stage
    from lcorpp.robots.console import ConsoleWorld

    if interactive and sys.stdin is None:
        raise DecisionError("--interactive needs an input to read your answers from; it is closed")
    loaded = load_domain(domain, preset=preset)
    preparation.introduce(loaded)
    facts = _facts(loaded, fact or [])
    given = None if label is None else _claimed(loaded, label)
    robot = preparation.robot(loaded, preparation.channel_eyes(loaded))
    rng = np.random.default_rng([seed, 0])
    world: World
    truth: str | None = None
    if interactive:
        facts, given = _asked(loaded, facts, given)
        world = ConsoleWorld(loaded.pomdp.observations, tell=show.console.print)
    else:
        person = Population(loaded).people(1, rng, facts)[0]
        facts = {name: person[name] for name in loaded.observed}
        truth = person[loaded.target]
        if given is None:
            channel = Channel.of(loaded)
            given = channel.classify_many(channel.trajectories([person], rng))[0]
        world = Stage(loaded).world(person, rng)
        hidden = ", ".join(f"{k}={v}" for k, v in person.items() if k not in (*facts, loaded.attribute))
        show.console.print(f"somebody is there; hidden from the robot: {hidden}", style="dim")
    evidence = loaded.evidence(facts, given)
    show.heading(1, "learning", "the classifier's label")
    show.console.print(f"     {given} ({loaded.attribute} = {evidence[loaded.attribute]})")
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


def _claimed(domain: Domain, label: str) -> str:
    """The class that a label of the program, or the class itself, stands for."""
    for value, word in domain.label_of.items():
        if label in (word, value):
            return value
    raise DomainError(f"--label {label!r}: {expected(tuple(domain.label_of.values()))}")


def _asked(domain: Domain, facts: Mapping[str, str], label: str | None) -> tuple[dict[str, str], str]:
    """The facts and the label, asked of the user where they are not given."""
    from lcorpp.robots.console import choose

    asked = dict(facts)
    for name in domain.observed:
        if name not in asked:
            asked[name] = choose(
                domain.program.attributes[name].values, f"What is the {name}?", tell=show.console.print
            )
    if label is None:
        words = tuple(domain.label_of.values())
        label = _claimed(
            domain,
            choose(words, f"What does the classifier say ({domain.attribute})?", tell=show.console.print),
        )
    return asked, label


def _posteriors(domain: Domain, robot: Robot, evidence: Mapping[str, str]) -> None:
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

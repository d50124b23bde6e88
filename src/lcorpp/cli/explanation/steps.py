"""One decision, printed step by step."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from contextlib import suppress
from time import perf_counter
from typing import TYPE_CHECKING

from lcorpp.cli import console
from lcorpp.errors import NoValueError

if TYPE_CHECKING:
    from lcorpp.decision import Robot
    from lcorpp.domains import Domain
    from lcorpp.protocols import World
    from lcorpp.values import Belief, Episode, Label, SharedValue, Step


def decide_and_print(
    domain: Domain,
    robot: Robot,
    facts: Mapping[str, str],
    labels: Mapping[str, Label],
    world: World,
    truth: SharedValue | None,
) -> Episode:
    """Run Algorithm 2 on the outputs of the robot's classifiers, and print each of its steps.

    Args:
        facts: observed attribute -> value. labels: sense -> output.
        truth: the true shared value, None if it is unknown.
    """
    from lcorpp.decision.dt_control import act_until_report, infer_prior
    from lcorpp.reasoning import Reasoner
    from lcorpp.trust import Trust
    from lcorpp.values import Episode, format_value

    began = perf_counter()
    evidence, marginal, prior = infer_prior(robot, facts, labels)
    seconds = {"reason": perf_counter() - began}
    for name, predicted in labels.items():
        owner = f"{name}'s classifier's" if len(domain.senses) > 1 else "the classifier's"
        if isinstance(predicted, str):
            attribute = domain.find_sense(name).attribute
            console.print_heading(1, "learning", f"{owner} label")
            console.out.print(f"     {predicted} ({attribute} = {evidence[attribute]})")
        else:
            console.print_heading(1, "learning", f"{owner} likelihood, scaled to a maximum of 1")
            if predicted.observed:
                console.out.print(f"     {predicted.observed}")
            _print_bars(predicted)
    for name in [sense for sense in robot.classifiers if sense not in labels]:
        console.print_heading(1, "learning", f"no label: {name} does not perceive the person")
    subtitle = "given " + ", ".join(f"{name} = {value}" for name, value in evidence.items())
    console.print_heading(2, "reasoning", subtitle)
    known = {*evidence, domain.shared, *[baseline.attribute for baseline in domain.baselines]}
    hidden = [
        name
        for name, attribute in domain.program.attributes.items()
        if not attribute.arguments and name not in known
    ]
    if not isinstance(robot.reasoner, Reasoner):
        hidden = []  # others answer for the shared variables alone
    if isinstance(robot.reasoner, Trust):
        trust = robot.reasoner
        console.out.print(f"   weight of each source after {trust.n_people} people")
        _print_bars(zip(trust.sources, trust.weights.tolist(), strict=True))
        if len(trust.forms) > 1:
            console.out.print("   weight of each form of answers")
            _print_bars(zip(trust.forms, trust.form_weights.tolist(), strict=True))
    answers = {}
    for name in hidden:
        with suppress(NoValueError):  # an attribute that may have no value has no distribution
            answers[name] = robot.reasoner.posterior(name, evidence)
    for title, answer in (*answers.items(), (", ".join(domain.reasoning.shared), marginal)):
        if answer is not None:
            console.out.print(f"   {title}")
            _print_bars([(format_value(value), p) for value, p in answer], possible=answer is marginal)
    console.print_heading(3, "planning", "the prior belief")
    states = domain.model.states
    _print_bars(zip(states, prior.tolist(), strict=True), possible=True)
    numbers, current = itertools.count(4), prior

    def print_step(step: Step) -> None:
        nonlocal current
        before, current = current, step.belief
        if step.observation is None:
            console.print_heading(next(numbers), step.action, "the decision")
            _print_search(robot, before)
            return
        console.print_heading(next(numbers), step.action, f"observes {step.observation}")
        _print_search(robot, before)
        _print_bars(zip(states, step.belief.tolist(), strict=True), possible=True)

    steps, report, plan_seconds = act_until_report(robot, prior, world, listener=print_step)
    verdict = " (correct)" if truth == report else f" (wrong: {format_value(truth or '')})"
    console.out.print()
    shared = ", ".join(domain.reasoning.shared)
    console.out.print(
        f"{shared} = {format_value(report or '')}{'' if truth is None else verdict}", style="bold"
    )
    seconds["plan"] = plan_seconds
    return Episode(dict(labels), evidence, marginal, prior, steps, report, seconds)


def _print_search(robot: Robot, belief: Belief) -> None:
    """Print what another action may gain at most, or an estimate, if the robot searched at a belief."""
    describe = getattr(robot.planner, "describe_search", None)  # of planners that search
    if describe is not None:
        console.out.print(f"   {describe(belief)}")


def _print_bars(pairs: Iterable[tuple[str, float]], *, possible: bool = False) -> None:
    """Print names with their probabilities; `possible`: only those of positive probability."""
    shown = list(pairs)
    width = max(len(name) for name, _ in shown)
    for name, probability in shown:
        if probability > 0 or not possible:
            console.print_probability(name, probability, width)

"""Algorithm 2, decision-theoretic control: from one instance to one label."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lcorpp.errors import DecisionError
from lcorpp.protocols import Classifier, Planner, Reasoner, Vocabulary, World
from lcorpp.values import Belief, Episode, Instance, Step

MAX_STEPS = 500
"""A decision longer than this is taken for a policy that never reports."""


@dataclass(frozen=True, eq=False)
class Robot:
    """The parts of a deciding robot: rho, theta, pi (with its model M) and the words between them."""

    classifier: Classifier
    reasoner: Reasoner
    planner: Planner
    domain: Vocabulary


def dt_control(robot: Robot, instance: Instance, world: World, *, max_steps: int = MAX_STEPS) -> Episode:
    """Decide about one person: classify, reason, then act until the report.

    Args:
        robot: the parts.
        instance: what is perceived of the person before any action.
        world: where the actions are done.
        max_steps: actions after which the policy is taken for one that never reports.

    Returns:
        The episode, with every intermediate result.

    Raises:
        UndefinedError: the reasoner's evidence is impossible.
        ObservationError: the world returned an observation that the model calls impossible.
        DecisionError: no report within `max_steps` actions.

    Source: Algorithm 2. Line 1 is `classify`, 2 `evidence`, 3 to 6 `posterior` of the shared variable,
    7 `prior`, 8 to 12 `act_until_report`, 13 the value that the last action reports.
    """
    domain = robot.domain
    label = robot.classifier.classify(instance)
    evidence = domain.evidence(instance.context, label)
    marginal = robot.reasoner.posterior(domain.target, evidence)
    prior = robot.planner.start if marginal is None else domain.prior(marginal)
    steps, report = act_until_report(robot, prior, world, max_steps=max_steps)
    return Episode(label, evidence, marginal, prior, steps, report)


def act_until_report(
    robot: Robot,
    prior: Belief,
    world: World,
    *,
    max_steps: int = MAX_STEPS,
    listener: Callable[[Step], None] = lambda _: None,
) -> tuple[tuple[Step, ...], str | None]:
    """The loop of Algorithm 2, lines 8 to 13.

    Args:
        prior: (S,) the belief to start from.
        listener: called after every step.

    Returns:
        The steps and the value reported; None where the terminal state was reached without a report.
    """
    belief, steps = prior, list[Step]()
    while not robot.domain.finished(belief):
        if len(steps) == max_steps:
            raise DecisionError(f"no report after {max_steps} actions; the last one was {steps[-1].action!r}")
        action = robot.planner.action(belief)
        value = robot.domain.report(action)
        observation = None
        if value is not None:
            world.report(action)
        else:
            observation = world.act(action)
            belief = robot.planner.update(belief, action, observation)
        steps.append(Step(action, observation, belief))
        listener(steps[-1])
        if value is not None:
            return tuple(steps), value
    return tuple(steps), None

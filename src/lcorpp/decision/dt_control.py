"""Algorithm 2, decision-theoretic control: from an instance to a reported label."""

from __future__ import annotations

import logging
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter

from lcorpp.errors import DecisionError, NoReportError, ObservationError
from lcorpp.notebook import html_table
from lcorpp.protocols import Classifier, DomainInterface, Planner, Reasoner, World
from lcorpp.values import Belief, Distribution, Episode, Instance, Label, SharedValue, Step, format_value

LOG = logging.getLogger("lcorpp.decision")
"""At INFO one line a decision, at DEBUG one line a step."""

MAX_STEPS = 500
"""Maximum number of actions in one decision; a longer one indicates a policy that never reports."""


PARTS = {"classifier": Classifier, "reasoner": Reasoner, "planner": Planner, "domain": DomainInterface}
MAIN_PARTS = ("reasoner", "planner", "domain")
MEMBERS = {part: [name for name in vars(protocol) if name[0] != "_"] for part, protocol in PARTS.items()}
"""The methods and properties that each part of a robot needs: those of its protocol."""


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """The parts of a deciding robot; `lcorpp.load_robot` composes one with a method `decide`, `DomainRobot`.

    classifiers: sense -> its classifier, rho; none for a robot that does not learn.
    reasoner: theta. planner: pi, with its model M. domain: translates between them.

    Raises:
        DecisionError: a part lacks a method of its protocol.

    Examples:
        >>> from lcorpp import Planner, Reasoner, Robot, load_domain, solve
        >>> domain = load_domain("intention")
        >>> Robot({}, Reasoner(domain.program), Planner(solve(domain.pomdp)), domain)
        Robot(classifiers: none; reasoner: Reasoner, planner: Planner; shared: intention)
    """

    classifiers: Mapping[str, Classifier]
    reasoner: Reasoner
    planner: Planner
    domain: DomainInterface

    def __post_init__(self) -> None:
        if not isinstance(self.classifiers, Mapping):
            raise DecisionError(
                f"the classifiers of a robot are {reprlib.repr(self.classifiers)};"
                " expected sense -> classifier"
            )
        for classifier in self.classifiers.values():
            _check_part("classifier", classifier)
        for part in MAIN_PARTS:
            _check_part(part, getattr(self, part))

    def __repr__(self) -> str:
        senses = ", ".join(f"{sense}: {type(part).__name__}" for sense, part in self.classifiers.items())
        parts = ", ".join(f"{part}: {type(getattr(self, part)).__name__}" for part in ("reasoner", "planner"))
        shared = self.domain.shared
        names = shared if isinstance(shared, str) else ", ".join(shared)
        return f"Robot(classifiers: {senses or 'none'}; {parts}; shared: {names})"

    def _repr_html_(self) -> str:
        parts = {f"classifier of {sense}": part for sense, part in self.classifiers.items()}
        rows = (
            (name, repr(part)) for name, part in (parts | {x: getattr(self, x) for x in MAIN_PARTS}).items()
        )
        return html_table(("part", "object"), rows, caption="Robot")

    def classify(self, instance: Instance) -> dict[str, Label]:
        """Return the output of the classifier of each sense that perceived the person."""
        labels = {}
        for sense, classifier in self.classifiers.items():
            if sense in instance.signals:
                label = classifier.classify(instance.signals[sense])
                if label is not None:
                    labels[sense] = label
        return labels


def _check_part(part: str, value: object) -> None:
    if isinstance(value, type) or not all(hasattr(value, name) for name in MEMBERS[part]):
        raise DecisionError(
            f"the {part} of a robot is {reprlib.repr(value)}; expected an object with"
            f" {', '.join(MEMBERS[part])}"
        )


def dt_control(
    robot: Robot,
    instance: Instance,
    world: World,
    *,
    max_steps: int = MAX_STEPS,
    listener: Callable[[Step], None] = lambda _: None,
) -> Episode:
    """Decide about one person: classify, reason, then act until the report.

    Args:
        robot: the parts.
        instance: what the robot perceives of the person before any action.
        world: executes the actions.
        max_steps: maximum number of actions.
        listener: called after every step.

    Returns:
        The episode, with every intermediate result.

    Raises:
        UndefinedError: the reasoner's evidence is impossible.
        ObservationError: the world returned an observation that is impossible in the planner's model.
        NoReportError: no report within `max_steps` actions.

    Source: Algorithm 2. Line 1 is `classify`, 2 `evidence`, 3 to 6 `posterior` of the shared variables,
    7 `prior`, 8 to 12 `act_until_report`, 13 the value reported by the last action.

    Examples:
        >>> from lcorpp import Instance, dt_control, load_robot
        >>> from lcorpp.worlds import ScriptedWorld
        >>> robot = load_robot("intention").robot
        >>> dt_control(robot, Instance({}, {"time": "morning"}), ScriptedWorld(["neg", "neg"])).report
        'not_interested'
    """
    began = perf_counter()
    labels = robot.classify(instance)
    classified = perf_counter()
    evidence, marginal, prior = infer_prior(robot, instance.context, labels)
    reasoned = perf_counter()
    steps, report, plan_seconds = act_until_report(
        robot, prior, world, max_steps=max_steps, listener=listener
    )
    seconds = {"classify": classified - began, "reason": reasoned - classified, "plan": plan_seconds}
    episode = Episode(labels, evidence, marginal, prior, steps, report, seconds)
    log_decision(episode)
    return episode


def infer_prior(
    robot: Robot, context: Mapping[str, str], labels: Mapping[str, Label]
) -> tuple[Mapping[str, Label], Distribution | None, Belief]:
    """Compute the planner's initial belief from facts and labels: Algorithm 2, lines 2 to 7.

    Returns:
        The evidence, the marginal of the shared variables, and the prior (S,), as in `Episode`.
    """
    domain = robot.domain
    evidence = domain.evidence(context, labels)
    marginal = robot.reasoner.posterior(domain.shared, evidence)
    prior = robot.planner.start if marginal is None else domain.prior(marginal)
    if LOG.isEnabledFor(logging.DEBUG):
        LOG.debug("evidence %s: %s, prior %s", evidence, marginal, prior)
    return evidence, marginal, prior


def act_until_report(
    robot: Robot,
    prior: Belief,
    world: World,
    *,
    max_steps: int = MAX_STEPS,
    listener: Callable[[Step], None] = lambda _: None,
) -> tuple[tuple[Step, ...], SharedValue | None, float]:
    """Run the loop of Algorithm 2, lines 8 to 13.

    Args:
        prior: (S,) the initial belief.
        listener: called after every step.

    Raises:
        NoReportError: no report within `max_steps` actions.

    Returns:
        The steps; the reported value, None if the terminal state was reached without a report; and the
        seconds of the loop, without those in which the world acts.
    """
    domain, planner, debug = robot.domain, robot.planner, LOG.isEnabledFor(logging.DEBUG)
    belief, steps = prior, list[Step]()
    value: SharedValue | None = None
    began, world_seconds = perf_counter(), 0.0
    while value is None and not domain.is_terminal(belief):
        if len(steps) == max_steps:
            raise NoReportError(
                f"no report after {max_steps} actions; the last one was {steps[-1].action!r}; the policy does"
                f" not report from the prior {domain.marginal(prior)}"
            )
        action = planner.action(belief)
        value, observation = domain.reported_value(action), None
        asked = perf_counter()
        if value is not None:
            world.report(action)
            world_seconds += perf_counter() - asked
        else:
            observation = world.act(action)
            world_seconds += perf_counter() - asked
            try:
                belief = planner.update(belief, action, observation)
            except ObservationError as error:
                source = getattr(world, "source", "")  # a world of the user's names its file
                if not source:
                    raise
                raise ObservationError(f"{source}(): {error}") from error
        steps.append(Step(action, observation, belief))
        if debug:
            LOG.debug("%s: %s, belief %s", action, observation or "a report", belief)
        listener(steps[-1])
    return tuple(steps), value, perf_counter() - began - world_seconds


def log_decision(episode: Episode) -> None:
    """Write a decision to the log of the standard library, in one line at INFO."""
    if LOG.isEnabledFor(logging.INFO):
        given = ", ".join(f"{name}={value}" for name, value in episode.evidence.items())
        steps = ", ".join(f"{step.action} {step.observation or ''}".rstrip() for step in episode.steps)
        report = "no report" if episode.report is None else format_value(episode.report)
        LOG.info("given %s: %s; %s", given or "nothing", report, steps)
